"""iCub skin: the frames of its boards <-> readings; pure, no I/O.

From robotology/icub-firmware-shared 62f2818 and icub-main 24c1a00: id = class << 8 | board << 4 | triangle. A head
frame holds taxels 0 to 6. A tail frame holds taxels 7 to 11, the out-of-range bits of all twelve, and four error bits.
A reading is 0xF0 without a load and falls with pressure. A frame has no check sum besides CAN's own.
"""

from dataclasses import dataclass

import numpy as np

from drivers.skin.health import ERROR_COUNT, Counts
from drivers.transport.wires import CanFrame

TAXELS = 12
FRAME_BYTES = 8
HEAD, TAIL = 0x40, 0xC0
SKIN_CLASS, SETUP_CLASS = 4, 2
SETUP = 0x4C
COUNTS_PER_STEP = 128
"""Number of this program's counts in one step of the board's 8-bit reading."""
_HEAD_TAXELS = 7


@dataclass(frozen=True, slots=True)
class TriangleReading:
    """Readings of one triangle at one instant, as the board sends them."""

    values: tuple[int, ...]
    """Readings of the twelve taxels, 0 to 255; they fall with pressure."""
    out_of_range: int = 0
    """Mask with one bit for each taxel; 1 if the taxel is out of range."""
    error: int = 0
    """Error code of the board, 0 to 15; 0 means none."""

    def counts(self) -> Counts:
        """Return counts that rise with pressure, shape (12,), with error marks in place of missing measurements."""
        counts = (0xFF - np.array(self.values)) * COUNTS_PER_STEP
        is_wrong = np.array([self.error != 0 or bool(self.out_of_range >> k & 1) for k in range(TAXELS)])
        return np.where(is_wrong, ERROR_COUNT, counts).astype(np.uint16)


def encode_triangle(board: int, triangle: int, reading: TriangleReading) -> tuple[CanFrame, CanFrame]:
    """Return the head and the tail frame of one triangle's reading."""
    name = SKIN_CLASS << 8 | board << 4 | triangle
    head = bytes([HEAD, *reading.values[:_HEAD_TAXELS]])
    flags = bytes([reading.out_of_range >> 4, (reading.out_of_range & 0xF) << 4 | reading.error])
    return CanFrame(name, head), CanFrame(name, bytes([TAIL, *reading.values[_HEAD_TAXELS:]]) + flags)


class TriangleAssembler:
    """Joins the frames of one board to whole triangles.

    Args:
        board: Number of the board, 0 to 15.
    """

    def __init__(self, board: int) -> None:
        self._board = board
        self._heads: dict[int, tuple[int, ...]] = {}
        self.broken = 0
        """Number of frames that cannot be decoded, and of heads and tails without their other half."""

    def feed(self, frame: CanFrame) -> tuple[int, TriangleReading] | None:
        """Take one frame; return the triangle's number and its reading if both halves have arrived."""
        if frame.is_extended or frame.id >> 4 != SKIN_CLASS << 4 | self._board:
            return None
        triangle, is_whole = frame.id & 0xF, len(frame.data) == FRAME_BYTES
        head = self._heads.pop(triangle, None)
        if is_whole and frame.data[0] == HEAD:
            self.broken += head is not None
            self._heads[triangle] = tuple(frame.data[1:])
            return None
        if head is None or not is_whole or frame.data[0] != TAIL:
            self.broken += 1
            return None
        high, low = frame.data[-2:]
        return triangle, TriangleReading(head + tuple(frame.data[1:-2]), high << 4 | low >> 4, low & 0xF)


def setup(board: int) -> CanFrame:
    """Return the frame that makes a board send, with the settings of icub-main."""
    return CanFrame(SETUP_CLASS << 8 | board, bytes([SETUP, 0x01, 0x01, 0x01, 0x00, 0x20, 0x00, 0x00]))
