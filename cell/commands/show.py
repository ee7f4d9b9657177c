"""`cell show`: show one recorded run and draw its plots."""

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Group

from cell.commands import words
from cell.commands.arguments import add_records, folder_path, out_folder, positive, read_journal
from cell.commands.terminal import GOOD, complain, show, written
from cell.records.samples import export_csv, read_samples, torn
from cell.records.schema import EventKind, EventRow, RunRow, plain
from drivers.errors import JournalError
from drivers.quantities import Vector


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the run, and the folder of its files."""
    add_records(parser)
    parser.add_argument("number", type=positive, metavar="RUN")
    parser.add_argument(
        "--export", type=folder_path, metavar="DIR", help="folder for the picture, and for the samples as CSV"
    )


def run(args: argparse.Namespace) -> int:
    """Show the record; then draw the run, and export its samples if requested."""
    with read_journal(args) as journal:
        row = journal.find(args.number)
        stages, events = journal.stages(row.run), journal.events(run=row.run)
    recorded = journal.samples_path(row.run)
    folder = out_folder(args.export) if args.export else journal.folder
    picture, table = folder / f"run-{row.run:06d}.png", folder / f"run-{row.run:06d}.csv"
    drawn = [picture, table] if args.export else [picture]
    files = drawn if recorded.exists() else []
    show(
        args,
        Group(words.run(row, stages), words.events(events)),
        {
            **plain(row),
            "stages": [plain(stage) for stage in stages],
            "events": [asdict(event) for event in events],
            "files": [str(path) for path in files],
        },
    )
    samples = _samples(recorded, row)
    # An existing picture stays: the samples of an ended run do not change, and the import of the plots is slow.
    if not picture.exists() or picture.stat().st_mtime < recorded.stat().st_mtime:
        from cell.film.plots import plot_run

        plot_run(row, samples, picture, _faults(events))
    if args.export:
        export_csv(samples, table)
    written(args, files)
    return GOOD


def _faults(events: Sequence[EventRow]) -> dict[str, float]:
    """Return the time of each fault of a run, s, by the code of the fault."""
    return {str(event.code): event.stamp for event in events if event.kind == EventKind.FAULT}


def _samples(recorded: Path, row: RunRow) -> dict[str, Vector]:
    """Return the samples of a run, and warn if some are missing; raise an error if there are none at all."""
    samples = read_samples(recorded)
    if not samples["stamp"].size:
        raise JournalError(f"{recorded}: torn: no whole block of samples can be read")
    if lack := torn(recorded, samples, row.samples):
        complain(f"warning: {lack}")
    return samples
