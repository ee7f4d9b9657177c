"""`cell map`: the one register and object table, in the forms that PLC people import."""

import argparse
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from cell.terminal import GOOD, say

if TYPE_CHECKING:
    from plc_bridge.registers import Register

SUMMARY = "the register map"
STOPS_ITSELF = False
FORMATS = ("md", "csv", "json", "eds", "st")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the format."""
    parser.add_argument("--format", choices=FORMATS, default="md", metavar="FORMAT", help=", ".join(FORMATS))


def run(args: argparse.Namespace) -> int:
    """Print the table."""
    from cell.line import PARAMETERS, PROGRAMS, WORDS
    from plc_bridge.registers import table

    write = _writer("json" if args.json else args.format)
    say(write(table(PROGRAMS, PARAMETERS, WORDS)).rstrip("\n"))
    return GOOD


def _writer(form: str) -> "Callable[[Sequence[Register]], str]":
    if form == "eds":
        from plc_bridge.eds import as_eds

        return as_eds
    if form == "st":
        from plc_bridge.structured_text import as_structured_text

        return as_structured_text
    from plc_bridge import map_formats

    return {"md": map_formats.as_markdown, "csv": map_formats.as_csv, "json": map_formats.as_json}[form]
