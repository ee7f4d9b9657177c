"""`cell run`: one skill, program or control by hand, here or on a cell that is served elsewhere."""

import argparse
from dataclasses import asdict

from cell.arguments import add_config, add_journal, address, load_config, natural, open_journal, require_known
from cell.terminal import FAULT, GOOD, NOT_GOOD, complain, progress, show
from drivers.errors import ConfigError

SUMMARY = "one skill or program, by hand"
STOPS_ITSELF = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is run, on which part, and where."""
    from cell.line import CONTROLS
    from skills.catalogue import CATALOGUE

    names = f"{', '.join(CATALOGUE)}; with --connect also {', '.join(CONTROLS)}"
    add_config(parser)
    add_journal(parser)
    parser.add_argument("name", metavar="NAME", help=names)
    parser.add_argument("--connect", type=address, metavar="HOST:PORT", help="on a cell that is served there")
    parser.add_argument("--recipe", type=natural, default=0, metavar="N", help="number of the part's recipe")
    parser.add_argument("--serial", default="", metavar="TEXT", help="of the part, for the record")


def run(args: argparse.Namespace) -> int:
    """Run it to its end; GOOD for a success."""
    from cell.line import CONTROLS
    from skills.catalogue import CATALOGUE

    require_known("run", args.name, [*CATALOGUE, *(CONTROLS if args.connect else ())])
    return _run_there(args) if args.connect else _run_here(args)


def _run_there(args: argparse.Namespace) -> int:
    from cell import client, words
    from plc_bridge.messages import Refusal, Result

    if args.config is not None:
        raise ConfigError("--config: not together with --connect, the cell there has its own; one of the two allowed")
    parameters = client.raw_parameters(args.set)
    with progress() as bars:
        bar = bars.add_task(args.name, total=100)
        report = client.run_remote(
            args.connect,
            args.name,
            args.recipe,
            args.serial,
            parameters,
            lambda r: bars.update(bar, completed=r.progress),
            args.stop,
        )
    data = words.report(report)
    refused = report.refusal != Refusal.NONE
    show(args, " ".join(f"{k}={v}" for k, v in data.items() if v not in ("", "none")), data)
    if args.name in ("stop", "abort") and not refused:
        return GOOD
    statuses = {Result.SUCCESS: GOOD, Result.FAULT: FAULT}
    return NOT_GOOD if refused else statuses.get(Result(report.result), NOT_GOOD)


def _run_here(args: argparse.Namespace) -> int:
    from cell import words
    from cell.assembly import assemble, opened
    from cell.line import TerminalLine
    from cell.supervisor import Supervisor
    from plc_bridge.messages import Command, Report, Result
    from skills.catalogue import CATALOGUE

    loaded = load_config(args)
    if args.recipe not in loaded.recipes:
        raise ConfigError(f"--recipe {args.recipe}: no such recipe; {', '.join(map(str, loaded.recipes))} allowed")
    command = Command(1, CATALOGUE[args.name].code, args.recipe, args.serial, source="terminal")
    with (
        open_journal(args, loaded.cell.journal.folder) as journal,
        progress() as bars,
        opened(assemble(loaded.cell)) as cell,
    ):
        bar = bars.add_task(args.name, total=100)

        def watch(report: Report) -> None:
            bars.update(bar, completed=report.progress)
            if report.sequence == command.sequence and report.result is not Result.NONE:
                args.stop.set()

        supervisor = Supervisor(cell, loaded, TerminalLine(command, watch), journal, args.stop)
        supervisor.serve()
    row = supervisor.last
    if row is None:
        fault = supervisor.report.fault
        return _complain(f"fault {fault}: nothing was run") if fault else NOT_GOOD
    show(args, words.run(row), asdict(row))
    if row.outcome == "fault":
        return _complain(f"fault {row.fault}: {row.message}")
    return GOOD if row.outcome == "success" else NOT_GOOD


def _complain(message: str) -> int:
    complain(message)
    return FAULT
