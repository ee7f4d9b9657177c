"""Technician commands; the only place that prints. Exit status: 0 done and good, 1 done and not good, 2 wrong use, 3 fault."""

import argparse
import json
import logging
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, replace
from datetime import date
from pathlib import Path
from threading import Event as ThreadEvent
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from cell import client, demo, skin_view, tables
from cell.arguments import parser
from cell.assembly import assemble, check, opened
from cell.calibrate import calibrate_skin
from cell.config import DEFAULT, LoadedConfig, load
from cell.journal import Journal, default_folder
from cell.lab.command import STUDIES
from cell.line import CONTROLS, PARAMETERS, PROGRAMS, WORDS, TerminalLine
from cell.plots import Point, plot_run, plot_speed_accuracy
from cell.samples import export_csv, read_samples
from cell.statistics import stage_table
from cell.supervisor import Supervisor
from cell.trials import TrialRow, run_trials
from drivers.errors import FAULTS, CellError, ConfigError
from plc_bridge.bridge import Bridge
from plc_bridge.eds import as_eds
from plc_bridge.images import Diagnostics, ReportImage
from plc_bridge.map_formats import as_csv, as_json, as_markdown
from plc_bridge.messages import Command, Refusal, Report, Result
from plc_bridge.registers import table
from plc_bridge.structured_text import as_structured_text
from skills.catalogue import CATALOGUE

logger = logging.getLogger(__name__)

GOOD, NOT_GOOD, WRONG_USE, FAULT = 0, 1, 2, 3
_STOPPABLE = ("demo", "serve", "run", "watch", "skin")
_STATUS = {Result.SUCCESS: GOOD, Result.FAULT: FAULT}
_FORMATS = {"md": as_markdown, "csv": as_csv, "json": as_json, "eds": as_eds, "st": as_structured_text}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    try:
        args = parser(list(_FORMATS), list(STUDIES)).parse_args(arguments)
        _log_to_stderr(logging.DEBUG if args.verbose else logging.INFO if args.command == "serve" else logging.ERROR)
        with _signals(args.command) as args.stop:
            return _COMMANDS[args.command](args)
    except ConfigError as error:
        return _complain(str(error), WRONG_USE)
    except CellError as error:
        return _complain(f"fault {error.code.value}: {error}", FAULT)
    except KeyboardInterrupt:
        return _complain("stopped", NOT_GOOD)
    except BrokenPipeError:
        # Whoever read our output has left; point it elsewhere so that the interpreter's last flush is quiet too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOT_GOOD
    except Exception as error:
        logger.debug("error inside this program", exc_info=True)
        return _complain(f"fault {CellError.code.value}: {type(error).__name__}: {error}; -v shows more", FAULT)


def _log_to_stderr(level: int) -> None:
    logging.basicConfig(
        stream=sys.stderr, level=level, format="%(asctime)s %(levelname)s %(name)s: %(message)s", force=True
    )


def _complain(message: str, status: int) -> int:
    print(f"cell: {message}".replace("\n", " "), file=sys.stderr)
    return status


def _show(args: argparse.Namespace, picture: Any, data: object) -> None:
    """Print a result: for people, or with --json for programs."""
    if args.json:
        print(json.dumps(data, indent=2))
    else:
        console = Console()
        # A pipe has no width; cutting a table there would lose what it says.
        Console(width=console.width if console.is_terminal else 200).print(picture)


@contextmanager
def _signals(command: str) -> Iterator[ThreadEvent]:
    """Yield an event that SIGINT and SIGTERM set while a command moves or watches a cell; others they interrupt."""
    stop = ThreadEvent()
    handler = (lambda *_: stop.set()) if command in _STOPPABLE else signal.default_int_handler
    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def _progress() -> Progress:
    """Return bars on a terminal, nothing in a pipe."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty())


def _load(args: argparse.Namespace, default_pace: str | None = None) -> LoadedConfig:
    sets = list(args.set)
    if default_pace is not None and not any(text.startswith("sim.pace=") for text in sets):
        sets.append(f"sim.pace={default_pace}")
    return load(args.config, sets=sets)


def _journal(args: argparse.Namespace, folder: str = "") -> Journal:
    return Journal(args.journal or (Path(folder).expanduser() if folder else default_folder()))


def _out(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be made: {error.strerror}") from None
    return folder


# The commands.


def _check(args: argparse.Namespace) -> int:
    loaded = _load(args)
    found = check(assemble(loaded.cell))
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    try:
        bridge.start()
        found.append(("plc", "ok"))
    except CellError as error:
        found.append(("plc", f"fault {error.code.value}: {error}"))
    finally:
        bridge.close()
    _show(args, tables.devices(found), [{"device": name, "found": text} for name, text in found])
    return GOOD if all(text == "ok" for _, text in found) else FAULT


def _demo(args: argparse.Namespace) -> int:
    loaded = _load(args, default_pace="max")
    folder = _out(args.out)
    with _journal(args, loaded.cell.journal.folder) as journal, _progress() as progress:
        bar = progress.add_task("insertions", total=args.trials)

        def watch(done: int, report: ReportImage) -> None:
            progress.update(
                bar, completed=done, description=f"insertions: {tables.report(report)['stage'] or 'waiting'}"
            )

        result = demo.run_demo(loaded, journal, args.trials, watch, args.stop)
        pictures = demo.draw_demo(result, journal, folder)
    lines = stage_table(result.tried())
    results = [tables.report(report) for report in result.reports]
    data = {"results": results, "stages": [asdict(line) for line in lines], "pictures": [str(p) for p in pictures]}
    _show(args, tables.stages(lines), data)
    if not args.json:
        for row in result.rows:
            print(f"run {row.run}: {row.outcome} {row.stage} {row.reason}".rstrip())
        print("pictures:", *pictures)
    return GOOD if len(results) == args.trials and all(r["result"] == "success" for r in results) else NOT_GOOD


def _serve(args: argparse.Namespace) -> int:
    loaded = _load(args)
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    with _journal(args, loaded.cell.journal.folder) as journal, opened(assemble(loaded.cell)) as cell:
        supervisor = Supervisor(cell, loaded, bridge, journal, args.stop)
        supervisor.scan()  # the first one compiles; nobody shall meet a cell that cannot answer yet
        try:
            bridge.start()
            print(f"serving on {bridge.address[0]}:{bridge.address[1]}", flush=True)
            supervisor.serve()
        finally:
            bridge.close()
    return GOOD


def _run(args: argparse.Namespace) -> int:
    names = [*CATALOGUE, *(CONTROLS if args.connect else ())]
    if args.name not in names:
        raise ConfigError(f"run {args.name}: no such skill or program; {', '.join(names)} allowed")
    return _run_there(args) if args.connect else _run_here(args)


def _run_there(args: argparse.Namespace) -> int:
    if args.config is not None:
        raise ConfigError("--config: not together with --connect, the cell there has its own; one of the two allowed")
    parameters = client.raw_parameters(args.set)
    with _progress() as progress:
        bar = progress.add_task(args.name, total=100)
        report = client.run_remote(
            args.connect,
            args.name,
            args.recipe,
            args.serial,
            parameters,
            lambda r: progress.update(bar, completed=r.progress),
            args.stop,
        )
    data = tables.report(report)
    refused = report.refusal != Refusal.NONE
    _show(args, " ".join(f"{k}={v}" for k, v in data.items() if v not in ("", "none")), data)
    if args.name in ("stop", "abort") and not refused:
        return GOOD
    return NOT_GOOD if refused else _STATUS.get(Result(report.result), NOT_GOOD)


def _run_here(args: argparse.Namespace) -> int:
    loaded = _load(args)
    if args.recipe not in loaded.recipes:
        raise ConfigError(f"--recipe {args.recipe}: no such recipe; {', '.join(map(str, loaded.recipes))} allowed")
    command = Command(1, CATALOGUE[args.name].code, args.recipe, args.serial, source="terminal")
    with (
        _journal(args, loaded.cell.journal.folder) as journal,
        _progress() as progress,
        opened(assemble(loaded.cell)) as cell,
    ):
        bar = progress.add_task(args.name, total=100)

        def watch(report: Report) -> None:
            progress.update(bar, completed=report.progress)
            if report.sequence == command.sequence and report.result is not Result.NONE:
                args.stop.set()

        supervisor = Supervisor(cell, loaded, TerminalLine(command, watch), journal, args.stop)
        supervisor.serve()
    row = supervisor.last
    if row is None:
        fault = supervisor.report.fault
        return _complain(f"fault {fault}: nothing was run", FAULT) if fault else NOT_GOOD
    _show(args, tables.run(row), asdict(row))
    if row.outcome == "fault":
        return _complain(f"fault {row.fault}: {row.message}", FAULT)
    return GOOD if row.outcome == "success" else NOT_GOOD


def _watch(args: argparse.Namespace) -> int:
    last: dict[str, object] = {}
    with Console().status("") as status:

        def show(report: ReportImage, counts: Diagnostics) -> None:
            data = {**tables.report(report), "diagnostics": asdict(counts)}
            line = tables.watch(report, counts)
            if sys.stdout.isatty() and not args.json and not args.once:
                status.update(line)
            else:
                told = {**data, "diagnostics": asdict(replace(counts, requests=0))}  # looking is a request too
                if told != last:
                    print(json.dumps(data) if args.json else line, flush=True)
                last.update(told)

        client.watch_remote(args.connect, show, args.stop, args.once)
    return GOOD


def _trials(args: argparse.Namespace) -> int:
    config = _load(args, default_pace="max").cell
    config.require_simulated("trials")
    seeds = range(args.seed, args.seed + args.trials)
    with _progress() as progress:
        bar = progress.add_task("trials", total=args.trials)

        def done(row: TrialRow) -> None:
            progress.advance(bar)

        rows = run_trials(config, seeds, args.workers or os.cpu_count() or 1, args.out, done, args.scheduler)
    lines = stage_table([row.tried() for row in rows])
    total = lines[-1]
    point = Point(
        "this cell, simulated", total.successes, total.attempts, float("nan") if total.time is None else total.time
    )
    plot_speed_accuracy([point], args.out / demo.CHART)
    _show(args, tables.stages(lines), json.loads((args.out / "summary.json").read_text(encoding="utf-8")))
    if not args.json:
        Console().print(tables.outcomes(rows))
        print("written:", *(args.out / name for name in ("trials.csv", "summary.json", demo.CHART)))
    return GOOD


def _skin(args: argparse.Namespace) -> int:
    args.set += [] if args.record is None else [f"skin.record={args.record.as_posix()}"]
    config = _load(args).cell
    is_live = sys.stdout.isatty() and not args.json
    seconds = args.seconds if args.seconds is not None else math.inf if is_live else 1.0
    seen: list[skin_view.Seen] = []
    with Live(auto_refresh=False) if is_live else nullcontext() as live:

        def show(now: skin_view.Seen) -> None:
            seen[:] = [now]
            if live is not None:
                live.update(skin_view.fingers(now, config.skin.layout), refresh=True)

        if args.replay is None:
            skin_view.watch(config, seconds, show, args.stop)
        else:
            skin_view.play(config, args.replay, seconds, show, args.stop, at_pace=is_live)
    if args.out is not None:
        skin_view.draw(seen[0].frame, config.skin.layout, args.out)
    if not is_live:
        _show(args, skin_view.fingers(seen[0], config.skin.layout), skin_view.as_data(seen[0]))
    return GOOD


def _ask(text: str) -> None:
    """Wait until somebody at the terminal has done something; standard output is for results."""
    print(f"\n{text}", end="", file=sys.stderr, flush=True)
    input()


def _calibrate(args: argparse.Namespace) -> int:
    today = date.today()
    config = _load(args).cell
    path = (args.out or (args.config or DEFAULT).parent / "calibration") / f"skin_{today.isoformat()}.toml"
    if not config.is_skin_simulated() and not sys.stdin.isatty():
        raise ConfigError("calibrate skin: somebody has to turn a rod between the pads; a terminal needed")
    with _progress() as progress:
        bar = progress.add_task("angles")
        found = calibrate_skin(config, today, lambda done, of: progress.update(bar, completed=done, total=of), _ask)
    found.write(path)
    _show(args, tables.calibration(found, path), {**found.model_dump(mode="json"), "file": str(path)})
    return GOOD


def _study(args: argparse.Namespace) -> int:
    study = STUDIES[args.name]
    loaded = _load(args, default_pace=study.pace)
    loaded.cell.require_simulated(f"study {args.name}")
    with _progress() as progress:
        shown = study.run(args, loaded, progress)
    _show(args, Group(*shown.tables), shown.result)
    if shown.written and not args.json:
        print("written:", *shown.written)
    return GOOD


def _runs(args: argparse.Namespace) -> int:
    with _journal(args) as journal:
        rows = journal.runs(args.last)
    _show(args, tables.runs(rows), [asdict(row) for row in rows])
    return GOOD


def _show_run(args: argparse.Namespace) -> int:
    with _journal(args) as journal:
        row = journal.find(args.number)
    samples = read_samples(journal.samples_path(row.run))
    folder = _out(args.export) if args.export else journal.folder
    picture = folder / f"run-{row.run:06d}.png"
    plot_run(row, samples, picture)
    written = [picture]
    if args.export:
        written.append(folder / f"run-{row.run:06d}.csv")
        export_csv(samples, written[-1])
    _show(args, tables.run(row), {**asdict(row), "files": [str(path) for path in written]})
    if not args.json:
        print("written:", *written)
    return GOOD


def _faults(args: argparse.Namespace) -> int:
    _show(
        args,
        tables.faults(),
        [{"code": code.value, "name": code.name, **asdict(text)} for code, text in FAULTS.items()],
    )
    return GOOD


def _map(args: argparse.Namespace) -> int:
    print(_FORMATS["json" if args.json else args.format](table(PROGRAMS, PARAMETERS, WORDS)).rstrip("\n"))
    return GOOD


_COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "check": _check,
    "demo": _demo,
    "serve": _serve,
    "run": _run,
    "watch": _watch,
    "trials": _trials,
    "calibrate": _calibrate,
    "skin": _skin,
    "study": _study,
    "runs": _runs,
    "show": _show_run,
    "faults": _faults,
    "map": _map,
}
