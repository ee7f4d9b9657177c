"""`cell watch`: show the live state of a served cell."""

import argparse
import json
import sys
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from cell.commands.arguments import address
from cell.commands.terminal import GOOD, console, say

if TYPE_CHECKING:
    from plc_bridge.protocol.images import Diagnostics
    from plc_bridge.protocol.messages import Report

SUMMARY = "live state of a cell that is served"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the address of the cell, and the duration."""
    parser.add_argument("--connect", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument("--once", action="store_true", help="show the present state once and end")


def run(args: argparse.Namespace) -> int:
    """Show every change until a signal: on a terminal in place, in a pipe line by line."""
    from rich.text import Text

    from cell.commands import client, words

    last: dict[str, object] = {}
    with console().status("") as status:

        def tell(report: "Report", counts: "Diagnostics") -> None:
            data = {**words.report(report), "diagnostics": asdict(counts)}
            line = words.line(report, counts)
            if sys.stdout.isatty() and not args.json and not args.once:
                status.update(Text(line))
            else:
                told = {
                    **data,
                    "diagnostics": asdict(replace(counts, requests=0)),
                }  # each poll is a request and would count itself
                if told != last:
                    say(json.dumps(data) if args.json else line)
                last.update(told)

        client.watch_remote(args.connect, tell, args.stop, args.once)
    return GOOD
