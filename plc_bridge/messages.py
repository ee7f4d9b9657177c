"""What crosses the line, as values: one Command in, one Report out."""

from dataclasses import dataclass, field
from enum import IntEnum


class Transition(IntEnum):
    """What made the cell's state change, but for a state's having done what it does."""

    RESET = 1
    START = 2
    STOP = 3
    HOLD = 4
    UNHOLD = 5
    ABORT = 6
    CLEAR = 7


class Result(IntEnum):
    """How the acknowledged command ended."""

    NONE = 0
    SUCCESS = 1
    FAILURE = 2
    ABORTED = 3
    FAULT = 4
    REFUSED = 5


class Refusal(IntEnum):
    """Why a command was not accepted."""

    NONE = 0
    UNKNOWN_CODE = 1
    UNKNOWN_RECIPE = 2
    BUSY = 3
    NOT_READY = 4
    NOT_HOLDER = 5
    VERSION = 6
    PARAMETER = 7
    TORN = 8
    ADOPTED = 9
    """First sequence number after start, reconnect or a lost PLC: taken over, never run."""
    LATE = 10
    """Sequence number just behind the last one: an old write that arrived late."""
    STOP_HELD = 11
    """A stop coil is 1 somewhere: nothing starts, goes on or is reset before it falls."""


class Control(IntEnum):
    """Command codes that act on the state machine; programs and skills have the codes from 100 on."""

    NONE = 0
    RESET = 1
    STOP = 2
    HOLD = 3
    UNHOLD = 4
    ABORT = 8
    CLEAR = 9
    LOST = 0x10000
    """Made by the watchdog: whoever started the run has fallen silent; no 16-bit register can hold it."""
    ACKNOWLEDGE = 0x10001
    """Made by the handshake: the result has been read."""


UNNUMBERED = -1
"""Sequence of a stop that came without one: by a coil or by the stop object of CAN."""
FIRST_PROGRAM = 100
"""Lowest command code of a program or a skill."""


class LeaseState(IntEnum):
    """Who may start, as one reader sees it."""

    FREE = 0
    YOURS = 1
    TAKEN = 2


@dataclass(frozen=True, slots=True)
class Command:
    """One request of whoever holds the lease; counts once, when its sequence number changes."""

    sequence: int
    code: int
    recipe: int = 0
    serial: str = ""
    parameters: tuple[tuple[str, float], ...] = ()
    source: str = ""
    """Who asked: address, node or user, as it shall stand in the run's record."""


@dataclass(frozen=True, slots=True)
class Report:
    """What the PLC may read at any time; `sequence` echoes the command that the rest belongs to."""

    sequence: int = 0
    state: int = 0
    """PackML state number."""
    result: Result = Result.NONE
    fault: int = 0
    stage: int = 0
    """Number of the skill under way or reached last, 0 before the first."""
    transition: Transition | None = None
    """Why the state last changed; None before it did."""
    reason: int = 0
    """Reason of the outcome, as in `skills.contract.Reason`, by number."""
    progress: int = 0
    """Percent."""
    run: int = 0
    """Number of the run in the journal."""
    holder: str = ""
    """Who holds the lease; the bridge fills it in."""
    stage_times: tuple[float, ...] = field(default=())
    """Time spent in each stage of the run so far, s; at most six."""
    total_time: float = 0.0
    """Time of the run that counts, s."""
