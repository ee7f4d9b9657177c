"""`cell study faults`: every kind of fault during an insertion."""

import argparse

from cell.commands.arguments import out_folder
from cell.config.load import LoadedConfig
from cell.lab.arguments import advancing, load_simulated
from cell.lab.faults import cases, measure, soak, tables
from cell.lab.faults.bench import KEYS
from cell.lab.faults.contract import FaultKind
from cell.lab.faults.kinds import KINDS
from cell.lab.report import StudyReport, reported
from cell.lab.rows import write_rows
from cell.lab.tables import plain
from drivers.errors import ConfigError

QUICK = 150
"""Number of cases in a shortened campaign."""


def run(args: argparse.Namespace) -> StudyReport:
    """Run every case and write the table; with --soak, run the soak test instead."""
    if args.soak > 0.0:
        return _soak(args)
    asked, folder = [*KEYS, *args.set], out_folder(args.out)

    def make(number: int) -> LoadedConfig:
        args.set = [*asked, f"sim.seed={args.seed + number}"]
        return load_simulated(args)

    def arguments(number: int) -> list[str]:
        config = [] if args.config is None else ["--config", str(args.config)]
        return config + [f"--set={key}" for key in (*asked, f"sim.seed={args.seed + number}")]

    limit = make(0).cell.limits.force
    kinds = _kinds(args.kind)
    number = args.cases or (QUICK if args.quick else cases.TURNS * len(cases.STAGES) * len(kinds))
    tried = cases.planned(kinds, number, args.seed)
    rows = cases.begun(tried, folder)
    with advancing("faults", len(tried), len(rows)) as done:
        for case in measure.measure(make, tried, folder / "journal", len(rows), arguments):
            rows.append(case)
            write_rows(rows, folder / cases.TABLE)  # an interrupted campaign keeps its results
            done(1)
    lines = tables.lines(rows, limit)
    is_good = not any(lines[-1][name] for name in tables.NEVER)
    return reported(tables.shown(lines), folder, {cases.TABLE: rows}, is_good=is_good, kinds=lines, cases=rows)


def _kinds(texts: list[str]) -> list[FaultKind]:
    """Return the kinds whose name contains one of the texts; all kinds if there is no text.

    Raises:
        ConfigError: There is no such kind.
    """
    kinds = [kind for kind in KINDS if not texts or any(text in kind.name for text in texts)]
    if not kinds:
        raise ConfigError(f"--kind {' '.join(texts)}: no such kind; {', '.join(kind.name for kind in KINDS)} allowed")
    return kinds


def _soak(args: argparse.Namespace) -> StudyReport:
    folder = out_folder(args.out)
    rows = soak.earlier(folder / soak.TABLE)
    piece = rows[-1].piece + 1 if rows else 1
    args.set = [*KEYS, f"sim.seed={args.seed + piece}", *args.set]
    with advancing("groups of commands", None, len(rows)) as done:
        for group in soak.soak(load_simulated(args), piece, args.soak, args.seed):
            rows.append(group)
            write_rows(rows, folder / soak.TABLE)  # an interrupted call keeps its groups
            done(1)
    lines = soak.pieces(rows)
    lost = sum(line.lost for line in lines)
    hours, wall, gaps = (sum(getattr(line, name) for line in lines) for name in ("hours", "wall", "gap"))
    title = (
        f"{len(rows)} groups of commands, {lost} lost, in {hours:.2f} simulated hours: {wall:.2f} hours of wall time"
    )
    title += f" in {len(lines)} pieces of code {rows[0].code}, with {gaps:.2f} hours of gaps"
    return reported(plain(title, lines), folder, {soak.TABLE: rows}, is_good=lost == 0, pieces=lines, groups=rows)
