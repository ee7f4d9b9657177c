"""Memory shared by the cell and the arm's torque loop: one block, each direction guarded by a sequence counter."""

import math
import mmap
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from drivers import impedance, setpoint_words
from drivers.quantities import Vector

CYCLES_KEPT = 600_000
"""Number of the loop's newest cycles with recorded times; they last ten minutes."""
TEXT = 400
"""Longest message, bytes."""

_LAYOUT = np.dtype(
    [
        ("setpoint_sequence", np.int64),
        ("words", np.float64, setpoint_words.WORDS),
        ("resets", np.int64),
        ("start_by", np.float64),
        ("state_sequence", np.int64),
        ("q", np.float64, 7),
        ("dq", np.float64, 7),
        ("force", np.float64, 3),
        ("torque", np.float64, 3),
        ("commanded", np.float64, 7),
        ("unexplained", np.float64, 7),
        ("phase", np.int64),
        ("failures", np.int64),
        ("resets_done", np.int64),
        ("text", f"S{TEXT}"),
        ("is_realtime", np.int64),
        ("end_effector", np.float64),
        ("load", np.float64),
        ("cycles", np.int64),
        ("missed", np.int64),
        ("success", np.float64),
        ("busy", np.float32, CYCLES_KEPT),
        ("spacing", np.float32, CYCLES_KEPT),
    ]
)
SIZE = _LAYOUT.itemsize


class LoopPhase(IntEnum):
    """Phase of the torque loop."""

    CONNECTING = 0
    RUNNING = 1
    REFLEX = 2
    """The arm stopped itself; a reset is needed."""
    STOPPED = 3
    """Emergency stop, protective stop, or hand guiding."""
    LOST = 4
    """The connection is lost; a reset connects again."""
    REFUSED = 5
    """The arm's system and the maker's library are incompatible."""


def holding_words() -> Vector:
    """Return the words of "hold still at the present pose, compliant", shape (WORDS,): a setpoint that is never valid."""
    words = np.zeros(setpoint_words.WORDS)
    words[setpoint_words.VALID_UNTIL] = -math.inf
    return words


def compile_law(figures: Vector, law: Vector, period: float) -> None:
    """Compile the law for this computer, or load it if it was compiled before.

    Args:
        figures: Figures of the arm, see `drivers.impedance.figures`.
        law: State of the law; it is not changed.
        period: Period of the loop, s.
    """
    q, dq = np.zeros(7), np.zeros(7)
    impedance.torque(figures, holding_words(), law.copy(), q, dq, 0.0, period)


class LoopLink:
    """One end of the shared block.

    Each record has one writing and one reading process. The writer makes the counter odd, writes, and makes the counter
    even. The reader accepts a copy only if the counter was even and equal before and after it, so it never reads half of a
    setpoint.
    """

    def __init__(self, handle: int) -> None:
        """Map the block of a file handle."""
        self._map = mmap.mmap(handle, SIZE)
        # A view of one record; scalars of a field are written through index 0.
        self.block: NDArray[np.void] = np.frombuffer(self._map, _LAYOUT, 1)
        self._fields = {name: self.block[name] for name in _LAYOUT.names or ()}

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a view of a field, shape (1, ...)."""
        field: NDArray[np.float64] = self._fields[name]
        return field

    def begin(self, counter: str) -> None:
        """Begin to write the record that `counter` guards."""
        self._fields[counter][0] += 1

    end = begin
    """`begin` and `end` both add one to the counter: it is odd during a write and even when the record is whole."""

    def is_settled(self, counter: str) -> int | None:
        """Return the count if no write is in progress, else None."""
        count = int(self._fields[counter][0])
        return None if count % 2 else count
