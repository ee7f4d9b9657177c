"""What crosses the line, as values: one Command in, one Report out."""

from dataclasses import dataclass, field
from enum import IntEnum


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
    """Commands of the state machine, numbered as PackML numbers CntrlCmd; programs and skills have the codes from 100 on.

    The same numbers tell why the state last changed. Source: OMAC PackML V2022 as published in the command constants of
    github.com/simatic-ax/lpmlv2022, docs/constants; 6 Suspend, 7 Unsuspend and 10 Complete have no meaning here.
    """

    NONE = 0
    RESET = 1
    START = 2
    """Never a command of its own: a program's code starts that program."""
    STOP = 3
    HOLD = 4
    UNHOLD = 5
    ABORT = 8
    CLEAR = 9
    LOST = 0x10000
    """Made by the watchdog: whoever started the run has fallen silent; no 16-bit register can hold it."""
    ACKNOWLEDGE = 0x10001
    """Made by the handshake: the result has been read."""


class PartPlace(IntEnum):
    """Where the peg is."""

    UNKNOWN = 0
    RACK = 1
    IN_HAND = 2
    ON_PLATE = 3
    IN_HOLE = 4
    SEATED = 5
    BIN = 6


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
    transition: Control | None = None
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
    """Time spent in each stage of the run so far, s; at most `registers.STAGES`."""
    total_time: float = 0.0
    """Time of the run that counts, s."""
    hole: tuple[float, float] = (0.0, 0.0)
    """Place where the run found the hole, shape (2,), m, base frame; zeros before it did."""
    peak_force: float = 0.0
    """Largest force of the run at the tool, N."""
    part: PartPlace = PartPlace.UNKNOWN
    part_depth: float = 0.0
    """How deep the peg's tip is below the plate, m."""
    warnings: int = 0
    """What is not as it should be without stopping the cell, as a sum of `registers.Warnings`."""
    overruns: int = 0
    """Scans that took longer than their period since the start."""
