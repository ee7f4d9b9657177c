"""`cell alarms`: past and present faults and warnings, with their durations."""

import argparse
from dataclasses import asdict
from shutil import get_terminal_size

from rich.box import SIMPLE_HEAD
from rich.table import Table

from cell.commands.arguments import add_period, add_records, period_of, positive, read_journal
from cell.commands.terminal import show
from cell.records.wall_clock import headed, local


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the folder of the records, the period and code, and the number of alarms."""
    add_records(parser)
    add_period(parser)
    parser.add_argument("--last", type=positive, default=20, metavar="N", help="only the N newest; default 20")


def run(args: argparse.Namespace) -> int:
    """Show one line per alarm, newest first."""
    with read_journal(args) as journal:
        alarms = journal.alarms(args.last, *period_of(args), args.fault)
    came = headed("came", (alarm.time for alarm in alarms))
    table = Table(came, "alarm", "state", "s", "run", "details", box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.columns[3].justify = table.columns[4].justify = "right"
    # Width left for the details beside the other columns, characters.
    room = max(get_terminal_size().columns - 58, 12)
    table.caption = "s: duration, of a fault until its reset; acknowledged: fault cleared, but not reset"
    for alarm in alarms:
        what = str(alarm.code) if alarm.code else alarm.name
        lasted = "" if alarm.duration is None else f"{alarm.duration:.1f}"
        text = alarm.text if len(alarm.text) <= room else f"{alarm.text[: room - 1]}…"
        table.add_row(local(alarm.time)[:19], what, alarm.state, lasted, str(alarm.run or ""), text)
    return show(args, table, [asdict(alarm) for alarm in alarms])
