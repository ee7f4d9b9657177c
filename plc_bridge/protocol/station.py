"""The registers and bits of one link for requests on any bus, and the client's rights to them."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from pymodbus.constants import ExcCodes

from plc_bridge.config import ALL_RIGHTS, Right
from plc_bridge.protocol.images import COMMAND, DIAGNOSTICS, PACKML, command_image
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.registers import COILS, MIRROR, Lease

logger = logging.getLogger(__name__)

T = TypeVar("T")

_LEASE = next(register for register in COMMAND.registers if register.name == "command_lease")
_SEQUENCE = next(register.address for register in COMMAND.registers if register.name == "command_sequence")


@dataclass(slots=True)
class LinkWords:
    """The words of one link."""

    source: str
    words: list[int] = field(default_factory=lambda: [0] * COMMAND.words)
    coils: list[bool] = field(default_factory=lambda: [False] * len(COILS))
    is_numbered: bool = False
    """True if its sequence register has been written."""


@dataclass(slots=True, eq=False)
class LinkStation:
    """One client's view of the map."""

    mailbox: Mailbox
    link: LinkWords
    """Words of the client's link; replaced when connections share one link."""
    counts: Diagnostics
    """Counts of refusals."""
    rights: frozenset[Right] = ALL_RIGHTS
    """Rights of the client's role; "command" includes the stop coil."""
    warn: Callable[..., None] = logger.warning
    """Logs errors of the client."""
    share: Callable[[], None] | None = None
    """Called when the client requests one link for all connections of its host."""
    holds_stop: bool = field(init=False, default=False)
    """True if its stop coil is 1; each connection has its own."""
    _told: set[str | int] = field(init=False, default_factory=set)

    def read_words(self, function: int, address: int, count: int) -> list[int]:
        """Return holding registers (3) or input registers (4)."""
        self._demand("read")
        if function == 3 and address < MIRROR:
            return _slice(self.link.words, address, count)
        start = address - (MIRROR if function == 3 else 0)
        if start < DIAGNOSTICS.start:
            return _slice(self.mailbox.report_words(self.link.source), start, count)
        if start < PACKML.start:
            return _slice(self.mailbox.diagnostics_words(), start - DIAGNOSTICS.start, count)
        return _slice(self.mailbox.packml_words(), start - PACKML.start, count)

    def read_bits(self, function: int, address: int, count: int) -> list[bool]:
        """Return coils (1) or discrete inputs (2)."""
        self._demand("read")
        bits = list(self.link.coils) if function == 1 else self.mailbox.discrete_inputs(self.link.source)
        if function == 1:
            bits[COILS["stop"]] = self.holds_stop
        return _slice(bits, address, count)

    def write_words(self, address: int, words: Sequence[int]) -> None:
        """Write into the command block, all or nothing.

        Raises:
            ValueError: The value of `command_lease` does not exist.
        """
        self._demand("command")
        _slice(self.link.words, address, len(words))
        wish = words[_LEASE.address - address] if address <= _LEASE.address < address + len(words) else Lease.NONE
        if not Lease.NONE <= wish <= Lease.RELEASE:
            why = f"{_LEASE.name} = {wish}: {Lease.NONE} to {Lease.RELEASE} allowed"
            self._say_once(why, why)
            raise ValueError(wish)
        if wish == Lease.TAKE_FOR_HOST and self.share is not None:
            self.share()  # before the write: the words belong in the block that all connections of the host share
        self.link.words[address : address + len(words)] = words
        is_number = address <= _SEQUENCE < address + len(words)
        self.link.is_numbered |= is_number
        by = self if is_number else None
        self.mailbox.wrote(self.link.source, command_image(self.link.words), self.link.is_numbered, by)

    def write_bits(self, address: int, bits: Sequence[bool]) -> None:
        """Write coils."""
        is_stop_alone = address == COILS["stop"] and len(bits) == 1
        self._demand("stop" if is_stop_alone and "command" not in self.rights else "command")
        _slice(self.link.coils, address, len(bits))
        self.link.coils[address : address + len(bits)] = bits
        written = {name: bits[place - address] for name, place in COILS.items() if 0 <= place - address < len(bits)}
        self.holds_stop = written.get("stop", self.holds_stop)
        self.mailbox.switched(self.link.source, written, self)

    def leave(self) -> None:
        """Leave the link, and release the stop that this client holds."""
        self.mailbox.left(self.link.source, self)

    def move(self, link: LinkWords) -> None:
        """Move to a shared link; a held stop moves with it."""
        self.link = link
        if self.holds_stop:
            self.mailbox.switched(link.source, {"stop": True}, self)

    def mask_word(self, address: int, kept: int, added: int) -> None:
        """Write one register of the command block through two masks.

        Raises:
            ValueError: The value of `command_lease` does not exist.
        """
        self._demand("command")
        (word,) = _slice(self.link.words, address, 1)
        self.write_words(address, [word & kept | added & ~kept])

    def is_running(self) -> bool:
        """Return True if the cell scans."""
        self._demand("read")
        return self.mailbox.is_scanned

    def refused(self, function: int, exception: int) -> None:
        """Log an exception response, once for each exception code."""
        self._say_once(exception, f"function {function}: exception {exception:02d}")

    def _say_once(self, key: str | int, why: str) -> None:
        if key not in self._told:
            self._told.add(key)
            self.warn("%s: refused: %s", self.link.source, why)

    def _demand(self, right: Right) -> None:
        if right in self.rights:
            return
        self.counts.unauthorised += 1
        if right not in self._told:
            self._told.update((right, int(ExcCodes.ILLEGAL_FUNCTION)))
            self.warn("%s: refused: its role may not %s", self.link.source, right)
        raise PermissionError(right)


def _slice(values: list[T], start: int, count: int) -> list[T]:
    if start < 0 or start + count > len(values):
        raise LookupError(f"{start}..{start + count - 1} is not within 0..{len(values) - 1}")
    return values[start : start + count]
