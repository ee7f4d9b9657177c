"""`cell view`: play a recorded run, or the present one, in a 3-D window."""

import argparse

from cell.commands.arguments import add_journal, positive, read_journal
from cell.commands.terminal import GOOD
from cell.film.playback import play
from drivers.errors import JournalError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the run."""
    add_journal(parser)
    parser.add_argument("number", type=positive, nargs="?", metavar="RUN", help="number of the run; default the newest")


def run(args: argparse.Namespace) -> int:
    """Play the run in real time until its window is closed; follow the present run as it is recorded."""
    with read_journal(args) as journal:
        number = args.number or journal.last_run()
        if not number:
            raise JournalError(f"{journal.folder}: no runs are on record yet")
        play(journal, number, args.stop)
    return GOOD
