"""The function block as Structured Text of IEC 61131-3, second edition, for every compiler of that language."""

from collections.abc import Iterator, Mapping, Sequence

from plc_bridge.exports.function_block import NAME, NAMES, FunctionBlock, Variable, function_block
from plc_bridge.exports.function_block_body import Language
from plc_bridge.protocol.registers import PARAMETERS, Register


def as_structured_text(registers: Sequence[Register], names: Mapping[str, int]) -> str:
    """Return the named types and the function block `FB_InsertionCell` for this map."""
    block = function_block(registers, names)
    head = [f"(* {block.about} *)", f"FUNCTION_BLOCK {NAME}", *block.sections(_declaration)]
    return "\n".join([*_types(block), "", *head, "", body_of(block), "END_FUNCTION_BLOCK", ""])


def _types(block: FunctionBlock) -> Iterator[str]:
    """Yield each type in a separate TYPE block: TwinCAT accepts no more than one type in each."""
    for array in block.arrays:
        yield "TYPE"
        yield f"    {array.name} : ARRAY[{array.low}..{array.high}] OF {array.of};"
        yield "END_TYPE"
    yield "TYPE"
    yield f"    {NAMES} : STRUCT"
    for name, number in block.names.items():
        yield f"        {name} : UINT := {number};"
    yield "    END_STRUCT;"
    yield "END_TYPE"


def _declaration(variable: Variable) -> str:
    """Return a variable's declaration, followed by its meaning."""
    first = f" := {variable.initial}" if variable.initial else ""
    said = variable.meaning.replace("*)", "* )")
    return f"{variable.name} : {variable.type}{first};" + (f" (* {said} *)" if said else "")


def body_of(block: FunctionBlock) -> str:
    """Return the body of the block; the PLCopen XML contains the same text."""
    command, report = block.command, block.report
    first, times = command["parameter_1"].address, f"{report['stage_time_1'].address} + 2 * (Index - 1)"
    high, low = "SerialNumber[2 * Index]", "SerialNumber[2 * Index + 1]"
    words = {name: f"Report[{entry.address}]" for name, entry in report.items()}
    sending = {name: f"Command[{entry.address}] := UINT_TO_WORD({{}});" for name, entry in command.items()}
    return block.body(
        Language(
            sign="",
            words=words,
            numbers={
                name: f"WORD_TO_UINT({words[name]})" if entry.words == 1 else _wide(entry.address, entry.address + 1)
                for name, entry in report.items()
            },
            stage_time=_wide(times, f"{times} + 1"),
            sending=sending | {"version": f"Command[{command['version'].address}] := {{}};"},
            arrays=(
                f"FOR Index := 0 TO {command['serial'].words - 1} DO",
                f"    Command[{command['serial'].address} + Index] := SHL(BYTE_TO_WORD({high}), 8) OR BYTE_TO_WORD({low});",
                "END_FOR;",
                f"FOR Index := 1 TO {PARAMETERS} DO",
                f"    Command[{first} + 2 * (Index - 1)] := DWORD_TO_WORD(SHR(DINT_TO_DWORD(Parameters[Index]), 16));",
                f"    Command[{first} + 2 * (Index - 1) + 1] := DWORD_TO_WORD(DINT_TO_DWORD(Parameters[Index]) AND 16#FFFF);",
                "END_FOR;",
            ),
        )
    )


def _wide(high: int | str, low: int | str) -> str:
    """Return the expression that joins two words of the report to a UDINT."""
    return f"DWORD_TO_UDINT(SHL(WORD_TO_DWORD(Report[{high}]), 16) OR WORD_TO_DWORD(Report[{low}]))"
