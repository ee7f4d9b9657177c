"""The function block as Structured Text of IEC 61131-3, second edition, for every compiler of that language."""

from collections.abc import Iterator, Mapping, Sequence

from plc_bridge.function_block import NAME, NAMES, FunctionBlock, Variable, function_block
from plc_bridge.registers import Register


def as_structured_text(registers: Sequence[Register], names: Mapping[str, int]) -> str:
    """Return the named types and the function block `FB_InsertionCell` for this map."""
    block = function_block(registers, names)
    return "\n".join([*_types(block), "", *_head(block), "", block.body, "END_FUNCTION_BLOCK", ""])


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


def _head(block: FunctionBlock) -> Iterator[str]:
    yield f"(* {block.about} *)"
    yield f"FUNCTION_BLOCK {NAME}"
    for kind, variables in (("VAR_INPUT", block.inputs), ("VAR_OUTPUT", block.outputs), ("VAR", block.locals)):
        yield kind
        for variable in variables:
            yield f"    {declaration(variable)}"
        yield "END_VAR"


def declaration(variable: Variable) -> str:
    """Return a variable's declaration, followed by its meaning."""
    first = f" := {variable.initial}" if variable.initial else ""
    said = variable.meaning.replace("*)", "* )")
    return f"{variable.name} : {variable.type}{first};" + (f" (* {said} *)" if said else "")
