"""The blocks of the register map as values, and as words."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Generic, TypeVar

from plc_bridge.protocol.messages import Diagnostics, Report, entries_of
from plc_bridge.protocol.packml import PackTags
from plc_bridge.protocol.registers import PARAMETERS, Register, table

Value = int | float | str
T = TypeVar("T")
_NUMBERS = {
    "u16": ("H", 0, 0xFFFF),
    "u32": ("I", 0, 0xFFFF_FFFF),
    "i32": ("i", -0x8000_0000, 0x7FFF_FFFF),
}
"""Code in `struct`, least and greatest number of each type."""
SERIAL = next(2 * register.words for register in table() if register.name == "command_serial")
"""Longest serial number of a part, characters."""


def is_serial(text: str) -> bool:
    """Return True if a serial number is printable ASCII and fits its registers."""
    return len(text) <= SERIAL and text.isascii() and text.isprintable()


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
        """Key of the command, None if the block has none; blocks with equal number and equal key hold the same command."""
        return (self.code, self.recipe, self.serial) if self.code else None


class Block:
    """Registers without gaps that are read or written together; it converts values to words and back."""

    def __init__(self, registers: Sequence[Register]) -> None:
        self.registers = tuple(registers)
        self.start = registers[0].address
        self.words = sum(register.words for register in registers)
        codes = (f"{2 * r.words}s" if r.type == "string" else _NUMBERS[r.type][0] for r in registers)
        self._bytes = struct.Struct(">" + "".join(codes))
        self._words = struct.Struct(f">{self.words}H")
        # Every report is packed with these tuples: reading the registers' attributes would take as long as the packing.
        self._fields = [(r.name, r.scale, _NUMBERS.get(r.type), 2 * r.words) for r in registers]

    def pack(self, values: Mapping[str, Value]) -> list[int]:
        """Return the words; values beyond a register's range are clipped, missing ones are 0."""
        raw: list[int | bytes] = []
        for name, scale, number, size in self._fields:
            value = values.get(name, 0)
            if number is None:
                raw.append(str(value or "").encode("ascii", "replace")[:size])
            else:
                assert not isinstance(value, str)
                count = value if scale == 1.0 else value / scale
                raw.append(round(max(number[1], min(number[2], count))))
        return list(self._words.unpack(self._bytes.pack(*raw)))

    def unpack(self, words: Sequence[int]) -> dict[str, Value]:
        """Return the value of each register by its name, in its unit; if the scale is 1, the raw integer."""
        raw = self._bytes.unpack(self._words.pack(*words))
        values: dict[str, Value] = {}
        for (name, scale, number, _), value in zip(self._fields, raw, strict=True):
            if number is None:
                values[name] = value.rstrip(b"\0").decode("latin-1")
            else:
                values[name] = value if scale == 1.0 else value * scale
        return values


class ValueBlock(Block, Generic[T]):
    """A block whose registers are the fields of a dataclass, see `messages.entry`; a field with several registers holds a sequence."""

    def __init__(self, kind: type[T], prefix: str) -> None:
        super().__init__([register for register in table() if register.name.startswith(prefix)])
        self._kind = kind
        entries = list(entries_of(kind))
        self._numbers = {prefix + name: field for field, name, entry in entries if not entry.names}
        self._groups = {field: [prefix + name for name in entry.names] for field, _, entry in entries if entry.names}

    def words_of(self, value: T) -> list[int]:
        """Return the words of a value."""
        values: dict[str, Value] = {register: getattr(value, field) for register, field in self._numbers.items()}
        for field, registers in self._groups.items():
            values.update(zip(registers, getattr(value, field), strict=False))
        return self.pack(values)

    def value_of(self, values: Mapping[str, Value]) -> T:
        """Return the dataclass value whose registers hold these values, by the registers' names."""
        facts: dict[str, Any] = {field: values[register] for register, field in self._numbers.items()}
        facts |= {field: tuple(float(values[each]) for each in names) for field, names in self._groups.items()}
        return self._kind(**facts)

    def read(self, words: Sequence[int]) -> T:
        """Return the dataclass value that these words encode."""
        return self.value_of(self.unpack(words))


COMMAND = Block([register for register in table() if register.table == "holding"])
REPORT = ValueBlock(Report, "report_")
PACKML = ValueBlock(PackTags, "packml_")
DIAGNOSTICS = ValueBlock(Diagnostics, "diagnostics_")


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
