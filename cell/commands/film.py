"""`cell film`: write a recorded run as a film or as one picture."""

import argparse

from cell.commands.arguments import add_journal, file_path, out_folder, positive, read_journal
from cell.commands.terminal import GOOD, complain, counting, show, written
from cell.film.files import write_film
from cell.film.recorded import recorded
from cell.records.samples import torn


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the run, the file, and the time of a picture."""
    add_journal(parser)
    parser.add_argument("number", type=positive, metavar="RUN")
    parser.add_argument("--out", type=file_path, required=True, metavar="FILE", help="*.mp4, *.webp or *.png")
    at = "time of a *.png, s since the first scan; default the last scan"
    parser.add_argument("--at", type=float, metavar="S", help=at)


def run(args: argparse.Namespace) -> int:
    """Render the run and write the file."""
    with read_journal(args) as journal:
        found = recorded(journal, args.number)
        lack = torn(journal.samples_path(args.number), found.samples, found.row.samples)
    out_folder(args.out.parent)
    with counting("pictures") as done:
        pictures, of = write_film(found, args.out, args.at, done, args.stop.is_set)
    if lack:
        complain(f"warning: {lack}")
    if pictures < of:
        kept = f"{args.out} has the first {pictures} of {of} pictures" if pictures else "no film is written"
        return complain(f"stopped: {kept}")
    data = {"run": args.number, "file": str(args.out), "pictures": pictures, "duration": float(found.times[-1])}
    show(args, f"run {args.number}: {pictures} pictures of {found.times[-1]:.1f} s", data)
    written(args, [args.out])
    return GOOD
