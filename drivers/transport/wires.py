"""Common types of all wires, without any I/O: CAN frames, the contracts of a bus and of a line, and the errors of their loss."""

from dataclasses import dataclass, field
from typing import Literal, Protocol

from drivers.errors import CellError, FaultCode

Interface = Literal["socketcan", "slcan", "socketcand", "udp_multicast", "virtual"]
Parity = Literal["none", "even", "odd"]


class CanLostError(CellError, code=FaultCode.DEVICE_NOT_OPENED):
    """A bus that was open can no longer be read or written."""

    code = FaultCode.DEVICE_NOT_OPENED

class LineLostError(CellError, code=FaultCode.DEVICE_NOT_OPENED):
    """A line that was open can no longer be read or written."""

    code = FaultCode.DEVICE_NOT_OPENED


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


class CanLink(Protocol):
    """A CAN bus; `CanBus` of `drivers.transport.can_bus` is one."""

    def open(self) -> None:
        """Open the bus."""

    def close(self) -> None:
        """Close the bus; may be called again."""

    def read(self, timeout: float) -> CanFrame | None:
        """Return the next frame; None if none arrives within `timeout`, s."""

    def write(self, frame: CanFrame) -> None:
        """Send one frame."""


class ByteLink(Protocol):
    """A serial line; `SerialLine` of `drivers.transport.serial_line` is one."""

    character_time: float
    """Transfer time of one character, s."""

    def open(self) -> None:
        """Open the port."""

    def close(self) -> None:
        """Close the port; may be called again."""

    def read(self, timeout: float) -> bytes:
        """Return the bytes received within `timeout`, s."""

    def write(self, data: bytes) -> None:
        """Send `data`."""
