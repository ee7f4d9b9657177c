"""`cell map`: the one register and object table, in the forms that PLC people import."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cell.terminal import GOOD, say

if TYPE_CHECKING:
    from plc_bridge.registers import Register

SUMMARY = "the register map"
STOPS_ITSELF = False
FORMATS = ("md", "csv", "json", "eds", "st", "xml", "scl", "h", "bytes")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the format."""
    parser.add_argument("--format", choices=FORMATS, default="md", metavar="FORMAT", help=", ".join(FORMATS))


def run(args: argparse.Namespace) -> int:
    """Print the table."""
    from cell.line import PARAMETERS, PROGRAMS, WORDS
    from plc_bridge.registers import table

    registers = table(PROGRAMS, PARAMETERS, WORDS)
    form = "json" if args.json else args.format
    if form in ("st", "xml", "scl", "h"):
        text = _program(form, registers)
    elif form == "eds":
        from plc_bridge.eds import as_eds

        text = as_eds(registers)
    else:
        from plc_bridge import map_formats

        write = {
            "md": map_formats.as_markdown,
            "csv": map_formats.as_csv,
            "json": map_formats.as_json,
            "bytes": map_formats.as_bytes,
        }[form]
        text = write(registers)
    say(text.rstrip("\n"))
    return GOOD


def _program(form: str, registers: "Sequence[Register]") -> str:
    """Return what a program of the PLC's side imports, in the language that is asked for."""
    from cell.line import PROGRAMS, WORDS
    from plc_bridge.plc_names import plc_names

    names = plc_names(PROGRAMS, WORDS)
    if form == "xml":
        from plc_bridge.plcopen_xml import as_plcopen_xml

        return as_plcopen_xml(registers, names)
    if form == "scl":
        from plc_bridge.scl import as_scl

        return as_scl(registers, names)
    if form == "h":
        from plc_bridge.c_header import as_c_header

        return as_c_header(registers, names)
    from plc_bridge.structured_text import as_structured_text

    return as_structured_text(registers, names)
