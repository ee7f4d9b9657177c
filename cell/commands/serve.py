"""`cell serve`: the cell as a PLC has it, until it is told to stop."""

import argparse

from cell.arguments import add_config, add_journal, load_config, open_journal
from cell.terminal import GOOD, say

SUMMARY = "obey the PLC until SIGINT or SIGTERM"
STOPS_ITSELF = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the cell is and where its records go."""
    add_config(parser)
    add_journal(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal; stop the arm and return GOOD."""
    from cell.assembly import assemble, opened
    from cell.line import PARAMETERS, PROGRAMS
    from cell.supervisor import Supervisor
    from plc_bridge.bridge import Bridge

    loaded = load_config(args)
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    with open_journal(args, loaded.cell.journal.folder) as journal, opened(assemble(loaded.cell)) as cell:
        supervisor = Supervisor(cell, loaded, bridge, journal, args.stop)
        supervisor.scan()  # the first one compiles; nobody shall meet a cell that cannot answer yet
        try:
            bridge.start()
            say(f"serving on {bridge.address[0]}:{bridge.address[1]}")
            supervisor.serve()
        finally:
            bridge.close()
    return GOOD
