"""`cell study faults`: every kind of fault during an insertion."""

import argparse
import signal
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, TypeVar

from cell.commands.arguments import natural, out_folder, positive
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, load_simulated
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from cell.config.load import LoadedConfig
    from cell.lab.faults.disks import FullDisk
    from cell.lab.faults.kills import Kill

    Row = TypeVar("Row", Kill, FullDisk)

SUMMARY = "faults of every kind at every stage: time to rest, force, state, record, and whether production goes on"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the output folder, and the kinds of faults."""
    add_study(parser)
    add_seed(parser)
    parser.add_argument(
        "--kills",
        type=natural,
        default=0,
        metavar="N",
        help="instead of breaking things: end the program N times, two of three by kill -9",
    )
    parser.add_argument(
        "--signal",
        choices=("KILL", "TERM", "INT", "HUP"),
        help="with --kills: end the program by this signal alone",
    )
    parser.add_argument(
        "--disks",
        type=natural,
        default=0,
        metavar="N",
        help="instead of breaking things: let the disk seem full from a random moment of an insertion on, N times",
    )
    parser.add_argument(
        "--soak",
        type=float,
        default=0.0,
        metavar="HOURS",
        help="instead of breaking things: mixed commands for so many simulated hours, and whether memory, handles and threads grow",
    )
    parser.add_argument("--cases", type=positive, metavar="N", help="N cases, drawn by the seed, instead of all")
    parser.add_argument(
        "--kind", action="append", default=[], metavar="TEXT", help="only kinds whose name contains TEXT"
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Run every case, write the table and draw the chart; with --kills, --disks or --soak run that instead."""
    if args.kills or args.disks:
        return _ends(args)
    if args.soak > 0.0:
        return _soak(args)
    from cell.lab.faults import cases, charts, measure, tables
    from cell.lab.faults.bench import KEYS
    from cell.lab.faults.kinds import KINDS
    from drivers.errors import ConfigError

    asked, folder = [*KEYS, *args.set], out_folder(args.out)

    def make(number: int) -> "LoadedConfig":
        args.set = [*asked, f"sim.seed={args.seed + number}"]
        return load_simulated(args, "study faults")

    def arguments(number: int) -> list[str]:
        config = [] if args.config is None else ["--config", str(args.config)]
        return config + [word for key in (*asked, f"sim.seed={args.seed + number}") for word in ("--set", key)]

    limit = make(0).cell.limits.force
    kinds = [kind for kind in KINDS if not args.kind or any(text in kind.name for text in args.kind)]
    if not kinds:
        raise ConfigError(
            f"--kind {' '.join(args.kind)}: no such kind; {', '.join(kind.name for kind in KINDS)} allowed"
        )
    tried, most = measure.cases(kinds), args.cases or (measure.QUICK if args.quick else None)
    if most is not None:
        tried = measure.drawn(tried, most, args.seed)
    rows = cases.begun(tried, folder)
    with progress() as bars:
        bar = bars.add_task("faults", total=len(tried), completed=len(rows))

        def watch(case: cases.FaultCase) -> None:
            rows.append(case)
            cases.write(rows, folder)  # an interrupted campaign keeps its results
            bars.advance(bar)

        measure.measure(make, tried, watch, len(rows), arguments)
    charts.draw(rows, folder / charts.CHART)
    lines = tables.lines(rows, limit)
    result = {"kinds": lines, "cases": [asdict(row) for row in rows]}
    written = [cases.write(rows, folder), folder / charts.CHART]
    is_good = not any(lines[-1][name] for name in tables.NEVER)
    return StudyReport([tables.table(rows, limit)], finite(result), written, is_good)


def _ends(args: argparse.Namespace) -> StudyReport:
    from cell.lab.faults import disks, kills
    from cell.lab.rows import kept_rows, write_rows
    from cell.lab.tables import plain

    arguments = [word for key in ("sim.pace=max", *args.set) for word in ("--set", key)]
    of_what, name, tries = (
        ("ends of the program", "kills", args.kills) if args.kills else ("full disks", "disks", args.disks)
    )
    folder = out_folder(args.out)
    written = folder / f"{name}.csv"
    # If the same call was interrupted, the journal of the ends continues with them.
    records = folder / f"{name}-{args.seed}"
    with progress() as bars:
        bar = bars.add_task(of_what, total=tries)

        def watch(found: Sequence[kills.Kill | disks.FullDisk]) -> None:
            write_rows(found, written)  # an interrupted call keeps its results
            bars.update(bar, completed=len(found))

        cases: Sequence[kills.Kill | disks.FullDisk]
        stood = 0
        if args.kills:
            ends = (signal.Signals[f"SIG{args.signal}"],) if args.signal else kills.ENDS
            at = kills.draw(tries, args.seed, ends)
            seen = kills.begun(kept_rows(kills.Kill, written) if records.is_dir() else [], at)
            killed = kills.kill(at, args.seed, arguments, out_folder(records), seen, watch)
            stood, cases = sum(case.resets > 0 for case in killed), killed
        else:
            when = disks.draw(tries, args.seed)
            full = disks.begun(kept_rows(disks.FullDisk, written) if records.is_dir() else [], when)
            cases = disks.fill(when, args.seed, arguments, out_folder(records), full, watch)
    unsound = sum(not case.is_sound for case in cases)
    title = f"{len(cases)} {of_what}; {unsound} with something lost or untrue"
    title += f"; {stood} cells stood aborted from their start and were reset" if args.kills else ""
    return StudyReport([plain(title, cases)], {"unsound": unsound, "ends": [asdict(case) for case in cases]}, [written])


def _soak(args: argparse.Namespace) -> StudyReport:
    from cell.lab.faults import soak
    from cell.lab.faults.bench import KEYS
    from cell.lab.tables import plain

    args.set = [*KEYS, f"sim.seed={args.seed}", *args.set]
    with progress() as bars:
        bar = bars.add_task("hours", total=soak.SAMPLES)
        loaded = load_simulated(args, "study faults")
        written = out_folder(args.out) / soak.TABLE

        def watch(sample: soak.SoakSample) -> None:
            soak.write(sample, written)  # an interrupted call keeps its samples
            bars.advance(bar)

        written.unlink(missing_ok=True)
        found, acts = soak.soak(loaded, args.soak, args.seed, watch)
    memory, handles, threads = soak.growth(found)
    title = f"{found[-1].commands} groups of commands in {found[-1].hours:.2f} simulated hours: " + ", ".join(
        f"{count} x {name}" for name, count in sorted(acts.items())
    )
    shown = plain(title, found)
    shown.caption = (
        f"after a quarter, in a simulated hour: {memory:+.1f} MB, {handles:+.1f} handles, {threads:+.1f} threads"
    )
    result = {"memory": memory, "handles": handles, "threads": threads, "samples": [asdict(each) for each in found]}
    return StudyReport([shown], result, [written])
