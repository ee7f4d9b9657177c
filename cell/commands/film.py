"""`cell film`: a run on record as a film, or one picture of it."""

import argparse
from pathlib import Path

from cell.arguments import add_journal, out_folder, positive, read_journal
from cell.terminal import GOOD, complain, progress, show, written

SUMMARY = "a run on record as a film, or one picture of it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add which run, the file, and the moment of a picture."""
    add_journal(parser)
    parser.add_argument("number", type=positive, metavar="RUN")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="*.mp4, *.gif or *.png")
    parser.add_argument("--at", type=float, metavar="S", help="of a *.png: since the first scan; the last one")


def run(args: argparse.Namespace) -> int:
    """Render the run and write the file."""
    from cell.film.files import write_film
    from cell.film.recorded import recorded
    from cell.samples import torn

    with read_journal(args) as journal:
        found = recorded(journal, args.number)
        lack = torn(journal.samples_path(args.number), found.samples, found.row.samples)
    out_folder(args.out.parent)
    with progress() as bars:
        bar = bars.add_task("pictures", total=None)
        pictures = write_film(found, args.out, args.at, lambda done, of: bars.update(bar, completed=done, total=of))
    if lack:
        complain(f"warning: {lack}")
    data = {"run": args.number, "file": str(args.out), "pictures": pictures, "duration": float(found.times[-1])}
    show(args, f"run {args.number}: {pictures} pictures of {found.times[-1]:.1f} s", data)
    written(args, [args.out])
    return GOOD
