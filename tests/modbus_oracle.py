"""Answers that the Modbus specification requires: written from the documents, not from the server that they check.

Modbus Application Protocol V1.1b3, 6 and 7: a wrong function code is exception 01, a wrong quantity, value or length
03, a wrong address 02, in this order; what is refused changes nothing.
"""

import struct
from importlib.metadata import version

COMMAND_WORDS, REPORT_WORDS, DIAGNOSTICS_WORDS, DIAGNOSTICS_AT, MIRROR = 41, 75, 26, 100, 1000
PACKML_AT, PACKML_WORDS = 200, 42
COILS, INPUTS = 3, 5
LEASE, GREATEST_WISH = 5, 3
"""Address of the wish for the lease, and the greatest that there is."""
SERVER_ID = b"\x11\x17tactile-insertion-cell\x00"
"""Of a cell that nobody scans, as under attack."""
IDENTITY_SIZES = {0: 22, 1: 4, 2: len(version("tactile-insertion-cell")), 4: 22, 5: 16}
"""Length of each object of the identification."""
IDENTITY = list(IDENTITY_SIZES)
MOST = {1: 2000, 2: 2000, 3: 125, 4: 125, 15: 1968, 16: 123}


class Oracle:
    """One connection's own block; `answer` returns the answer to a request and executes it."""

    def __init__(self) -> None:
        self.words = [0] * COMMAND_WORDS
        self.coils = [0] * COILS

    def answer(self, pdu: bytes) -> tuple[bytes, int]:
        """Return the beginning and the whole length of the answer; the content of the report is not foreseen."""
        function = pdu[0]
        if function in (8, 17, 43):
            told = self._tell(function, pdu)
            return self._exception(function, told) if isinstance(told, int) else told
        if function not in (1, 2, 3, 4, 5, 6, 15, 16, 22, 23):
            return self._exception(function, 1)
        other = {22: self._mask, 23: self._exchange}
        served = other[function](pdu) if function in other else self._simple(function, pdu)
        return self._exception(function, served) if isinstance(served, int) else served

    @staticmethod
    def _exception(function: int, code: int) -> tuple[bytes, int]:
        return bytes([function | 0x80, code]), 2

    def _simple(self, function: int, pdu: bytes) -> tuple[bytes, int] | int:  # noqa: C901  a table of cases
        if function in (15, 16):
            if len(pdu) < 6 or len(pdu) != 6 + pdu[5]:
                return 3
        elif len(pdu) != 5:
            return 3
        start, value = struct.unpack(">HH", pdu[1:5])
        if function in MOST and not 1 <= value <= MOST[function]:
            return 3
        match function:
            case 1:
                return self._bits(function, self.coils, start, value)
            case 2:
                return self._unforeseen(function, (value + 7) // 8) if start + value <= INPUTS else 2
            case 3 | 4:
                return self._read(function, start, value)
            case 5:
                if value not in (0, 0xFF00):
                    return 3
                return self._put(self.coils, start, [value >> 15], pdu)
            case 6:
                return self._put(self.words, start, [value], pdu)
            case 15:
                if pdu[5] != (value + 7) // 8:
                    return 3
                bits = [pdu[6 + n // 8] >> n % 8 & 1 for n in range(value)]
                return self._put(self.coils, start, bits, pdu[:5])
            case _:
                if pdu[5] != 2 * value:
                    return 3
                return self._put(self.words, start, list(struct.unpack(f">{value}H", pdu[6:])), pdu[:5])

    def _mask(self, pdu: bytes) -> tuple[bytes, int] | int:
        if len(pdu) != 7:
            return 3
        start, kept, added = struct.unpack(">HHH", pdu[1:])
        if start >= COMMAND_WORDS:
            return 2
        return self._put(self.words, start, [self.words[start] & kept | added & ~kept & 0xFFFF], pdu)

    @staticmethod
    def _tell(function: int, pdu: bytes) -> tuple[bytes, int] | int:
        """Return the answer about the device itself: 6.8 echo, 6.13 server ID, 6.21 identification."""
        if function == 17:
            return (SERVER_ID, len(SERVER_ID)) if len(pdu) == 1 else 3
        if function == 8:
            if len(pdu) < 5 or len(pdu) % 2 == 0:
                return 3
            return (pdu, len(pdu)) if pdu[1:3] == b"\0\0" else 1
        if len(pdu) != 4:
            return 3
        if pdu[1] != 14:
            return 1
        numbers = {1: IDENTITY[:3], 2: IDENTITY, 3: IDENTITY, 4: [pdu[3]]}.get(pdu[2])
        if numbers is None or not set(numbers) <= set(IDENTITY):
            return 3 if numbers is None else 2
        start = pdu[3] if pdu[3] in numbers else 0
        numbers = [number for number in numbers if number >= start]
        head = bytes([43, 14, pdu[2], 0x82, 0, 0, len(numbers), numbers[0]])
        return head, len(head) - 1 + sum(2 + IDENTITY_SIZES[number] for number in numbers)

    def _exchange(self, pdu: bytes) -> tuple[bytes, int] | int:
        if len(pdu) <= 10 or len(pdu) != 10 + pdu[9]:
            return 3
        read, read_count, start, count = struct.unpack(">HHHH", pdu[1:9])
        if not 1 <= read_count <= 125 or not 1 <= count <= 121 or pdu[9] != 2 * count:
            return 3
        if isinstance(self._read(23, read, read_count), int) or start + count > COMMAND_WORDS:
            return 2
        values = list(struct.unpack(f">{count}H", pdu[10:]))
        if _wishes_nonsense(start, values):
            return 3
        self.words[start : start + count] = values
        return self._read(23, read, read_count)

    def _read(self, function: int, start: int, count: int) -> tuple[bytes, int] | int:
        if function != 4 and start + count <= COMMAND_WORDS:
            body = struct.pack(f">{count}H", *self.words[start : start + count])
            return bytes([function, 2 * count]) + body, 2 + 2 * count
        if function != 4:
            start -= MIRROR
        is_there = start >= 0 and start + count <= REPORT_WORDS
        is_there |= start >= DIAGNOSTICS_AT and start + count <= DIAGNOSTICS_AT + DIAGNOSTICS_WORDS
        is_there |= start >= PACKML_AT and start + count <= PACKML_AT + PACKML_WORDS
        return self._unforeseen(function, 2 * count) if is_there else 2

    def _bits(self, function: int, bits: list[int], start: int, count: int) -> tuple[bytes, int] | int:
        if start + count > len(bits):
            return 2
        value = sum(bit << n for n, bit in enumerate(bits[start : start + count]))
        return bytes([function, 1, value]), 3

    @staticmethod
    def _unforeseen(function: int, size: int) -> tuple[bytes, int]:
        return bytes([function, size]), 2 + size

    @staticmethod
    def _put(block: list[int], start: int, values: list[int], echo: bytes) -> tuple[bytes, int] | int:
        if start + len(values) > len(block):
            return 2
        if len(block) == COMMAND_WORDS and _wishes_nonsense(start, values):
            return 3
        block[start : start + len(values)] = values
        return echo, len(echo)


def _wishes_nonsense(start: int, values: list[int]) -> bool:
    return start <= LEASE < start + len(values) and values[LEASE - start] > GREATEST_WISH
