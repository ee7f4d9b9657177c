"""`cell run`: run one skill, program or control, in this process or on a served cell."""

import argparse
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from rich.console import Group

from cell.commands import words
from cell.commands.arguments import add_cell, address, load_proven, natural, open_journal, require_known, require_recipe
from cell.commands.terminal import FAULT, GOOD, NOT_GOOD, complain, counting, show
from cell.config.layers import parse_set
from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.page.telling import REFUSED
from cell.records.schema import plain
from cell.run.line import CONTROLS, TOLD, TerminalLine
from drivers.errors import CellError, ConfigError
from plc_bridge.peer import Peer
from plc_bridge.protocol.images import SERIAL, is_serial
from plc_bridge.protocol.messages import REMEDIES, Command, Refusal, Report, Result
from skills.catalogue import CATALOGUE
from skills.contract import Outcome

if TYPE_CHECKING:
    from cell.run.supervisor import Supervisor


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the skill, program or control, the part, and the cell."""
    names = f"{', '.join((*CATALOGUE, *TOLD))}; with --connect also {', '.join(c for c in CONTROLS if c not in TOLD)}"
    add_cell(parser)
    parser.add_argument("name", metavar="NAME", help=names)
    parser.add_argument(
        "--connect", type=address, metavar="HOST:PORT", help="run it on a cell that is served at this address"
    )
    parser.add_argument("--recipe", type=natural, default=0, metavar="N", help="number of the part's recipe")
    parser.add_argument("--serial", default="", metavar="TEXT", help="serial number of the part, for the record")


def run(args: argparse.Namespace) -> int:
    """Run the skill, program or control to its end; return GOOD for a success."""
    require_known("run", args.name, [*CATALOGUE, *CONTROLS])
    if not args.connect and args.name not in (*CATALOGUE, *TOLD):
        raise ConfigError(f"run {args.name}: only with --connect HOST:PORT, on a served cell")
    if not is_serial(args.serial):
        raise ConfigError(f"--serial {args.serial}: at most {SERIAL} printable ASCII characters allowed")
    return _run_there(args) if args.connect else _run_here(args)


def _run_there(args: argparse.Namespace) -> int:
    if args.config is not None or args.simulate:
        raise ConfigError("--config, --simulate: not together with --connect, the cell there has its own devices")
    parameters = _raw_parameters(args.set)
    with counting(args.name) as done:
        report = _run_remote(args, parameters, lambda r: done(r.progress, 100))
    data = words.report(report)
    show(args, " ".join(f"{k}={v}" for k, v in data.items() if v not in ("", "none")), data)
    if refusal := Refusal(report.refusal):
        return complain(f"refused: {refusal.name}: {REFUSED.get(refusal, REMEDIES[refusal])}")
    if args.name in ("stop", "abort"):
        return GOOD
    return {Result.SUCCESS: GOOD, Result.FAULT: FAULT}.get(Result(report.result), NOT_GOOD)


def _raw_parameters(sets: Iterable[str]) -> list[tuple[int, int]]:
    """Return number and raw count of each `KEY=VALUE`.

    Raises:
        ConfigError: The key is not a parameter of commands, or the value is out of range.
    """
    numbers = {spec.name: number for number, spec in enumerate(PARAMETERS)}
    found = []
    for text in sets:
        place, value = parse_set(text)
        key = ".".join(place)
        if key not in numbers:
            raise ConfigError(f"--set {key}: not for --connect; {', '.join(numbers)} allowed")
        spec = PARAMETERS[numbers[key]]
        if isinstance(value, bool) or not isinstance(value, int | float) or not spec.low <= value <= spec.high:
            raise ConfigError(
                f"--set {key} = {value!r}: a number from {spec.low:g} to {spec.high:g} {spec.unit} allowed"
            )
        found.append((numbers[key], round(value / spec.scale)))
    return found


def _run_remote(args: argparse.Namespace, parameters: list[tuple[int, int]], watch: Callable[[Report], None]) -> Report:
    """Run a program, a skill or a control on a served cell, under the same lease as a PLC; return the last report.

    Raises:
        CellError: The cell times out, or another client holds the lease.
    """
    longest = 3600.0  # Longest wait for the end of a run, wall time, s.
    peer = Peer(*args.connect)
    peer.connect()
    is_stopping = False

    def look(report: Report) -> None:
        nonlocal is_stopping
        watch(report)
        if args.stop.is_set() and not is_stopping:
            is_stopping = True
            peer.stop()

    try:
        if args.name in ("stop", "abort"):
            return peer.run(CONTROLS[args.name], timeout=longest)
        if not peer.take():
            host, port = args.connect
            raise CellError(f"{host}:{port}: {peer.read_report().holder} holds the lease; only its holder may start")
        code = CONTROLS[args.name] if args.name in CONTROLS else CATALOGUE[args.name].code
        report = peer.run(code, args.recipe, args.serial, parameters, timeout=longest, watch=look)
        peer.release()
        return report
    finally:
        peer.close()


def _run_here(args: argparse.Namespace) -> int:
    from cell.commands.warm_up import warm_up
    from cell.devices.assembly import assemble, opened
    from cell.run.supervisor import Supervisor

    loaded, _ = load_proven(args)  # with low speed and force until all facts are proven
    require_recipe(args.recipe, loaded)
    code = CATALOGUE[args.name].code if args.name in CATALOGUE else TOLD[args.name]
    command = Command(1, code, args.recipe, args.serial, source="terminal")
    with (
        open_journal(args, loaded.cell.journal) as journal,
        opened(assemble(warm_up(loaded))) as cell,
        counting(args.name) as done,
    ):

        def watch(report: Report) -> None:
            # A thread of the bar draws it, so that a blocked terminal does not delay the scan.
            done(report.progress, 100)
            if report.sequence == command.sequence and report.result is not Result.NONE:
                args.stop.set()

        line = TerminalLine(command, watch)
        supervisor = Supervisor(cell, loaded, line, journal, args.stop)
        supervisor.serve()
    return _told(args, loaded, supervisor, line.refusal)


def _told(args: argparse.Namespace, loaded: LoadedConfig, supervisor: "Supervisor", refusal: Refusal) -> int:
    """Print how the run ended and where the peg is, and return the exit status."""
    row, where = supervisor.last, words.peg(supervisor.part, loaded.cell.is_simulated)
    if refusal is not Refusal.NONE:
        return complain(f"refused: {refusal.name}: {REFUSED[refusal]}; {where}")
    if row is None and args.name in TOLD:
        return show(args, where, {"peg": where})
    if row is None:
        fault = supervisor.report.fault
        return complain(f"fault {fault}: nothing was run", FAULT) if fault else NOT_GOOD
    show(args, Group(words.run(row), where), {**plain(row), "peg": where})
    if supervisor.misfit:
        complain(f"warning: {supervisor.misfit}")
    if row.outcome == Outcome.FAULT:
        return complain(f"fault {row.fault}: {row.message}", FAULT)
    return GOOD if row.outcome == Outcome.SUCCESS else NOT_GOOD
