"""`cell map`: the register and object table, in formats that PLC tools import."""

import argparse
import sys
from collections.abc import Sequence
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from cell.commands.terminal import GOOD, say, show
from cell.config.parameters import PARAMETERS
from cell.run.line import PROGRAMS, WORDS
from plc_bridge.exports.map_formats import RULES
from plc_bridge.protocol.registers import Register, table

if TYPE_CHECKING:
    from rich.console import Group

WRITERS = {
    "md": "map_formats:as_markdown",
    "csv": "map_formats:as_csv",
    "json": "map_formats:as_json",
    "bytes": "map_formats:as_bytes",
    "eds": "eds:as_eds",
    "st": "structured_text:as_structured_text",
    "xml": "plcopen_xml:as_plcopen_xml",
    "scl": "scl:as_scl",
    "h": "c_header:as_c_header",
}
"""Function of `plc_bridge.exports` by format; only the needed one is imported."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the format."""
    forms = f"{', '.join(WRITERS)}; by default a table on a terminal, md in a pipe"
    parser.add_argument("--format", choices=[*WRITERS], metavar="FORMAT", help=forms)


def run(args: argparse.Namespace) -> int:
    """Print the table."""
    registers = table(PROGRAMS, PARAMETERS, WORDS)
    form = "json" if args.json else args.format
    if form is None and sys.stdout.isatty():
        return show(args, _picture(registers), None)
    say(_text(form or "md", registers).rstrip("\n"))
    return GOOD


def _picture(registers: Sequence[Register]) -> "Group":
    """Return the table for terminals, which wraps at the terminal's width, below the rules for all registers."""
    from rich import box  # imported late: the other formats do not need it
    from rich.console import Group
    from rich.table import Table

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


def _text(form: str, registers: Sequence[Register]) -> str:
    """Return the table or the declarations of a PLC program, in one of the formats of `WRITERS`."""
    write = resolve_name(f"plc_bridge.exports.{WRITERS[form]}")
    # Declarations for PLC programs also need the names of the constants.
    if form not in ("st", "xml", "scl", "h"):
        return str(write(registers))
    from plc_bridge.exports.plc_names import plc_names

    return str(write(registers, plc_names(PROGRAMS, WORDS)))
