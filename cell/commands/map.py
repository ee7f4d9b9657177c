"""`cell map`: the register and object table, in formats that PLC tools import."""

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cell.commands.terminal import GOOD, say, show

if TYPE_CHECKING:
    from rich.console import Group

    from plc_bridge.protocol.registers import Register

SUMMARY = "the register map"
FORMATS = ("md", "csv", "json", "eds", "st", "xml", "scl", "h", "bytes")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the format."""
    forms = f"{', '.join(FORMATS)}; on a terminal a table, in a pipe md"
    parser.add_argument("--format", choices=FORMATS, metavar="FORMAT", help=forms)


def run(args: argparse.Namespace) -> int:
    """Print the table."""
    from cell.config.parameters import PARAMETERS
    from cell.run.line import PROGRAMS, WORDS
    from plc_bridge.protocol.registers import table

    registers = table(PROGRAMS, PARAMETERS, WORDS)
    form = "json" if args.json else args.format
    if form is None and sys.stdout.isatty():
        show(args, _picture(registers), None)
        return GOOD
    form = form or "md"
    if form in ("st", "xml", "scl", "h"):
        text = _program(form, registers)
    elif form == "eds":
        from plc_bridge.exports.eds import as_eds

        text = as_eds(registers)
    else:
        from plc_bridge.exports import map_formats

        write = {
            "md": map_formats.as_markdown,
            "csv": map_formats.as_csv,
            "json": map_formats.as_json,
            "bytes": map_formats.as_bytes,
        }[form]
        text = write(registers)
    say(text.rstrip("\n"))
    return GOOD


def _picture(registers: "Sequence[Register]") -> "Group":
    """Return the table for terminals, at most 80 columns wide, below its general rules."""
    from rich import box
    from rich.console import Group
    from rich.table import Table

    from plc_bridge.exports.map_formats import RULES

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("address", "name", "type", "meaning"):
        table.add_column(name, no_wrap=name == "address")
    for each in registers:
        unit = f"{each.scale:g} {each.unit}".strip() if each.unit or each.scale != 1.0 else ""
        limits = "" if each.low is None and each.high is None else f"{each.low} to {each.high}"
        place = f"{each.index:04X}sub{each.subindex:X} {each.pdo}".rstrip() if each.index else ""
        table.add_row(
            f"{each.table} {each.address}\n{place}".rstrip(),
            each.name,
            "\n".join(filter(None, (f"{each.type} {each.access}", unit, limits))),
            each.meaning,
        )
    return Group(RULES, table)


def _program(form: str, registers: "Sequence[Register]") -> str:
    """Return the declarations for a PLC program, in the requested language."""
    from cell.run.line import PROGRAMS, WORDS
    from plc_bridge.exports.plc_names import plc_names

    names = plc_names(PROGRAMS, WORDS)
    if form == "xml":
        from plc_bridge.exports.plcopen_xml import as_plcopen_xml

        return as_plcopen_xml(registers, names)
    if form == "scl":
        from plc_bridge.exports.scl import as_scl

        return as_scl(registers, names)
    if form == "h":
        from plc_bridge.exports.c_header import as_c_header

        return as_c_header(registers, names)
    from plc_bridge.exports.structured_text import as_structured_text

    return as_structured_text(registers, names)
