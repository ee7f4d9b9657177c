"""`cell show`: show one recorded run and draw its plots."""

import argparse
from dataclasses import asdict
from pathlib import Path

from cell.commands.arguments import add_journal, out_folder, positive, read_journal
from cell.commands.terminal import GOOD, complain, show, written
from drivers.errors import JournalError

SUMMARY = "one run on record, with its plots"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the run, and the folder of its files."""
    add_journal(parser)
    parser.add_argument("number", type=positive, metavar="RUN")
    parser.add_argument("--export", type=Path, metavar="DIR", help="folder for the raw samples as CSV")


def run(args: argparse.Namespace) -> int:
    """Show the record; then draw the run, and export its samples if requested."""
    from cell.commands import words

    with read_journal(args) as journal:
        row = journal.find(args.number)
        stages = journal.stages(row.run)
    recorded = journal.samples_path(row.run)
    folder = out_folder(args.export) if args.export else journal.folder
    picture, table = (folder / f"run-{row.run:06d}.{kind}" for kind in ("png", "csv"))
    files = ([picture, table] if args.export else [picture]) if recorded.exists() else []
    show(
        args,
        words.run(row, stages),
        {**asdict(row), "stages": [asdict(stage) for stage in stages], "files": [str(path) for path in files]},
    )
    # Imported late: the text must not wait for samples and charts.
    from cell.records.samples import export_csv, read_samples, torn

    samples = read_samples(recorded)
    if not samples["stamp"].size:
        raise JournalError(f"{recorded}: torn: no whole block of samples can be read")
    if lack := torn(recorded, samples, row.samples):
        complain(f"warning: {lack}")
    # The samples of an ended run do not change, and the library of the plots takes most of the time.
    if not picture.exists() or picture.stat().st_mtime < recorded.stat().st_mtime:
        from cell.film.plots import plot_run

        plot_run(row, samples, picture)
    if args.export:
        export_csv(samples, table)
    written(args, files)
    return GOOD
