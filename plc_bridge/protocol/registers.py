"""The register map: every word and bit of the PLC's interface, with its scale and meaning.

Addresses are zero-based protocol addresses. Values wider than a word and strings are big-endian: the high word,
the high byte first. A value is the raw integer times `scale`, in `unit`.

On CAN every entry is an object of the dictionary, little-endian as in CANopen. Only the life counters at the tails of the
blocks are no objects, because a CAN frame is always whole. `RPDOS` and `TPDOS` list the entries sent by PDO.

The PLC writes the command block, preferably in one FC16 request. Every connection has its own command block, so that no
client can disturb another one. The report and the diagnostics are input registers. A PLC that has only FC3 can read them
as holding registers at the same address plus `MIRROR`.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

from plc_bridge.protocol.messages import (
    CONTROLS,
    Diagnostics,
    Entry,
    Inputs,
    Kind,
    Report,
    entries_of,
    listed,
)
from plc_bridge.protocol.messages import STAGES as STAGES
from plc_bridge.protocol.packml import PackTags

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


class Lease(IntEnum):
    """Values of `command_lease`."""

    NONE = 0
    TAKE = 1
    TAKE_FOR_HOST = 2
    RELEASE = 3


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

    @property
    def told(self) -> str:
        """Meaning of the register, with the value of one count if it is not 1."""
        return self.meaning + (f"; in {self.scale:g} {self.unit}" if self.scale != 1.0 else "")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One numbered parameter of the commands; the package `cell` defines it, the bridge enforces its limits."""

    name: str
    unit: str
    scale: float
    """Value of one count."""
    low: float
    high: float
    meaning: str


def _placed(table: Table, start: int, prefix: str, index: int, entries: Iterable[tuple[str, Entry]]) -> list[Register]:
    """Return registers one after the other from `start`; all but the tails of life counters are sub-indices of `index`."""
    registers: list[Register] = []
    access: Literal["r", "rw"] = "rw" if table in ("holding", "coil") else "r"
    for short, each in entries:
        name, words = prefix + short, each.words or (2 if each.kind in ("u32", "i32") else 1)
        place = (0, 0) if short == "life_tail" else (index, sum(r.index != 0 for r in registers) + 1)
        kind = each.kind, each.scale, each.unit
        found = Register(
            name, table, start, words, *kind, access, *each.limits, *place, _PDO_OF.get(name, ""), each.meaning
        )
        registers.append(found)
        start += words
    return registers


def _of(block: type) -> Iterator[tuple[str, Entry]]:
    return ((name, each) for _, name, each in entries_of(block))


def _command_block(programs: Mapping[int, str], parameters: Sequence[Parameter]) -> Iterator[tuple[str, Entry]]:
    yield "life", Entry("u16", "head life counter: change it in every cycle; a run stops when it stands still")
    yield "sequence", Entry("u16", "count up by one to send a command; the first number after connecting is not run")
    codes = {control.value: control.name for control in CONTROLS}
    yield "code", Entry("u16", f"what to do: {listed({**codes, **programs})}")
    yield "recipe", Entry("u16", "number of the recipe that a program shall use; 0 is the default")
    yield "acknowledge", Entry("u16", "write report_sequence here once its result has been read")
    wishes = (
        "0 no wish (a start takes a free lease), 1 take it whenever it is free, "
        "2 the same for all connections of this host together, 3 release"
    )
    yield "lease", Entry("u16", wishes, limits=(Lease.NONE, Lease.RELEASE))
    major = "256 * major + minor that the PLC was written for; another major is refused; 0 unsaid"
    yield "version", Entry("u16", major)
    mask = "bit n - 1 set: parameter n is given; those not given keep their defaults"
    yield "parameter_mask", Entry("u16", mask, limits=(0, (1 << len(parameters)) - 1))
    serial = "serial number of the part, ASCII, zero-padded; goes into the run's record"
    yield "serial", Entry("string", serial, words=16)
    for number, spec in enumerate(parameters, 1):
        meaning = f"{spec.name}: {spec.meaning}; {spec.low:g} to {spec.high:g} {spec.unit}".rstrip()
        limits = (round(spec.low / spec.scale), round(spec.high / spec.scale))
        yield f"parameter_{number}", Entry("i32", meaning, spec.unit, spec.scale, limits=limits)
    for number in range(len(parameters) + 1, PARAMETERS + 1):
        yield f"parameter_{number}", Entry("i32", "reserved; leave its mask bit 0", limits=(0, 0))
    yield "life_tail", Entry("u16", "equal to command_life when the block is whole; always 0 skips this check")


_COILS = {
    "execute": Entry("bool", "0 to 1 runs command_code under a number of its own; 1 to 0 acknowledges its result"),
    "stop": Entry("bool", "1 stops the cell, whoever holds the lease"),
    "reset": Entry("bool", "0 to 1 resets the cell after a stop or a fault"),
}


def table(
    programs: Mapping[int, str] | None = None,
    parameters: Sequence[Parameter] = (),
    words: Mapping[str, Mapping[int, str]] | None = None,
) -> tuple[Register, ...]:
    """Return the whole map.

    Args:
        programs: Name of each program and skill by its command code.
        parameters: Meaning of the numbered parameters, at most `PARAMETERS`.
        words: Meanings of the numbers in a register, by the register's name, for registers that the cell defines.
    """
    registers = [
        *_placed("holding", 0, "command_", 0x2000, _command_block(programs or {}, parameters)),
        *_placed("input", 0, "report_", 0x2001, _of(Report)),
        *_placed("input", 100, "diagnostics_", 0x2002, _of(Diagnostics)),
        *_placed("input", 200, "packml_", 0x2005, _of(PackTags)),
        *_placed("coil", 0, "", 0x2003, _COILS.items()),
        *_placed("discrete", 0, "", 0x2004, _of(Inputs)),
    ]
    said = words or {}
    return tuple(replace(r, meaning=f"{r.meaning}: {listed(said[r.name])}") if r.name in said else r for r in registers)


COILS = {register.name: register.address for register in table() if register.table == "coil"}
DISCRETE_INPUTS = {register.name: register.address for register in table() if register.table == "discrete"}
