"""The messages of the line as values: one Command in, one Report out."""

from dataclasses import dataclass
from enum import IntEnum, IntFlag


class Result(IntEnum):
    """Result of the acknowledged command."""

    NONE = 0
    SUCCESS = 1
    FAILURE = 2
    ABORTED = 3
    FAULT = 4
    REFUSED = 5


class Refusal(IntEnum):
    """Reason for the refusal of a command."""

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
    """First sequence number after start, reconnect or a lost PLC: adopted, never run."""
    LATE = 10
    """Sequence number behind the last one: an old write that arrived late, or a counter that went back."""
    STOP_HELD = 11
    """A stop coil is 1 on some link: nothing starts, continues or is reset until it is 0."""
    PART_UNRESOLVED = 12
    """The last peg is in the hand, in the hole, on the plate, or its place is unknown."""
    HOLE_OCCUPIED = 13
    """The switch under the hole is closed."""
    SWITCH_UNKNOWN = 14
    """The switch under the hole is silent, or its board returns no valid answer."""
    RACK_EMPTY = 15
    """Every slot of the rack is empty, and no refill was reported."""
    COMMISSIONING = 16
    """Not everything is proven of this arm, hand, skin, switch and plate: only a person at the cell starts motions."""


REMEDIES: dict[Refusal, str] = {
    Refusal.NONE: "",
    Refusal.UNKNOWN_CODE: "send a code of command_code's list; 2 START is none, a program's own code starts it",
    Refusal.UNKNOWN_RECIPE: "send the number of a recipe of this cell, 0 for none",
    Refusal.BUSY: "wait until report_sequence is the run's number and report_result is not 0, then send again",
    Refusal.NOT_READY: "look at report_state: RESET after STOPPED or COMPLETE, CLEAR and then RESET after ABORTED; "
    "HOLD needs EXECUTE, UNHOLD needs HELD",
    Refusal.NOT_HOLDER: "let report_holder release the lease, or wait until it is silent for plc.lease_timeout",
    Refusal.VERSION: "import the map that this cell prints (`cell map`), and write its version",
    Refusal.PARAMETER: "correct what report_refusal_detail names; its limits stand in the map",
    Refusal.TORN: "write the whole block in one request, command_life and command_life_tail equal; send the next number",
    Refusal.ADOPTED: "the first number of a connection, the first one after its PLC was lost, and one that came with code 0 "
    "before is taken over and never run: send the same command under the next number",
    Refusal.LATE: "send a number above the last one; a program that counts anew first writes a number with code 0",
    Refusal.PART_UNRESOLVED: "look at report_part: run `recover` for a peg that the hand holds; take any other away by hand, "
    "then send CLEARED",
    Refusal.HOLE_OCCUPIED: "take the workpiece away; if there is none, mend the switch",
    Refusal.SWITCH_UNKNOWN: "run `cell check`, mend the switch or its cable, then send again",
    Refusal.RACK_EMPTY: "fill every slot of the rack, then send REFILLED",
    Refusal.COMMISSIONING: "prove the cell with `cell check --prove` and `cell calibrate places`: docs/first-day.md",
    Refusal.STOP_HELD: "let every stop coil fall to 0 (diagnostics_stops_held counts them), then send again",
}
"""Remedy for each refusal."""


class Control(IntEnum):
    """Commands of the state machine, numbered as PackML numbers CntrlCmd; programs and skills have the codes from 100 on.

    The same numbers give the reason of the last change of state. Source: OMAC PackML V2022 as published in the command constants
    of github.com/simatic-ax/lpmlv2022, docs/constants; 6 Suspend, 7 Unsuspend and 10 Complete have no meaning here.
    """

    NONE = 0
    RESET = 1
    START = 2
    """Never used as a command: a program's code starts that program."""
    STOP = 3
    HOLD = 4
    UNHOLD = 5
    ABORT = 8
    CLEAR = 9
    CLEARED = 50
    """Control of this cell only: a person has removed the peg, from any place."""
    REFILLED = 51
    """Every slot of the rack has been filled."""
    FORGET = 52
    """Control of this cell only: delete the learnt place of the hole for the command's recipe."""
    LOST = 0x10000
    """Created by the watchdog: the link that started the run is silent; no 16-bit register can hold it."""
    ACKNOWLEDGE = 0x10001
    """Created by the handshake: the result has been read."""


class PartPlace(IntEnum):
    """Place of the peg."""

    UNKNOWN = 0
    RACK = 1
    IN_HAND = 2
    ON_PLATE = 3
    IN_HOLE = 4
    SEATED = 5
    BIN = 6


class PartEvidence(IntFlag):
    """Evidence of the peg's place, in bits: readings of the sensors that determine the place, and reports of a person or of the record."""

    NOTHING = 0
    """No sensor has been read yet."""
    HAND_HOLDS = 1
    """The hand grips something as wide as the peg."""
    HAND_EMPTY = 2
    """The pads hold nothing as wide as the peg; with neither bit the width fits, but the hand does not grip."""
    SKIN_TOUCHED = 4
    """The skin shows a peg between the pads."""
    SKIN_FREE = 8
    """The skin shows no peg; with neither bit it returned no trusted frame."""
    TIP_IN_HOLE = 16
    """The end of the peg, from arm and skin, was below the plate and over the hole at the last reading."""
    SWITCH_CLOSED = 32
    SWITCH_OPEN = 64
    """The switch under the hole was open; with neither bit it returned no valid answer, or the cell has none."""
    FORCE = 128
    """The force of the part's latch proved that the peg is seated."""
    PERSON = 256
    """A person, or the line, has reported that the peg was removed."""
    RECORD = 512
    """The place comes from the record of the previous program; the sensors do not contradict it."""


PACKML = frozenset(control for control in Control if Control.NONE < control <= Control.CLEAR)
"""Controls that also exist in PackML and that change the state."""
UNNUMBERED = -1
"""Sequence of a stop without a number: from a coil or from the stop object of CAN."""
FIRST_PROGRAM = 100
"""Lowest command code of a program or a skill."""


class LeaseState(IntEnum):
    """State of the lease, as one reader sees it."""

    FREE = 0
    YOURS = 1
    TAKEN = 2


@dataclass(frozen=True, slots=True)
class Command:
    """One request of the holder of the lease; it counts once, when its sequence number changes."""

    sequence: int
    code: int
    recipe: int = 0
    serial: str = ""
    parameters: tuple[tuple[str, float], ...] = ()
    source: str = ""
    """Source of the command: address, node or user, as in the run's record."""


@dataclass(frozen=True, slots=True)
class Report:
    """The report block as values; each of its registers, or each group of numbered ones, is a field.

    The cell fills in its own fields. For each link, the bridge adds the fields from `life` on.
    """

    sequence: int = 0
    """Sequence number of the command that the fields of a run belong to."""
    state: int = 0
    """PackML state number."""
    result: int = Result.NONE
    fault: int = 0
    stage: int = 0
    """Number of the present or last skill; 0 before the first."""
    transition: int = Control.NONE
    """Control that caused the last change of state."""
    reason: int = 0
    """Reason of the outcome, as in `skills.contract.Reason`, by number."""
    progress: int = 0
    """Progress of the present skill, percent."""
    run: int = 0
    """Number of the run in the journal."""
    stage_times: tuple[float, ...] = ()
    """Time spent in each stage of the run so far, s; at most `registers.STAGES`."""
    total_time: float = 0.0
    """Total time of the run, s."""
    hole: tuple[float, float] = (0.0, 0.0)
    """Place where the run found the hole, shape (2,), m, base frame; zeros before that."""
    peak_force: float = 0.0
    """Largest force of the run at the tool, N."""
    part: int = PartPlace.UNKNOWN
    part_depth: float = 0.0
    """Depth of the peg's tip below the plate, m."""
    part_evidence: int = PartEvidence.NOTHING
    part_width: float = 0.0
    """Distance between the pads in the reading that determined the peg's place, m."""
    warnings: int = 0
    """Warnings, which do not stop the cell, as a sum of `registers.Warnings`."""
    obstacle: Refusal = Refusal.NONE
    """Refusal that a program with a fresh peg would get now, from the state of peg, hole and rack; for the bridge, no register."""
    overruns: int = 0
    """Number of scans that took longer than their period, since the start."""
    life: int = 0
    """Life counter of the cell."""
    life_tail: int = 0
    version: int = 0
    """Version of the register map."""
    code: int = 0
    """Code of the command `sequence`."""
    answered: int = 0
    """Sequence number of the last decided command of the link."""
    answered_result: int = Result.NONE
    refusal: int = Refusal.NONE
    """Refusal of the command `answered`."""
    refusal_detail: int = 0
    lease: int = LeaseState.FREE
    holder: str = ""
    """Name of the link that holds the lease."""
