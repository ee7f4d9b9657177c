"""THE register map: every word and bit that a PLC sees, its scale and its meaning.

Addresses are zero-based protocol addresses; values wider than a word and strings are big-endian: the high word,
the high byte first. A value is the raw integer times `scale`, in `unit`.

On CAN every entry but the life counters at the tails, which a whole frame makes superfluous, is an object of the
dictionary, little-endian as CANopen has it; `RPDOS` and `TPDOS` say which of them travel by themselves.

The command block is written by the PLC, best in one FC16 request. Every connection has its own, so that no client
can disturb another's. The report and the diagnostics are input registers and can be read at the same address plus
`MIRROR` as holding registers too, for PLCs that know only FC3.
"""

import csv
import io
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Literal

from plc_bridge.messages import FIRST_PROGRAM, Control, LeaseState, Refusal, Result, Transition

VERSION_MAJOR = 1
VERSION_MINOR = 3
VERSION = VERSION_MAJOR * 256 + VERSION_MINOR
VERSION_DATE = "2026-11-21"
"""On which this version was made."""

MIRROR = 1000
"""Offset of the holding registers that repeat the input registers."""
STAGES = 6
"""Stages whose times the report can hold."""
PARAMETERS = 8
"""Parameters that a command can carry."""

RPDOS: tuple[tuple[str, ...], ...] = (
    ("command_life", "command_sequence", "command_code", "command_recipe"),
    ("command_acknowledge", "command_lease"),
    ("stop",),
)
"""What the PLC sends by itself over CAN, in order; the last one is for anybody."""
TPDOS: tuple[tuple[str, ...], ...] = (
    ("report_sequence", "report_answered", "report_result", "report_refusal"),
    ("report_state", "report_fault", "report_stage", "report_reason"),
    ("report_life", "report_progress", "report_total_time"),
    ("report_run", "report_lease", "report_code"),
)
"""What the cell sends by itself over CAN, in order."""
_PDO_OF = {
    name: f"{kind}{number}"
    for kind, pdos in (("RPDO", RPDOS), ("TPDO", TPDOS))
    for number, names in enumerate(pdos, 1)
    for name in names
}

Table = Literal["holding", "input", "coil", "discrete"]
Kind = Literal["u16", "u32", "i16", "i32", "string", "bool"]
Value = int | float | str


class Lease:
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
    """Least raw integer; None is whatever the type holds."""
    high: int | None
    """Greatest raw integer; the same."""
    index: int
    """Of the object on CAN; 0 where there is none."""
    subindex: int
    pdo: str
    """PDO that carries it on CAN; empty where only SDO does."""
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


@dataclass(frozen=True, slots=True)
class CommandImage:
    """The command block as values; `parameters` has the raw count of each one given, by number from 0."""

    life: int = 0
    sequence: int = 0
    code: int = 0
    recipe: int = 0
    acknowledge: int = 0
    lease: int = 0
    version: int = 0
    serial: str = ""
    parameters: tuple[tuple[int, int], ...] = ()
    life_tail: int = 0


@dataclass(frozen=True, slots=True)
class ReportImage:
    """The report block as values, as one reader sees it."""

    life: int = 0
    version: int = VERSION
    sequence: int = 0
    answered: int = 0
    refusal: int = 0
    result: int = 0
    state: int = 0
    fault: int = 0
    stage: int = 0
    reason: int = 0
    progress: int = 0
    code: int = 0
    run: int = 0
    lease: int = 0
    holder: str = ""
    stage_times: tuple[float, ...] = (0.0,) * STAGES
    total_time: float = 0.0
    life_tail: int = 0


@dataclass(slots=True)
class Diagnostics:
    """Counts since the start, as the diagnostics block shows them."""

    requests: int = 0
    exceptions: int = 0
    malformed: int = 0
    refusals: int = 0
    torn: int = 0
    lost: int = 0
    connections: int = 0
    accepted: int = 0
    dropped: int = 0
    forbidden: int = 0
    unauthorised: int = 0
    bad_frames: int = 0
    transition: int = 0

    def __add__(self, other: "Diagnostics") -> "Diagnostics":
        return Diagnostics(*(getattr(self, n.name) + getattr(other, n.name) for n in fields(Diagnostics)))


def _numbers(words: type[Result] | type[Refusal] | type[LeaseState] | type[Transition]) -> str:
    return ", ".join(f"{word.value} {word.name}" for word in words)


def _codes(programs: Mapping[int, str]) -> str:
    controls = {control.value: control.name for control in Control if control < FIRST_PROGRAM}
    return ", ".join(f"{code} {name}" for code, name in sorted({**controls, **programs}.items()))


class _Layout:
    """Lays registers one after the other."""

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
        place = (0, 0) if name.endswith("life_tail") else (self._index, len(self.registers) + 1)
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
    block.add("life_tail", "u16", "equal to command_life when the block is whole; leave 0 for ever to do without")
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
    block.add("stage", "u16", "number of the skill under way or reached last; 0 before the first")
    block.add("reason", "u16", "reason of the outcome, by number")
    block.add("progress", "u16", "how much of the run is done", unit="%")
    block.add("code", "u16", "code of the command that report_sequence belongs to")
    block.add("run", "u32", "number of the run in the journal")
    block.add("lease", "u16", f"who may start: {_numbers(LeaseState)}")
    block.add("holder", "string", "who holds the lease, ASCII, zero-padded", words=16)
    for number in range(1, STAGES + 1):
        block.add(f"stage_time_{number}", "u32", f"time spent in stage {number} of the run", unit="s", scale=0.001)
    block.add("total_time", "u32", "time of the run that counts", unit="s", scale=0.001)
    block.add("life_tail", "u16", "equal to report_life when the block was read whole")
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
    block.add("transition", "u32", f"why the state last changed, 0 not yet: {_numbers(Transition)}")
    return block.registers


def _bits() -> list[Register]:
    coils = _Layout("coil", 0, "rw", "", 0x2003)
    coils.add("execute", "bool", "0 to 1 runs command_code as the next sequence number; 1 to 0 acknowledges its result")
    coils.add("stop", "bool", "1 stops the cell, whoever holds the lease")
    coils.add("reset", "bool", "0 to 1 resets the cell after a stop or a fault")
    inputs = _Layout("discrete", 0, "r", "", 0x2004)
    inputs.add("busy", "bool", "the command is accepted and has not ended")
    inputs.add("done", "bool", "the command ended in success; held until acknowledged")
    inputs.add("error", "bool", "the command failed, met a fault or was refused; held until acknowledged")
    inputs.add("command_aborted", "bool", "the command was stopped; held until acknowledged")
    return [*coils.registers, *inputs.registers]


def table(programs: Mapping[int, str] | None = None, parameters: Sequence[Parameter] = ()) -> tuple[Register, ...]:
    """Return the whole map.

    Args:
        programs: Name of each program and skill by its command code.
        parameters: What the numbered parameters mean, at most `PARAMETERS`.
    """
    return (*_command_block(programs or {}, parameters), *_report_block(), *_diagnostics_block(), *_bits())


def as_json(registers: Sequence[Register]) -> str:
    """Return the map as a JSON list of objects."""
    return json.dumps([asdict(register) for register in registers], indent=2)


def as_csv(registers: Sequence[Register]) -> str:
    """Return the map as CSV with a heading."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [column.name for column in fields(Register)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(register) for register in registers)
    return text.getvalue()


def as_markdown(registers: Sequence[Register]) -> str:
    """Return the map as a Markdown table below the rules that hold for all of it."""
    hidden = {"index", "subindex"}
    columns = [column.name for column in fields(Register) if column.name not in hidden]
    lines = [
        f"Register map {VERSION_MAJOR}.{VERSION_MINOR}. Addresses are zero-based; wide values and strings are "
        "big-endian; value = raw integer x scale, in unit; low and high are raw. Every connection has its own command "
        f"block. Input registers can be read as holding registers too, {MIRROR} higher. On CAN the same values are "
        "objects, index and sub-index, little-endian.",
        "",
        f"| {' | '.join(['object', *columns])} |",
        f"|{' --- |' * (len(columns) + 1)}",
    ]
    for register in registers:
        place = f"{register.index:04X}sub{register.subindex:X}" if register.index else ""
        cells = ["" if getattr(register, name) is None else str(getattr(register, name)) for name in columns]
        lines.append(f"| {' | '.join([place, *cells])} |")
    return "\n".join(lines) + "\n"


class Block:
    """Registers without gaps that are read or written together: values to words and back."""

    def __init__(self, registers: Sequence[Register]) -> None:
        self.registers = tuple(registers)
        self.start = registers[0].address
        self.words = sum(register.words for register in registers)
        self._bytes = struct.Struct(">" + "".join(_code(register) for register in registers))
        self._words = struct.Struct(f">{self.words}H")
        self._fields = [(r.name, r.type, r.scale, 2 * r.words, *_range(r)) for r in registers]

    def pack(self, values: Mapping[str, Value]) -> list[int]:
        """Return the words; values that do not fit are cut to what the register holds, those left out are 0."""
        raw: list[int | bytes] = []
        for name, kind, scale, size, low, high in self._fields:
            value = values.get(name, 0)
            if kind == "string":
                raw.append(str(value or "").encode("ascii", "replace")[:size])
            else:
                assert not isinstance(value, str)
                count = value if scale == 1.0 else value / scale
                raw.append(min(max(round(count), low), high))
        return list(self._words.unpack(self._bytes.pack(*raw)))

    def unpack(self, words: Sequence[int]) -> dict[str, Value]:
        """Return the value of each register, raw integers where the scale is 1."""
        raw = self._bytes.unpack(self._words.pack(*words))
        values: dict[str, Value] = {}
        for (name, kind, scale, *_), value in zip(self._fields, raw, strict=True):
            if kind == "string":
                values[name] = value.rstrip(b"\0").decode("latin-1")
            else:
                values[name] = value if scale == 1.0 else value * scale
        return values


def _code(register: Register) -> str:
    if register.type == "string":
        return f"{2 * register.words}s"
    return {"u16": "H", "i16": "h", "u32": "I", "i32": "i"}[register.type]


def _range(register: Register) -> tuple[int, int]:
    bits = 16 * register.words
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if register.type.startswith("i") else (0, (1 << bits) - 1)


COMMAND = Block(_command_block({}, ()))
REPORT = Block(_report_block())
DIAGNOSTICS = Block(_diagnostics_block())
COILS = {register.name: register.address for register in _bits() if register.table == "coil"}
DISCRETE_INPUTS = {register.name: register.address for register in _bits() if register.table == "discrete"}


def command_image(words: Sequence[int]) -> CommandImage:
    """Return the command block in `words` as values."""
    values = COMMAND.unpack(words)
    mask = int(values["command_parameter_mask"])
    given = tuple((n, int(values[f"command_parameter_{n + 1}"])) for n in range(16) if mask >> n & 1 and n < PARAMETERS)
    if mask >> PARAMETERS:
        given += ((PARAMETERS, 0),)
    simple = ("life", "sequence", "code", "recipe", "acknowledge", "lease", "version", "life_tail")
    numbers = {name: int(values[f"command_{name}"]) for name in simple}
    return CommandImage(serial=str(values["command_serial"]), parameters=given, **numbers)


def command_words(image: CommandImage) -> list[int]:
    """Return the words of the command block."""
    values: dict[str, Value] = {
        f"command_{name}": value for name, value in asdict(image).items() if name != "parameters"
    }
    values["command_parameter_mask"] = sum(1 << number for number, _ in image.parameters)
    values.update({f"command_parameter_{number + 1}": count for number, count in image.parameters})
    return COMMAND.pack(values)


_REPORT_FIELDS = [
    (f"report_{column.name}", column.name) for column in fields(ReportImage) if column.name != "stage_times"
]


def report_words(image: ReportImage) -> list[int]:
    """Return the words of the report block."""
    values: dict[str, Value] = {register: getattr(image, name) for register, name in _REPORT_FIELDS}
    values.update({f"report_stage_time_{n}": time for n, time in enumerate(image.stage_times, 1)})
    return REPORT.pack(values)


def report_image(words: Sequence[int]) -> ReportImage:
    """Return the report block in `words` as values."""
    values = REPORT.unpack(words)
    times = tuple(float(values.pop(f"report_stage_time_{n}")) for n in range(1, STAGES + 1))
    return ReportImage(stage_times=times, **{name.removeprefix("report_"): value for name, value in values.items()})  # type: ignore[arg-type]


def diagnostics_words(counts: Diagnostics) -> list[int]:
    """Return the words of the diagnostics block."""
    return DIAGNOSTICS.pack({f"diagnostics_{name}": value for name, value in asdict(counts).items()})


def diagnostics_image(words: Sequence[int]) -> Diagnostics:
    """Return the diagnostics block in `words` as values."""
    values = DIAGNOSTICS.unpack(words)
    return Diagnostics(**{name.removeprefix("diagnostics_"): int(value) for name, value in values.items()})
