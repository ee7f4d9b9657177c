"""`cell runs`: show selected recorded runs, or export them for other tools."""

import argparse
import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from shutil import get_terminal_size

from rich import box
from rich.console import Group
from rich.table import Table

from cell.commands.arguments import (
    add_query,
    add_records,
    folder_path,
    out_folder,
    positive,
    query_of,
    read_journal,
    require_program,
)
from cell.commands.terminal import GOOD, complain, progress, show, written
from cell.records.journal import Journal
from cell.records.schema import RunRow, plain
from cell.records.wall_clock import headed, local
from drivers.errors import ConfigError, JournalError
from drivers.quantities import Vector
from skills.catalogue import CATALOGUE

LAST, BLOCK = 20, 100
"""Default number of shown runs, and number of runs below one table head."""
TAKEN, SERIAL, PROGRAM = 50, 14, 15
"""Width of the other fields, and of the additional fields for serial number and program, characters."""
FORMATS = ("parquet", "csv", "mcap")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the folder of the records, the selection of runs, and the output."""
    add_records(parser)
    add_query(parser)
    parser.add_argument(
        "--last", type=positive, metavar="N", help=f"only the N newest; default {LAST}, or all with --export"
    )
    parser.add_argument("--export", choices=FORMATS, metavar="FORMAT", help=f"{', '.join(FORMATS)}: runs and samples")
    parser.add_argument("--out", type=folder_path, metavar="DIR", help="folder of the exported files")


def run(args: argparse.Namespace) -> int:
    """Show one line per run, newest first, or write the runs and their samples."""
    if (args.export is None) != (args.out is None):
        raise ConfigError("--export, --out: only together; --export parquet --out DIR allowed")

    query = query_of(args)
    with read_journal(args) as journal:
        shown = journal.select(query, args.last or LAST)
        if not shown:
            require_program(query)
        if not args.export:
            return show(args, _blocks(shown), [plain(row) for row in shown] if args.json else [])
        folder = out_folder(args.out)
        if not args.json:  # show the runs first, because the export takes time
            show(args, _blocks(shown[:LAST]), [])
        _export(args, journal, journal.select(query, *([args.last] if args.last else [])), folder)
    return GOOD


def _blocks(rows: Sequence[RunRow]) -> Group:
    """Return tables of `BLOCK` runs each, so that the first lines appear before all rows are formatted."""
    return Group(*(_table(rows[first : first + BLOCK]) for first in range(0, max(len(rows), 1), BLOCK)))


def _export(args: argparse.Namespace, journal: Journal, rows: Sequence[RunRow], folder: Path) -> None:
    """Write the samples of each run as one file, and, as CSV or Parquet, the runs as one table; print the first file names."""
    from cell.records import sample_export as to
    from cell.records.samples import export_csv, read_samples, torn

    writers: dict[str, Callable[[RunRow, dict[str, Vector], Path], None]] = {
        "csv": lambda row, samples, path: export_csv(samples, path),
        "parquet": to.write_samples_parquet,
        "mcap": to.write_mcap,
    }
    write, files = writers[args.export], []
    if args.export == "csv":
        files.append(folder / "runs.csv")
        with files[0].open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(RunRow.__slots__))
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)
    elif args.export == "parquet":
        files.append(folder / "runs.parquet")
        to.write_runs_parquet(rows, files[0])
    with progress() as bars:
        for row in bars.track(rows, description="runs"):
            recorded = journal.samples_path(row.run)
            try:
                samples = read_samples(recorded)
            except JournalError:
                continue  # the run has no samples, or they have been deleted
            if lack := torn(recorded, samples, row.samples):
                complain(f"warning: {lack}")
            files.append(folder / f"run-{row.run:06d}.{args.export}")
            write(row, samples, files[-1])
    if args.json:
        show(args, "", {"runs": [plain(row) for row in rows], "files": [str(path) for path in files]})
    written(args, files[:3])


def _table(rows: Sequence[RunRow]) -> Table:
    """Return one line per run, at most 80 columns wide; only the cause is shortened, and `cell show` prints it whole."""
    # If all runs are of the default program, its column is left out.
    serials, programs = any(row.serial for row in rows), any(row.program != "insert_peg" for row in rows)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("run", no_wrap=True)
    table.add_column(headed("started", (row.started for row in rows)), no_wrap=True)
    for name in [*(["part"] * serials), *(["program"] * programs), "outcome", "cause"]:
        table.add_column(name, overflow="fold", no_wrap=name in ("program", "outcome"))
    for name in ("insert", "cycle"):
        table.add_column(name, justify="right", no_wrap=True)
    table.caption = "times in s; insert: search + insert + adjust; cycle: from command to answer"
    room = max(get_terminal_size().columns - TAKEN - (SERIAL if serials else 0) - (PROGRAM if programs else 0), 12)
    for row in rows:
        table.add_row(
            str(row.run),
            local(row.started)[:16],
            *([row.serial] * serials),
            *([row.program] * programs),
            row.outcome,
            _why(row, room),
            _insertion(row),
            "" if row.cycle_time is None else f"{row.cycle_time:.3g}",
        )
    return table


def _why(row: RunRow, room: int) -> str:
    """Return the cause in a few words, then the place of the peg; at most `room` letters."""
    cause = f"fault {row.fault}" if row.fault else row.reason.replace("_", " ") or row.message
    peg = row.part.replace("_", " ") if row.part and row.outcome != "success" else ""
    text = ", ".join(filter(None, (cause, peg)))
    return text if len(text) <= room else f"{text[: room - 1]}…"


def _insertion(row: RunRow) -> str:
    times = dict(json.loads(row.stage_times))
    found = [times[name] for name in CATALOGUE.counted if name in times]
    return f"{sum(found):.3g}" if found else ""
