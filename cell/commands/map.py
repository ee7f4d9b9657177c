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
    say(_text(form or "md", registers).rstrip("\n"))
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


def _text(form: str, registers: "Sequence[Register]") -> str:
    """Return the table in a format, or the declarations for a PLC program in a language."""
    from cell.run.line import PROGRAMS, WORDS
    from plc_bridge.exports import c_header, map_formats, plcopen_xml, scl, structured_text
    from plc_bridge.exports.plc_names import plc_names

    if form == "eds":
        from plc_bridge.exports.eds import as_eds  # imported alone, with the library of CANopen

        return as_eds(registers)
    tables = {
        "md": map_formats.as_markdown,
        "csv": map_formats.as_csv,
        "json": map_formats.as_json,
        "bytes": map_formats.as_bytes,
    }
    if form in tables:
        return tables[form](registers)
    programs = {
        "st": structured_text.as_structured_text,
        "xml": plcopen_xml.as_plcopen_xml,
        "scl": scl.as_scl,
        "h": c_header.as_c_header,
    }
    return programs[form](registers, plc_names(PROGRAMS, WORDS))
