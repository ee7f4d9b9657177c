"""The switch board's packet and bytes; pure, no I/O.

The board sends ten bytes at 38400 baud, 8N1, and receives none. Only the first byte has its highest bit set. If a reader
loses bytes, it therefore resynchronises at the next packet:

| byte | content |
| --- | --- |
| 0 | 0xD1 |
| 1 | version of the firmware, 1 to 127 |
| 2 | bits 0-1: debounced contacts (`Contacts`); bit 2, 3: normally open, normally closed contact conducts now |
| 3 | bit 0: memory broken; 1: program broken; 2, 3: restarted by watchdog, by low supply |
| 4-6 | time since its reset, ms, modulo 2**21, low seven bits first |
| 7-9 | CRC-16/CCITT (polynomial 0x1021, start 0xFFFF) of bytes 0 to 6, low seven bits first |
"""

from binascii import crc_hqx
from dataclasses import dataclass
from enum import IntEnum

BAUD_RATE = 38400
LENGTH = 10
TIME_RANGE = 2**21
"""Range of the board's time, ms; the time then restarts from 0."""
_START = 0xD1
_CRC_START = 0xFFFF
_CONTACTS = {"normally_open": 4, "normally_closed": 8}
_HEALTH = {"is_memory_broken": 1, "is_program_broken": 2, "was_hung": 4, "was_starved": 8}
"""Bits of bytes 2 and 3 by the fields of `SwitchReport`."""


class Contacts(IntEnum):
    """State of the switch, derived from its two contacts."""

    UNKNOWN = 0
    """The contacts are not yet debounced since the reset, or the board has detected its own failure."""
    OPEN = 1
    CLOSED = 2
    DISAGREE = 3
    """Both contacts conduct, or neither, for longer than the lever's travel time."""


@dataclass(frozen=True, slots=True)
class SwitchReport:
    """Content of one packet."""

    firmware: int
    """Version of the firmware, 0 to 127."""
    contacts: Contacts
    time: int
    """Time since the board's reset, ms, modulo `TIME_RANGE`."""
    normally_open: bool = False
    """True if the normally open contact conducts now."""
    normally_closed: bool = False
    """True if the normally closed contact conducts now."""
    is_memory_broken: bool = False
    is_program_broken: bool = False
    was_hung: bool = False
    """True if the watchdog restarted the program."""
    was_starved: bool = False
    """True if the board restarted after its supply fell too low; a boot loader may hide it."""


def encode(report: SwitchReport) -> bytes:
    """Return a report as the bytes of its packet."""
    contacts, health = (sum(bit * getattr(report, name) for name, bit in bits.items()) for bits in (_CONTACTS, _HEALTH))
    head = bytes([_START, report.firmware, report.contacts | contacts, health, *_septets(report.time % TIME_RANGE)])
    return head + bytes(_septets(crc_hqx(head, _CRC_START)))


def decode(packet: bytes) -> SwitchReport | None:
    """Return the report in a packet; None if length, bits or CRC are wrong."""
    if len(packet) != LENGTH or packet[0] != _START or any(byte & 0x80 for byte in packet[1:]):
        return None
    if packet[7:] != bytes(_septets(crc_hqx(packet[:7], _CRC_START))):
        return None
    contacts = {name: bool(packet[2] & bit) for name, bit in _CONTACTS.items()}
    health = {name: bool(packet[3] & bit) for name, bit in _HEALTH.items()}
    time = packet[4] | packet[5] << 7 | packet[6] << 14
    return SwitchReport(packet[1], Contacts(packet[2] & 3), time, **contacts, **health)


class Decoder:
    """Finds packets in pieces of bytes of any size."""

    def __init__(self) -> None:
        self._packet = bytearray()
        self.refused = 0
        """Number of bytes outside valid packets."""

    def feed(self, data: bytes) -> list[SwitchReport]:
        """Return the packets that `data` completes, oldest first."""
        reports = []
        for byte in data:
            if byte & 0x80:
                self.refused += len(self._packet)
                self._packet.clear()
            elif not self._packet:
                self.refused += 1
                continue
            self._packet.append(byte)
            if len(self._packet) == LENGTH:
                report = decode(bytes(self._packet))
                if report is None:
                    self.refused += LENGTH
                else:
                    reports.append(report)
                self._packet.clear()
        return reports


def _septets(value: int) -> tuple[int, int, int]:
    return value & 0x7F, value >> 7 & 0x7F, value >> 14
