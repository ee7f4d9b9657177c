"""The function block as a source of Siemens SCL, with user data types whose members have the registers' names.

The words of Modbus and a data block without optimised access have the same byte order, the high byte first. MB_CLIENT
therefore fills `UDT_CellReport` directly, and the program contains no addresses.
"""

import re
from collections.abc import Iterator, Mapping, Sequence

from plc_bridge.function_block import (
    COMMAND,
    NAME,
    NAMES,
    PARAMETER,
    REPORT,
    SERIAL,
    STAGE_TIMES,
    FunctionBlock,
    Variable,
    function_block,
)
from plc_bridge.registers import PARAMETERS, STAGES, Register

DATA = "DB_InsertionCell"
_TYPES = {"u16": "UInt", "u32": "UDInt", "i16": "Int", "i32": "DInt"}
_UDTS = {COMMAND: "UDT_CellCommand", REPORT: "UDT_CellReport", NAMES: "UDT_CellNames", "TON": "TON_TIME"}
_GROUPED = re.compile(r"(parameter|stage_time)_\d+")


def as_scl(registers: Sequence[Register], names: Mapping[str, int]) -> str:
    """Return the data types, the function block, and a data block for the Modbus client, for this map."""
    block = function_block(registers, names)
    lines = [
        *_udt("UDT_CellCommand", _members(block.registers["Command"])),
        *_udt("UDT_CellReport", _members(block.registers["Report"])),
        *_udt("UDT_CellNames", (f"{name} : UInt := {number};" for name, number in names.items())),
        *_block(block),
        *_data(),
    ]
    return "\r\n".join(lines) + "\r\n"


def _udt(name: str, members: "Iterator[str]") -> Iterator[str]:
    yield f'TYPE "{name}"'
    yield "VERSION : 0.1"
    yield "    STRUCT"
    for member in members:
        yield f"        {member}"
    yield "    END_STRUCT;"
    yield "END_TYPE"
    yield ""


def _members(entries: Mapping[str, Register]) -> Iterator[str]:
    """Return a member for each register in order; numbered ones are arrays."""
    seen = set()
    for name, entry in entries.items():
        group = _GROUPED.fullmatch(name)
        if group is not None:
            if group[1] not in seen:
                seen.add(group[1])
                count = PARAMETERS if group[1] == "parameter" else STAGES
                yield f"{group[1]} : Array[1..{count}] of {_TYPES[entry.type]};"
            continue
        kind = f"Array[0..{2 * entry.words - 1}] of Byte" if entry.type == "string" else _TYPES[entry.type]
        yield f"{name} : {kind};"


def _block(block: FunctionBlock) -> Iterator[str]:
    yield f'FUNCTION_BLOCK "{NAME}"'
    yield "{ S7_Optimized_Access := 'TRUE' }"
    yield "VERSION : 0.1"
    for line in block.about.splitlines():
        yield f"// {line}"
    for kind, variables in (("VAR_INPUT", block.inputs), ("VAR_OUTPUT", block.outputs), ("VAR", block.locals)):
        yield kind
        for variable in variables:
            yield f"    {_declaration(variable, block)}"
        yield "END_VAR"
    yield "BEGIN"
    yield from _body(block).splitlines()
    yield "END_FUNCTION_BLOCK"
    yield ""


def _declaration(variable: Variable, block: FunctionBlock) -> str:
    arrays = {each.name: f"Array[{each.low}..{each.high}] of {each.of}" for each in block.arrays}
    kind = variable.type
    if kind in (SERIAL, PARAMETER, STAGE_TIMES):
        kind = arrays[kind]
    elif kind in _UDTS:
        kind = _UDTS[kind] if kind == "TON" else f'"{_UDTS[kind]}"'
    first = f" := {variable.initial}" if variable.initial else ""
    return f"{variable.name} : {kind}{first};" + (f" // {variable.meaning}" if variable.meaning else "")


def _body(block: FunctionBlock) -> str:
    """Return the body with members in place of words, and the marker of SCL on every variable of the block."""
    text = block.body
    for place, name in _by_place(block.registers["Report"]).items():
        wide = rf"DWORD_TO_UDINT\(SHL\(WORD_TO_DWORD\(Report\[{place}\]\), 16\) OR WORD_TO_DWORD\(Report\[\d+\]\)\)"
        text = re.sub(wide, f"Report.{name}", text)
        text = text.replace(f"WORD_TO_UINT(Report[{place}])", f"Report.{name}").replace(
            f"Report[{place}]", f"Report.{name}"
        )
    text = re.sub(r"DWORD_TO_UDINT\(SHL\(WORD_TO_DWORD\(Report\[\d+ \+ .*?\n", "Report.stage_time[Index]);\n", text)
    for place, name in _by_place(block.registers["Command"]).items():
        text = re.sub(rf"Command\[{place}\] := UINT_TO_WORD\((.*)\);", rf"Command.{name} := \1;", text)
        text = text.replace(f"Command[{place}] := ", f"Command.{name} := ")
    text = _loops(text, block)
    names = [v.name for v in (*block.inputs, *block.outputs, *block.locals)]
    return re.sub(rf"(?<![.#\w])({'|'.join(names)})\b(?! :=.*PT)", r"#\1", _uncommented(text))


def _loops(text: str, block: FunctionBlock) -> str:
    """Replace the loops that split bytes and double words into words: the types have members for them."""
    last = 2 * block.registers["Command"]["serial"].words - 1
    text = re.sub(
        r"( *)FOR Index := 0 TO \d+ DO\n.*\n *END_FOR;",
        rf"\1FOR Index := 0 TO {last} DO\n\1    Command.serial[Index] := SerialNumber[Index];\n\1END_FOR;",
        text,
        count=1,
    )
    return re.sub(
        r"( *)FOR Index := 1 TO (\d+) DO\n *Command.*\n *Command.*\n *END_FOR;",
        r"\1FOR Index := 1 TO \2 DO\n\1    Command.parameter[Index] := Parameters[Index];\n\1END_FOR;",
        text,
        count=1,
    )


def _uncommented(text: str) -> str:
    return re.sub(r"^ *\(\*.*\*\)\n", "", text, flags=re.MULTILINE)


def _by_place(entries: Mapping[str, Register]) -> dict[int, str]:
    start = next(iter(entries.values())).address
    return {entry.address - start: name for name, entry in entries.items() if _GROUPED.fullmatch(name) is None}


def _data() -> Iterator[str]:
    yield f'DATA_BLOCK "{DATA}"'
    yield "{ S7_Optimized_Access := 'FALSE' }"
    yield "VERSION : 0.1"
    yield "    STRUCT"
    yield '        Command : "UDT_CellCommand"; // MB_CLIENT writes it to the holding registers from 0 on'
    yield '        Report : "UDT_CellReport"; // MB_CLIENT reads it from the input registers from 0 on'
    yield "    END_STRUCT;"
    yield "BEGIN"
    yield "END_DATA_BLOCK"
