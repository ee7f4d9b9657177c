"""`cell watch`: show the live state of a served cell."""

import argparse
import json
import sys
from dataclasses import asdict, replace

from rich.text import Text

from cell.commands import words
from cell.commands.arguments import address
from cell.commands.terminal import GOOD, console, say
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Diagnostics, Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the address of the cell, and --once."""
    parser.add_argument("--connect", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument("--once", action="store_true", help="show the present state once and end")


def run(args: argparse.Namespace) -> int:
    """Show every change until a signal: on a terminal in place, in a pipe line by line."""
    last: dict[str, object] = {}
    with console().status("") as status:

        def tell(report: Report, counts: Diagnostics) -> None:
            data = {**words.report(report), "diagnostics": asdict(counts)}
            line = words.line(report, counts)
            if sys.stdout.isatty() and not args.json and not args.once:
                status.update(Text(line))
            else:
                # Every poll increases the number of requests, so that the text would always differ.
                told = {**data, "diagnostics": asdict(replace(counts, requests=0))}
                if told != last:
                    say(json.dumps(data) if args.json else line)
                last.update(told)

        peer = Peer(*args.connect)
        try:
            peer.look()
            while True:
                tell(peer.read_report(), peer.read_diagnostics())
                # Polling period, s.
                if args.once or args.stop.wait(0.1):
                    return GOOD
        finally:
            peer.close()
