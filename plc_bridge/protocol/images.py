"""The blocks of the register map as values, and as words."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields

from plc_bridge.protocol.messages import Report
from plc_bridge.protocol.registers import PARAMETERS, STAGES, Register, table

Value = int | float | str


@dataclass(frozen=True, slots=True)
class CommandImage:
    """The command block as values; `parameters` has the raw count of each given parameter, by number from 0."""

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

    @property
    def asked(self) -> tuple[int, int, str] | None:
        """Return the key of a command: two blocks with one number and one key are the same command; None without a command."""
        return (self.code, self.recipe, self.serial) if self.code else None


@dataclass(slots=True)
class Diagnostics:
    """Counts since the start, as in the diagnostics block."""

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
    stops_held: int = 0

    def __add__(self, other: "Diagnostics") -> "Diagnostics":
        return Diagnostics(*(getattr(self, n.name) + getattr(other, n.name) for n in fields(Diagnostics)))


class Block:
    """Registers without gaps that are read or written together; it converts values to words and back."""

    def __init__(self, registers: Sequence[Register]) -> None:
        self.registers = tuple(registers)
        self.start = registers[0].address
        self.words = sum(register.words for register in registers)
        self._bytes = struct.Struct(">" + "".join(_code(register) for register in registers))
        self._words = struct.Struct(f">{self.words}H")
        self._fields = [(r.name, r.type, r.scale, 2 * r.words, *_range(r)) for r in registers]

    def pack(self, values: Mapping[str, Value]) -> list[int]:
        """Return the words; values beyond a register's range are clipped, missing ones are 0."""
        raw: list[int | bytes] = []
        for name, kind, scale, size, low, high in self._fields:
            value = values.get(name, 0)
            if kind == "string":
                raw.append(str(value or "").encode("ascii", "replace")[:size])
            else:
                assert not isinstance(value, str)
                count = value if scale == 1.0 else value / scale
                raw.append(round(max(low, min(high, count))))
        return list(self._words.unpack(self._bytes.pack(*raw)))

    def unpack(self, words: Sequence[int]) -> dict[str, Value]:
        """Return the value of each register, raw integers if the scale is 1."""
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


COMMAND = Block([register for register in table() if register.table == "holding"])
REPORT = Block([register for register in table() if register.name.startswith("report_")])
PACKML = Block([register for register in table() if register.name.startswith("packml_")])
DIAGNOSTICS = Block([register for register in table() if register.name.startswith("diagnostics_")])


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


_STAGE_TIMES = [f"report_stage_time_{number}" for number in range(1, STAGES + 1)]
_HOLE = ("report_hole_x", "report_hole_y")
_REPORT_FIELDS = [
    (register.name, register.name.removeprefix("report_"))
    for register in REPORT.registers
    if register.name not in (*_STAGE_TIMES, *_HOLE)
]
"""Registers of the report, and the fields of `Report` of the same names; the others hold a tuple each."""


def report_words(report: Report) -> list[int]:
    """Return the words of the report block."""
    values: dict[str, Value] = {register: getattr(report, name) for register, name in _REPORT_FIELDS}
    values.update(zip(_STAGE_TIMES, report.stage_times, strict=False))
    values.update(zip(_HOLE, report.hole, strict=True))
    return REPORT.pack(values)


def report_image(words: Sequence[int]) -> Report:
    """Return the report block in `words` as values."""
    return report_of(REPORT.unpack(words))


def report_of(values: Mapping[str, Value]) -> Report:
    """Return the report block from the value of each of its registers."""
    times = tuple(float(values[name]) for name in _STAGE_TIMES)
    hole = float(values[_HOLE[0]]), float(values[_HOLE[1]])
    return Report(stage_times=times, hole=hole, **{name: values[register] for register, name in _REPORT_FIELDS})  # type: ignore[arg-type]


def diagnostics_words(counts: Diagnostics) -> list[int]:
    """Return the words of the diagnostics block."""
    return DIAGNOSTICS.pack({f"diagnostics_{name}": value for name, value in asdict(counts).items()})


def diagnostics_image(words: Sequence[int]) -> Diagnostics:
    """Return the diagnostics block in `words` as values."""
    values = DIAGNOSTICS.unpack(words)
    return Diagnostics(**{name.removeprefix("diagnostics_"): int(value) for name, value in values.items()})
