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
from enum import IntEnum
from typing import Literal

from plc_bridge.protocol.messages import (
    FIRST_PROGRAM,
    Control,
    Diagnostics,
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
        """The meaning, with the value of one count."""
        return self.meaning + (f"; in {self.scale:g} {self.unit}" if self.scale != 1.0 else "")


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


def _codes(programs: Mapping[int, str]) -> str:
    named = {control.value: control.name for control in Control if control < FIRST_PROGRAM}
    del named[Control.START]  # a program's own code starts it
    return listed({**named, **programs})


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

    def of(self, block: type) -> list[Register]:
        """Append the entries of a block of values, and return all registers."""
        for _, name, each in entries_of(block):
            self.add(name, each.kind, each.meaning, each.unit, each.scale, each.words)
        return self.registers


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


def _bits() -> list[Register]:
    coils = _Layout("coil", 0, "rw", "", 0x2003)
    coils.add("execute", "bool", "0 to 1 runs command_code as the next sequence number; 1 to 0 acknowledges its result")
    coils.add("stop", "bool", "1 stops the cell, whoever holds the lease")
    coils.add("reset", "bool", "0 to 1 resets the cell after a stop or a fault")
    return [*coils.registers, *_Layout("discrete", 0, "r", "", 0x2004).of(Inputs)]


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
        *_Layout("input", 0, "r", "report_", 0x2001).of(Report),
        *_Layout("input", 100, "r", "diagnostics_", 0x2002).of(Diagnostics),
        *_Layout("input", 200, "r", "packml_", 0x2005).of(PackTags),
        *_bits(),
    ]
    said = words or {}
    return tuple(replace(r, meaning=f"{r.meaning}: {listed(said[r.name])}") if r.name in said else r for r in registers)


COILS = {register.name: register.address for register in _bits() if register.table == "coil"}
DISCRETE_INPUTS = {register.name: register.address for register in _bits() if register.table == "discrete"}
