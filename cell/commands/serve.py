"""`cell serve`: run the cell under PLC control until SIGINT or SIGTERM."""

import argparse
import gc
import logging
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING

from cell.commands.arguments import add_cell, listening, load_proven, open_journal
from cell.commands.terminal import GOOD, say

if TYPE_CHECKING:
    from plc_bridge.config import PlcConfig

logger = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the cell, its page and its records."""
    add_cell(parser)
    for option, default, what in (
        ("--page", "127.0.0.1:8080", "a page for browsers"),  # by default, only this computer can connect
        ("--opcua", "127.0.0.1:4840", "the cell as a PackML unit over OPC UA"),
        ("--metrics", "127.0.0.1:9464", "counters and timings as Prometheus text"),
    ):
        text = f"also serve {what}, by default at {default}"
        parser.add_argument(option, nargs="?", const=default, type=listening, metavar="HOST:PORT", help=text)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal; then stop the arm and return GOOD.

    Raises:
        KeyboardInterrupt: A second signal, if the cell has not ended after the first.
    """
    try:
        _serve(args)
    except KeyboardInterrupt:  # if `stop` is not set, the first signal came before the cell was served
        if args.stop.is_set():
            raise
    return GOOD


def _serve(args: argparse.Namespace) -> None:
    from dataclasses import replace

    from cell.commands.warm_up import warm_up
    from cell.config.parameters import PARAMETERS
    from cell.devices.assembly import assemble, opened
    from cell.run.line import PROGRAMS
    from cell.run.live import Live
    from cell.run.supervisor import Supervisor
    from plc_bridge.bridge import Bridge

    loaded, why = load_proven(args)
    _warn(loaded.cell.plc, args)
    bridge, live = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS, opcua=args.opcua), Live()
    with (
        open_journal(args, loaded.cell.journal) as journal,
        opened(replace(assemble(warm_up(loaded)), commissioning=why)) as cell,
        ExitStack() as servers,
    ):
        supervisor = Supervisor(cell, loaded, bridge, journal, args.stop, live)
        supervisor.scan()  # the first scan compiles; no client may connect before the cell can answer
        gc.freeze()  # a garbage collection of all loaded objects would delay a scan
        args.stop.is_set()  # once it is read, the first signal sets the flag and interrupts no scan
        servers.callback(bridge.close)
        bridge.start()
        say(f"serving on {bridge.address[0]}:{bridge.address[1]}")
        if bridge.opcua_address is not None:
            say(f"OPC UA on opc.tcp://{bridge.opcua_address[0]}:{bridge.opcua_address[1]}/")
        if args.page is not None:
            from cell.page.server import PageServer
            from cell.page.token import FILE

            cables = tuple(cell.cables)
            page = servers.enter_context(PageServer(args.page, bridge, live, loaded, journal.folder, cables))
            # Print the token on a terminal only; a log gets the path of its file.
            token = f"#token={page.token}" if sys.stdout.isatty() else f" token in {journal.folder / FILE}"
            say(f"page on {page.url}{token}")
        if args.metrics is not None:
            from cell.page.server import MetricsServer

            server = servers.enter_context(MetricsServer(args.metrics, bridge, loaded.cell))
            say(f"metrics on {server.url}metrics")
        supervisor.serve()


def _warn(plc: "PlcConfig", args: argparse.Namespace) -> None:
    """Log each open port as a warning, and the days left of each key; a warning if they are few."""
    from cell.devices.checks import OK
    from cell.run.exposure import exposures, key_days, key_verdict

    for line in exposures(plc, args.page, args.metrics, args.opcua):
        logger.warning("%s", line)
    for name, days in key_days(plc.tls).items():
        verdict = key_verdict(days)
        logger.log(logging.INFO if verdict.startswith(OK) else logging.WARNING, "%s: %s", name, verdict)
