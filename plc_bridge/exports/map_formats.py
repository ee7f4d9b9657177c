"""The register map in formats for people and programs; EDS and Structured Text have their own modules."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, fields

from plc_bridge.protocol.registers import MIRROR, VERSION_MAJOR, VERSION_MINOR, Register

RULES = (
    f"Register map {VERSION_MAJOR}.{VERSION_MINOR}. Addresses are zero-based; wide values and strings are "
    "big-endian; value = raw integer x scale, in unit; low and high are raw. Every connection has its own command "
    f"block. Input registers can be read as holding registers too, {MIRROR} higher. On CAN the same values are "
    "objects, index and sub-index, little-endian."
)
"""Rules for the whole map, printed above it."""


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


def as_bytes(registers: Sequence[Register]) -> str:
    """Return the two blocks as bytes for a gateway, as CSV: direction, first byte, number of bytes, and content."""
    lines = ["direction,byte,bytes,type,scale,unit,name"]
    for table, prefix, direction in (("holding", "command_", "to the cell"), ("input", "report_", "from the cell")):
        block = [r for r in registers if r.table == table and r.name.startswith(prefix)]
        for r in block:
            place = 2 * (r.address - block[0].address)
            lines.append(f"{direction},{place},{2 * r.words},{r.type},{r.scale:g},{r.unit},{r.name}")
    return "\n".join(lines) + "\n"


def as_markdown(registers: Sequence[Register]) -> str:
    """Return the map as a Markdown table below its rules."""
    hidden = {"index", "subindex"}
    columns = [column.name for column in fields(Register) if column.name not in hidden]
    lines = [
        RULES,
        "",
        f"| {' | '.join(['object', *columns])} |",
        f"|{' --- |' * (len(columns) + 1)}",
    ]
    for register in registers:
        place = f"{register.index:04X}sub{register.subindex:X}" if register.index else ""
        cells = ["" if getattr(register, name) is None else str(getattr(register, name)) for name in columns]
        lines.append(f"| {' | '.join([place, *cells])} |")
    return "\n".join(lines) + "\n"
