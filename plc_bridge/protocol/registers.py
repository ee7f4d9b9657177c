"""The register map: every word and bit of the PLC's interface, with its scale and meaning.

Addresses are zero-based protocol addresses. Values wider than a word and strings are big-endian: the high word,
the high byte first. A value is the raw integer times `scale`, in `unit`.

On CAN every entry is an object of the dictionary, little-endian as in CANopen. The life counters at the tails are not,
because a CAN frame is always whole. `RPDOS` and `TPDOS` list the entries sent by PDO.

The PLC writes the command block, preferably in one FC16 request. Every connection has its own, so that no client can
disturb another's. The report and the diagnostics are input registers. PLCs with only FC3 can read them as holding
registers at the same address plus `MIRROR`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from plc_bridge.protocol.messages import (
    FIRST_PROGRAM,
    PACKML,
    Control,
    LeaseState,
    PartEvidence,
    PartPlace,
    Refusal,
    Result,
)

DEVICE_NAME = "tactile insertion cell"
"""Name of the cell on every bus."""
VERSION_MAJOR = 2
VERSION_MINOR = 1
"""Minor version, incremented if registers are added and none is moved; a PLC program for a lower one still works."""
VERSION = VERSION_MAJOR * 256 + VERSION_MINOR
VERSION_DATE = "2026-11-25"
"""Date of this version of the map."""

MIRROR = 1000
"""Offset of the holding registers that mirror the input registers."""
STAGES = 12
"""Largest number of stages with times in the report."""
PARAMETERS = 8
"""Largest number of parameters of a command."""

RPDOS: tuple[tuple[str, ...], ...] = (
    ("command_life", "command_sequence", "command_code", "command_recipe"),
    ("command_acknowledge", "command_lease"),
    ("stop",),
)
"""RPDOs, which the PLC sends over CAN, in order; every node may send the last one."""
TPDOS: tuple[tuple[str, ...], ...] = (
    ("report_sequence", "report_answered", "report_result", "report_refusal"),
    ("report_state", "report_fault", "report_stage", "report_reason"),
    ("report_life", "report_progress", "report_total_time"),
    ("report_run", "report_lease", "report_answered_result"),
)
"""TPDOs, which the cell sends over CAN, in order."""
_PDO_OF = {
    name: f"{kind}{number}"
    for kind, pdos in (("RPDO", RPDOS), ("TPDO", TPDOS))
    for number, names in enumerate(pdos, 1)
    for name in names
}

Table = Literal["holding", "input", "coil", "discrete"]
Kind = Literal["u16", "u32", "i16", "i32", "string", "bool"]


class Lease:
    """Values of `command_lease`."""

    NONE = 0
    TAKE = 1
    TAKE_FOR_HOST = 2
    RELEASE = 3


class Warnings:
    """Bits of `report_warnings`."""

    NOT_RECORDED = 1
    DISK_LOW = 2
    SCAN_OVERRUNS = 4
    ARM_CALIBRATION = 8
    COMMISSIONING = 16


AFTER_A_LOSS = 1
"""Detail of the refusal ADOPTED if the number is the first one after the PLC was lost."""
SERIAL_NUMBER = 100
"""Detail of the refusal PARAMETER if the serial number is invalid."""
STATES = 17
"""Number of PackML states, numbered from 1."""


@dataclass(frozen=True, slots=True)
class Register:
    """One entry of the map."""

    name: str
    table: Table
    address: int
    words: int
    type: Kind
    scale: float
    unit: str
    access: Literal["r", "rw"]
    low: int | None
    """Least raw integer; None for the least of the type."""
    high: int | None
    """Greatest raw integer; None for the greatest of the type."""
    index: int
    """Index of the object on CAN; 0 if there is none."""
    subindex: int
    pdo: str
    """PDO of the entry on CAN; empty if it is accessible by SDO only."""
    meaning: str


@dataclass(frozen=True, slots=True)
class Parameter:
    """One numbered parameter of the commands; `cell` names them, the bridge enforces their limits."""

    name: str
    unit: str
    scale: float
    """Value of one count."""
    low: float
    high: float
    meaning: str


def _numbers(words: type[Result] | type[Refusal] | type[LeaseState] | type[PartPlace] | type[PartEvidence]) -> str:
    return _listed({word.value: str(word.name) for word in words})


def _codes(programs: Mapping[int, str]) -> str:
    named = {control.value: control.name for control in Control if control < FIRST_PROGRAM}
    del named[Control.START]  # a program's own code starts it
    return _listed({**named, **programs})


def _transitions() -> str:
    return _listed({control.value: control.name for control in PACKML})


def _listed(words: Mapping[int, str]) -> str:
    return ", ".join(f"{number} {word}" for number, word in sorted(words.items()))


class _Layout:
    """Places registers one after the other."""

    def __init__(self, table: Table, start: int, access: Literal["r", "rw"], prefix: str, index: int) -> None:
        self._table: Table = table
        self._index = index
        self._next = start
        self._access: Literal["r", "rw"] = access
        self._prefix = prefix
        self.registers: list[Register] = []

    def add(
        self,
        name: str,
        kind: Kind,
        meaning: str,
        unit: str = "",
        scale: float = 1.0,
        words: int = 0,
        limits: tuple[int | None, int | None] = (None, None),
    ) -> None:
        """Append one entry; `words` is needed for strings only, `limits` are raw."""
        words = words or (2 if kind in ("u32", "i32") else 1)
        name = self._prefix + name
        objects = sum(register.index != 0 for register in self.registers)
        place = (0, 0) if name.endswith("life_tail") else (self._index, objects + 1)
        pdo = _PDO_OF.get(name, "")
        entry = Register(
            name, self._table, self._next, words, kind, scale, unit, self._access, *limits, *place, pdo, meaning
        )
        self.registers.append(entry)
        self._next += words


def _command_block(programs: Mapping[int, str], parameters: Sequence[Parameter]) -> list[Register]:
    block = _Layout("holding", 0, "rw", "command_", 0x2000)
    block.add("life", "u16", "head life counter: change it in every cycle; a run stops when it stands still")
    block.add("sequence", "u16", "count up by one to send a command; the first number after connecting is not run")
    block.add("code", "u16", f"what to do: {_codes(programs)}")
    block.add("recipe", "u16", "number of the recipe that a program shall use; 0 is the default")
    block.add("acknowledge", "u16", "write report_sequence here once its result has been read")
    block.add(
        "lease",
        "u16",
        "0 no wish (a start takes a free lease), 1 take it whenever it is free, "
        "2 the same for all connections of this host together, 3 release",
        limits=(Lease.NONE, Lease.RELEASE),
    )
    block.add("version", "u16", "256 * major + minor that the PLC was written for; another major is refused; 0 unsaid")
    block.add(
        "parameter_mask",
        "u16",
        "bit n - 1 set: parameter n is given; those not given keep their defaults",
        limits=(0, (1 << len(parameters)) - 1),
    )
    block.add("serial", "string", "serial number of the part, ASCII, zero-padded; goes into the run's record", words=16)
    for number in range(1, PARAMETERS + 1):
        if number <= len(parameters):
            spec = parameters[number - 1]
            meaning = f"{spec.name}: {spec.meaning}; {spec.low:g} to {spec.high:g} {spec.unit}".rstrip()
            limits = (round(spec.low / spec.scale), round(spec.high / spec.scale))
            block.add(f"parameter_{number}", "i32", meaning, spec.unit, spec.scale, limits=limits)
        else:
            block.add(f"parameter_{number}", "i32", "reserved; leave its mask bit 0", limits=(0, 0))
    block.add("life_tail", "u16", "equal to command_life when the block is whole; always 0 skips this check")
    return block.registers


def _report_block() -> list[Register]:
    block = _Layout("input", 0, "r", "report_", 0x2001)
    block.add("life", "u16", "head life counter: changes with every scan of the cell")
    block.add("version", "u16", "256 * major + minor of this map")
    block.add("sequence", "u16", "number of the command that report_result belongs to")
    block.add("answered", "u16", "number of the last command that was accepted or refused: the answer to the sequence")
    block.add("refusal", "u16", f"why report_answered was refused: {_numbers(Refusal)}")
    block.add("result", "u16", f"how report_sequence ended, held until acknowledged: {_numbers(Result)}")
    block.add("state", "u16", "PackML state number of the cell")
    block.add("fault", "u16", "fault code, see `cell faults`; 0 is none")
    block.add("stage", "u16", "skill under way or reached last (0 before the first)")
    block.add("reason", "u16", "why the run ended so")
    block.add("progress", "u16", "how much of the run is done", unit="%")
    block.add("code", "u16", "code of the command that report_sequence belongs to")
    block.add("run", "u32", "number of the run in the journal")
    block.add("lease", "u16", f"who may start: {_numbers(LeaseState)}")
    block.add("holder", "string", "who holds the lease, ASCII, zero-padded", words=16)
    for number in range(1, STAGES + 1):
        block.add(
            f"stage_time_{number}",
            "u32",
            f"time spent in stage {number} of the run, 0 where there is no such stage",
            unit="s",
            scale=0.001,
        )
    block.add("total_time", "u32", "time of the run that counts", unit="s", scale=0.001)
    block.add("answered_result", "u16", f"how report_answered ended, 0 while it is under way: {_numbers(Result)}")
    block.add(
        "refusal_detail",
        "u16",
        f"of refusal {Refusal.PARAMETER.value}: number of the parameter, 9 a bit of the mask beyond them, "
        f"{SERIAL_NUMBER} the serial number, 0 the parameters together; of refusal {Refusal.ADOPTED.value}: "
        f"{AFTER_A_LOSS} the first number after the PLC was lost; else 0",
    )
    block.add("transition", "u16", f"why the state last changed, 0 not yet: {_transitions()}")
    block.add("part", "u16", f"where the peg is: {_numbers(PartPlace)}")
    block.add("part_depth", "i32", "how deep the peg's tip is below the plate", unit="m", scale=1e-6)
    block.add("hole_x", "i32", "place along x where the hole was found, base frame, 0 not yet", unit="m", scale=1e-6)
    block.add("hole_y", "i32", "place along y where the hole was found, base frame, 0 not yet", unit="m", scale=1e-6)
    block.add(
        "warnings",
        "u16",
        f"sum of {Warnings.NOT_RECORDED} records not written, {Warnings.DISK_LOW} disk low, "
        f"{Warnings.SCAN_OVERRUNS} scan overruns, {Warnings.ARM_CALIBRATION} arm calibration does not fit, "
        f"{Warnings.COMMISSIONING} in commissioning",
    )
    block.add("overruns", "u32", "scans that took longer than their period since the start")
    block.add("peak_force", "u32", "largest force of the run at the tool", unit="N", scale=0.01)
    block.add("life_tail", "u16", "equal to report_life when the block was read whole")
    # Map 2.0 ends here; later entries follow it, so that no register has moved.
    block.add("part_evidence", "u16", f"why report_part is believed, a sum of {_numbers(PartEvidence)}")
    block.add("part_width", "u16", "distance between the pads when report_part was found", unit="m", scale=1e-4)
    return block.registers


def _diagnostics_block() -> list[Register]:
    block = _Layout("input", 100, "r", "diagnostics_", 0x2002)
    block.add("requests", "u32", "requests answered, over CAN the PDOs and SDOs taken")
    block.add("exceptions", "u32", "requests answered with an exception, over CAN with an abort")
    block.add("malformed", "u32", "connections closed because of a malformed frame, over CAN frames of wrong length")
    block.add("refusals", "u32", "commands refused")
    block.add("torn", "u32", "command blocks whose head and tail life counters differed")
    block.add("lost", "u32", "runs stopped because the PLC fell silent")
    block.add("connections", "u32", "connections open now")
    block.add("accepted", "u32", "connections accepted, over CAN how often the PLC came up")
    block.add("dropped", "u32", "connections closed for being idle or to make room, over CAN heartbeats and buses lost")
    block.add("forbidden", "u32", "connections refused for their address or their certificate")
    block.add("unauthorised", "u32", "requests refused because the role of the client does not permit them")
    block.add(
        "bad_frames", "u32", "serial frames with a wrong check sum, over CAN what was no frame, or could not be sent"
    )
    block.add("stops_held", "u32", "connections that hold their stop coil at 1 now: nothing starts before they let go")
    return block.registers


def _packml_block() -> list[Register]:
    block = _Layout("input", 200, "r", "packml_", 0x2005)
    block.add("unit_mode", "u16", "PackTags UnitModeCurrent: 1 production")
    block.add("state", "u16", "PackTags StateCurrent, equal to report_state")
    block.add("cntrl_cmd", "u16", f"PackTags CntrlCmd, obeyed last: {_transitions()}")
    block.add(
        "stop_reason",
        "u16",
        "PackTags StopReason: fault code, or the control that stopped the cell; 0 since it went on",
    )
    block.add("processed", "u32", "PackTags ProdProcessedCount: insertions that have ended since the start")
    block.add("defective", "u32", "PackTags ProdDefectiveCount: those of them that did not end in success")
    for number in range(1, STATES + 1):
        block.add(
            f"state_time_{number}",
            "u32",
            f"PackTags StateCumulativeTime: time in state {number} since the start",
            unit="s",
        )
    return block.registers


def _bits() -> list[Register]:
    coils = _Layout("coil", 0, "rw", "", 0x2003)
    coils.add("execute", "bool", "0 to 1 runs command_code as the next sequence number; 1 to 0 acknowledges its result")
    coils.add("stop", "bool", "1 stops the cell, whoever holds the lease")
    coils.add("reset", "bool", "0 to 1 resets the cell after a stop or a fault")
    inputs = _Layout("discrete", 0, "r", "", 0x2004)
    inputs.add("busy", "bool", "the command is accepted and has not ended")
    inputs.add("done", "bool", "the program or skill ended in success; held until acknowledged")
    inputs.add("error", "bool", "the command failed, met a fault or was refused; held until acknowledged")
    inputs.add("command_aborted", "bool", "the command was stopped; held until acknowledged")
    inputs.add(
        "ready",
        "bool",
        "a start of this connection would be taken now: idle or complete, its lease, no stop held, peg, hole and rack ready",
    )
    return [*coils.registers, *inputs.registers]


def table(
    programs: Mapping[int, str] | None = None,
    parameters: Sequence[Parameter] = (),
    words: Mapping[str, Mapping[int, str]] | None = None,
) -> tuple[Register, ...]:
    """Return the whole map.

    Args:
        programs: Name of each program and skill by its command code.
        parameters: Meaning of the numbered parameters, at most `PARAMETERS`.
        words: Meaning of the numbers in a register, by its name, if the cell defines it.
    """
    registers = [
        *_command_block(programs or {}, parameters),
        *_report_block(),
        *_diagnostics_block(),
        *_packml_block(),
        *_bits(),
    ]
    said = words or {}
    return tuple(
        replace(r, meaning=f"{r.meaning}: {_listed(said[r.name])}") if r.name in said else r for r in registers
    )


COILS = {register.name: register.address for register in _bits() if register.table == "coil"}
DISCRETE_INPUTS = {register.name: register.address for register in _bits() if register.table == "discrete"}
