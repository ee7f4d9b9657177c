"""The function block as a source of Siemens SCL, with user data types whose members have the registers' names.

The words of Modbus and a data block without optimised access have the same byte order, the high byte first. MB_CLIENT
therefore fills `UDT_CellReport` directly, and the program contains no addresses.
"""

from collections.abc import Iterator, Mapping, Sequence

from plc_bridge.exports.function_block import COMMAND, NAME, NAMES, REPORT, FunctionBlock, Variable, function_block
from plc_bridge.exports.function_block_body import Language
from plc_bridge.protocol.registers import PARAMETERS, STAGES, Register

_DATA = """\
DATA_BLOCK "DB_InsertionCell"
{ S7_Optimized_Access := 'FALSE' }
VERSION : 0.1
    STRUCT
        Command : "UDT_CellCommand"; // MB_CLIENT writes it to the holding registers from 0 on
        Report : "UDT_CellReport"; // MB_CLIENT reads it from the input registers from 0 on
    END_STRUCT;
BEGIN
END_DATA_BLOCK
"""
"""The data block for the Modbus client."""
_TYPES = {"u16": "UInt", "u32": "UDInt", "i32": "DInt"}
_UDTS = {COMMAND: '"UDT_CellCommand"', REPORT: '"UDT_CellReport"', NAMES: '"UDT_CellNames"', "TON": "TON_TIME"}
"""Types of SCL that replace types of the function block."""
_GROUPED = {"parameter": PARAMETERS, "stage_time": STAGES}
"""Name and length of each array that replaces numbered registers."""


def as_scl(registers: Sequence[Register], names: Mapping[str, int]) -> str:
    """Return the data types, the function block, and a data block for the Modbus client, for this map."""
    block = function_block(registers, names)
    lines = [
        *_udt("UDT_CellCommand", _members(block.command)),
        *_udt("UDT_CellReport", _members(block.report)),
        *_udt("UDT_CellNames", (f"{name} : UInt := {number};" for name, number in names.items())),
        *_block(block),
        *_DATA.splitlines(),
    ]
    return "\r\n".join(lines) + "\r\n"


def _udt(name: str, members: Iterator[str]) -> Iterator[str]:
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
    for name, entry in entries.items():
        group, _, number = name.rpartition("_")
        if group in _GROUPED and number.isdigit():
            if number == "1":
                yield f"{group} : Array[1..{_GROUPED[group]}] of {_TYPES[entry.type]};"
            continue
        kind = f"Array[0..{2 * entry.words - 1}] of Byte" if entry.type == "string" else _TYPES[entry.type]
        yield f"{name} : {kind};"


def _block(block: FunctionBlock) -> Iterator[str]:
    yield f'FUNCTION_BLOCK "{NAME}"'
    yield "{ S7_Optimized_Access := 'TRUE' }"
    yield "VERSION : 0.1"
    for line in block.about.splitlines():
        yield f"// {line}"
    arrays = {each.name: f"Array[{each.low}..{each.high}] of {each.of}" for each in block.arrays}
    yield from block.sections(lambda variable: _declaration(variable, arrays | _UDTS))
    yield "BEGIN"
    command, report = block.command, block.report
    members = {name: f"#Report.{name}" for name in report}
    language = Language(
        sign="#",
        words=members,
        numbers=members,
        stage_time="#Report.stage_time[#Index]",
        sending={name: f"#Command.{name} := {{}};" for name in command},
        arrays=(
            f"FOR #Index := 0 TO {2 * command['serial'].words - 1} DO",
            "    #Command.serial[#Index] := #SerialNumber[#Index];",
            "END_FOR;",
            f"FOR #Index := 1 TO {PARAMETERS} DO",
            "    #Command.parameter[#Index] := #Parameters[#Index];",
            "END_FOR;",
        ),
    )
    lines = block.body(language).splitlines()
    yield from (line for line in lines if not line.lstrip().startswith("(*"))
    yield "END_FUNCTION_BLOCK"
    yield ""


def _declaration(variable: Variable, types: Mapping[str, str]) -> str:
    first = f" := {variable.initial}" if variable.initial else ""
    meaning = f" // {variable.meaning}" if variable.meaning else ""
    return f"{variable.name} : {types.get(variable.type, variable.type)}{first};{meaning}"
