"""The messages between PLC and cell as values: Command in, Report out; outgoing fields are registers of the map."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum, IntFlag
from typing import Any, Literal


class Result(IntEnum):
    """Result of a command, shown until it is acknowledged."""

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
    """The board of the switch under the hole does not answer, or returns no valid answer."""
    RACK_EMPTY = 15
    """Every slot of the rack is empty, and no refill was reported."""
    COMMISSIONING = 16
    """Arm, hand, skin, switch and plate are not all proven yet: only a person at the cell may start motions."""


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
    """The pads hold nothing as wide as the peg; if neither bit is set, the width fits, but the hand does not grip."""
    SKIN_TOUCHED = 4
    """The skin shows a peg between the pads."""
    SKIN_FREE = 8
    """The skin shows no peg; if neither bit is set, the skin returned no trusted frame."""
    TIP_IN_HOLE = 16
    """The end of the peg, from arm and skin, was below the plate and over the hole at the last reading."""
    SWITCH_CLOSED = 32
    SWITCH_OPEN = 64
    """The switch under the hole was open; if neither bit is set, it returned no valid answer, or the cell has no switch."""
    FORCE = 128
    """The force of the part's latch proved that the peg is seated."""
    PERSON = 256
    """A person, or the line, has reported that the peg was removed."""
    RECORD = 512
    """The place comes from the record of the previous program; the sensors do not contradict it."""


FIRST_PROGRAM = 100
"""Lowest command code of a program or a skill."""
PACKML = frozenset(control for control in Control if Control.NONE < control <= Control.CLEAR)
"""Controls that also exist in PackML and that change the state."""
CONTROLS = frozenset(control for control in Control if control < FIRST_PROGRAM) - {Control.START}
"""Controls that a PLC can command."""
UNNUMBERED = -1
"""Sequence of a stop without a number: from a coil or from the stop object of CAN."""


class LeaseState(IntEnum):
    """State of the lease as one link reads it."""

    FREE = 0
    YOURS = 1
    TAKEN = 2


@dataclass(frozen=True, slots=True)
class Command:
    """One request to the scan thread, from a link, the watchdog or the handshake; it counts once."""

    sequence: int
    code: int
    recipe: int = 0
    serial: str = ""
    parameters: tuple[tuple[str, float], ...] = ()
    source: str = ""
    """Source of the command: address, node or user, as in the run's record."""


class Warnings:
    """Bits of `report_warnings`."""

    NOT_RECORDED = 1
    DISK_LOW = 2
    SCAN_OVERRUNS = 4
    ARM_CALIBRATION = 8
    COMMISSIONING = 16


STAGES = 12
"""Largest number of stages with times in the report."""
AFTER_A_LOSS = 1
"""Detail of the refusal ADOPTED if the number is the first one after the PLC was lost."""
SERIAL_NUMBER = 100
"""Detail of the refusal PARAMETER if the serial number is invalid."""
Kind = Literal["u16", "u32", "i32", "string", "bool"]


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of the register map without its address."""

    kind: Kind
    meaning: str
    unit: str = ""
    scale: float = 1.0
    words: int = 0
    """Number of words of a string; 0 for the size of the type."""
    limits: tuple[int | None, int | None] = (None, None)
    """Least and greatest raw integer; None for those of the type."""
    names: tuple[str, ...] = ()
    """Names of the registers of a field with several values; in the meaning, braces stand for the last part of each name."""


def entry(kind: Kind, meaning: str, default: Any = 0, **more: Any) -> Any:
    """Return a dataclass field that is an entry of the map.

    Args:
        kind: Type of the register.
        meaning: Meaning of the value, as printed in the map.
        default: Default value, or the function that makes it.
        **more: Other fields of `Entry`.
    """
    made = {"default_factory" if callable(default) else "default": default}
    return field(metadata={"entry": Entry(kind, meaning, **more)}, **made)


def entries_of(block: type) -> Iterator[tuple[str, str, Entry]]:
    """Yield field, register and entry of each value of a block, in the order of the registers."""
    for each in fields(block):
        found: Entry | None = each.metadata.get("entry")
        if found is not None:
            for name in found.names or (each.name,):
                yield each.name, name, replace(found, meaning=found.meaning.format(name.rpartition("_")[2]))


def listed(words: Mapping[int, str]) -> str:
    """Return the numbers with their names as one text, in ascending order."""
    return ", ".join(f"{number} {word}" for number, word in sorted(words.items()))


def _numbers(words: type[IntEnum] | type[IntFlag]) -> str:
    return listed({word.value: str(word.name) for word in words})


TRANSITIONS = listed({control.value: control.name for control in PACKML})
"""Numbers and names of the controls that change the state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The report block as values, in the order of its registers.

    The cell fills in its own fields. For each link, the bridge adds the fields of the link's number, of its answer and of
    the lease. The fields of a run belong to the command with the number `sequence`.
    """

    life: int = entry("u16", "head life counter: changes with every scan of the cell")
    version: int = entry("u16", "256 * major + minor of this map")
    sequence: int = entry("u16", "number of the command that report_result belongs to")
    answered: int = entry("u16", "number of the last command that was accepted or refused: the answer to the sequence")
    refusal: int = entry("u16", f"why report_answered was refused: {_numbers(Refusal)}", Refusal.NONE)
    result: int = entry("u16", f"how report_sequence ended, held until acknowledged: {_numbers(Result)}", Result.NONE)
    state: int = entry("u16", "PackML state number of the cell")
    fault: int = entry("u16", "fault code, see `cell faults`; 0 is none")
    stage: int = entry("u16", "skill under way or reached last (0 before the first)")
    reason: int = entry("u16", "why the run ended so")
    """Reason of the outcome, as in `skills.contract.Reason`, by number."""
    progress: int = entry("u16", "how much of the run is done", unit="%")
    code: int = entry("u16", "code of the command that report_sequence belongs to")
    run: int = entry("u32", "number of the run in the journal")
    lease: int = entry("u16", f"who may start: {_numbers(LeaseState)}", LeaseState.FREE)
    holder: str = entry("string", "who holds the lease, ASCII, zero-padded", "", words=16)
    stage_times: tuple[float, ...] = entry(
        "u32",
        "time spent in stage {} of the run, 0 where there is no such stage",
        (),
        unit="s",
        scale=0.001,
        names=tuple(f"stage_time_{number}" for number in range(1, STAGES + 1)),
    )
    total_time: float = entry("u32", "time of the run that counts", 0.0, unit="s", scale=0.001)
    answered_result: int = entry(
        "u16", f"how report_answered ended, 0 while it is under way: {_numbers(Result)}", Result.NONE
    )
    refusal_detail: int = entry(
        "u16",
        f"of refusal {Refusal.PARAMETER.value}: number of the parameter, 9 a bit of the mask beyond them, "
        f"{SERIAL_NUMBER} the serial number, 0 the parameters together; of refusal {Refusal.ADOPTED.value}: "
        f"{AFTER_A_LOSS} the first number after the PLC was lost; else 0",
    )
    transition: int = entry("u16", f"why the state last changed, 0 not yet: {TRANSITIONS}", Control.NONE)
    part: int = entry("u16", f"where the peg is: {_numbers(PartPlace)}", PartPlace.UNKNOWN)
    part_depth: float = entry("i32", "how deep the peg's tip is below the plate", 0.0, unit="m", scale=1e-6)
    hole: tuple[float, float] = entry(
        "i32",
        "place along {} where the hole was found, base frame, 0 not yet",
        (0.0, 0.0),
        unit="m",
        scale=1e-6,
        names=("hole_x", "hole_y"),
    )
    warnings: int = entry(
        "u16",
        f"sum of {Warnings.NOT_RECORDED} records not written, {Warnings.DISK_LOW} disk low, "
        f"{Warnings.SCAN_OVERRUNS} scan overruns, {Warnings.ARM_CALIBRATION} arm calibration does not fit, "
        f"{Warnings.COMMISSIONING} in commissioning",
    )
    overruns: int = entry("u32", "scans that took longer than their period since the start")
    peak_force: float = entry("u32", "largest force of the run at the tool", 0.0, unit="N", scale=0.01)
    life_tail: int = entry("u16", "equal to report_life when the block was read whole")
    # Map 2.0 ends here; later entries follow it, so that no register has moved.
    part_evidence: int = entry(
        "u16", f"why report_part is believed, a sum of {_numbers(PartEvidence)}", PartEvidence.NOTHING
    )
    part_width: float = entry("u16", "distance between the pads when report_part was found", 0.0, unit="m", scale=1e-4)
    obstacle: Refusal = Refusal.NONE
    """Refusal that a program with a fresh peg would get now, from the state of peg, hole and rack; not a register."""


@dataclass(slots=True)
class Diagnostics:
    """Counts since the start: the diagnostics block."""

    requests: int = entry("u32", "requests answered, over CAN the PDOs and SDOs taken")
    exceptions: int = entry("u32", "requests answered with an exception, over CAN with an abort")
    malformed: int = entry("u32", "connections closed because of a malformed frame, over CAN frames of wrong length")
    refusals: int = entry("u32", "commands refused")
    torn: int = entry("u32", "command blocks whose head and tail life counters differed")
    lost: int = entry("u32", "runs stopped because the PLC fell silent")
    connections: int = entry("u32", "connections open now")
    accepted: int = entry("u32", "connections accepted, over CAN how often the PLC came up")
    dropped: int = entry("u32", "connections closed for being idle or to make room, over CAN heartbeats and buses lost")
    forbidden: int = entry("u32", "connections refused for their address or their certificate")
    unauthorised: int = entry("u32", "requests refused because the role of the client does not permit them")
    bad_frames: int = entry(
        "u32", "serial frames with a wrong check sum, over CAN what was no frame, or could not be sent"
    )
    stops_held: int = entry("u32", "connections that hold their stop coil at 1 now: nothing starts before they let go")

    def __add__(self, other: "Diagnostics") -> "Diagnostics":
        return Diagnostics(*(getattr(self, n.name) + getattr(other, n.name) for n in fields(Diagnostics)))


@dataclass(frozen=True, slots=True)
class Inputs:
    """The discrete inputs of one link; done, error and command_aborted are held until acknowledged, ready needs no acknowledgement."""

    busy: bool = entry("bool", "the command is accepted and has not ended", False)
    done: bool = entry("bool", "the program or skill ended in success; held until acknowledged", False)
    error: bool = entry("bool", "the command failed, met a fault or was refused; held until acknowledged", False)
    command_aborted: bool = entry("bool", "the command was stopped; held until acknowledged", False)
    ready: bool = entry(
        "bool",
        "a start of this connection would be taken now: idle or complete, its lease, no stop held, peg, hole and rack ready",
        False,
    )
