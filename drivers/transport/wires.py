"""Common types of all wires, without any I/O: CAN frames, the contracts of a bus and of a line, and the errors of their loss."""

from dataclasses import dataclass, field
from typing import Literal, Protocol, TypeVar

from drivers.errors import CellError, FaultCode

Interface = Literal["socketcan", "slcan", "socketcand", "udp_multicast", "virtual"]
Parity = Literal["none", "even", "odd"]
Received = TypeVar("Received", covariant=True)
Sent = TypeVar("Sent", contravariant=True)


class CanLostError(CellError, code=FaultCode.DEVICE_NOT_OPENED):
    """A bus that was open can no longer be read or written."""


class LineLostError(CellError, code=FaultCode.DEVICE_NOT_OPENED):
    """A line that was open can no longer be read or written."""


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One data frame."""

    id: int
    """Identifier, 0 to 0x7FF, or to 0x1FFFFFFF if extended; the lower one has priority on the bus."""
    data: bytes = b""
    """Payload, at most 8 bytes."""
    is_extended: bool = False
    """True if the identifier has 29 bits instead of 11."""
    waited: float = field(default=0.0, compare=False)
    """Time from arrival at the adapter to this read, s; 0 if the interface does not report it."""


class Link(Protocol[Received, Sent]):
    """A wire that carries frames or bytes."""

    def open(self) -> None:
        """Open the bus or the port."""

    def close(self) -> None:
        """Close the bus or the port; may be called again."""

    def read(self, timeout: float) -> Received:
        """Return the next frame, None if there is none, or the bytes received within `timeout`, s."""

    def write(self, data: Sent) -> None:
        """Send one frame, or bytes."""


CanLink = Link[CanFrame | None, CanFrame]
"""A CAN bus; `CanBus` of `drivers.transport.can_bus` is one."""


class ByteLink(Link[bytes, bytes], Protocol):
    """A serial line; `SerialLine` of `drivers.transport.serial_line` is one."""

    character_time: float
    """Transfer time of one character, s."""
