"""`cell study faults`: every kind of fault during an insertion."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from cell.commands.arguments import out_folder, positive
from cell.lab.arguments import add_seed, add_study, load_simulated, working
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cell.config.load import LoadedConfig
    from cell.lab.faults.contract import FaultKind

SUMMARY = "faults of every kind at every stage: time to rest, force, state, record, and whether production goes on"
QUICK = 150
"""Number of cases in a shortened campaign."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the output folder, and the kinds of faults."""
    add_study(parser)
    add_seed(parser)
    parser.add_argument("--cases", type=positive, metavar="N", help="number of cases, drawn by the seed")
    parser.add_argument(
        "--kind", action="append", default=[], metavar="TEXT", help="only kinds whose name contains TEXT"
    )
    parser.add_argument(
        "--soak",
        type=float,
        default=0.0,
        metavar="HOURS",
        help="instead of breaking things: mixed commands for so many simulated hours, and whether memory, handles and threads grow; each call adds a piece to those in --out",
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Run every case, write the table and draw the chart; with --soak run that instead."""
    from cell.lab.faults import cases, charts, measure, tables
    from cell.lab.faults.bench import KEYS
    from cell.lab.rows import write_rows

    if args.soak > 0.0:
        return _soak(args)
    asked, folder = [*KEYS, *args.set], out_folder(args.out)

    def make(number: int) -> "LoadedConfig":
        args.set = [*asked, f"sim.seed={args.seed + number}"]
        return load_simulated(args, "study faults")

    def arguments(number: int) -> list[str]:
        config = [] if args.config is None else ["--config", str(args.config)]
        return config + [f"--set={key}" for key in (*asked, f"sim.seed={args.seed + number}")]

    limit = make(0).cell.limits.force
    kinds = _kinds(args.kind)
    number = args.cases or (QUICK if args.quick else cases.TURNS * len(cases.STAGES) * len(kinds))
    tried = cases.planned(kinds, number, args.seed)
    rows, table = cases.begun(tried, folder), folder / cases.TABLE
    with working() as bars:
        bar = bars.add_task("faults", total=len(tried), completed=len(rows))

        def watch(case: cases.FaultCase) -> None:
            rows.append(case)
            write_rows(rows, table)  # an interrupted campaign keeps its results
            bars.advance(bar)

        measure.measure(make, tried, folder / "journal", watch, len(rows), arguments)
    charts.draw(rows, folder / charts.CHART)
    lines = tables.lines(rows, limit)
    result = {"kinds": lines, "cases": [asdict(row) for row in rows]}
    is_good = not any(lines[-1][name] for name in tables.NEVER)
    return StudyReport([tables.table(rows, limit)], finite(result), [table, folder / charts.CHART], is_good)


def _kinds(texts: "Sequence[str]") -> "list[FaultKind]":
    """Return the kinds whose name contains one of the texts; all of them without a text.

    Raises:
        ConfigError: There is no such kind.
    """
    from cell.lab.faults.kinds import KINDS
    from drivers.errors import ConfigError

    kinds = [kind for kind in KINDS if not texts or any(text in kind.name for text in texts)]
    if not kinds:
        raise ConfigError(f"--kind {' '.join(texts)}: no such kind; {', '.join(kind.name for kind in KINDS)} allowed")
    return kinds


def _soak(args: argparse.Namespace) -> StudyReport:
    from cell.lab.faults import soak
    from cell.lab.faults.bench import KEYS
    from cell.lab.rows import write_rows
    from cell.lab.tables import plain

    written = out_folder(args.out) / soak.TABLE
    rows = soak.earlier(written)
    piece = rows[-1].piece + 1 if rows else 1
    args.set = [*KEYS, f"sim.seed={args.seed + piece}", *args.set]
    with working() as bars:
        bar = bars.add_task("hours", total=soak.SAMPLES)
        for sample in soak.soak(load_simulated(args, "study faults"), piece, args.soak, args.seed):
            rows.append(sample)
            write_rows(rows, written)  # an interrupted call keeps its samples
            bars.advance(bar)
    lines = soak.pieces(rows)
    commands, lost = sum(line.commands for line in lines), sum(line.lost for line in lines)
    hours, wall, gaps = (sum(getattr(line, name) for line in lines) for name in ("hours", "wall", "gap"))
    title = f"{commands} groups of commands, {lost} lost, in {hours:.2f} simulated hours: {wall:.2f} hours of wall time"
    title += f" in {len(lines)} pieces of code {rows[0].code}, with {gaps:.2f} hours of gaps"
    result = {"pieces": [asdict(line) for line in lines], "samples": [asdict(each) for each in rows]}
    return StudyReport([plain(title, lines)], finite(result), [written], lost == 0)
