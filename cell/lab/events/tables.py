"""The table of the study of hole events."""

import math

from rich.table import Table

from cell.lab.events.measure import HEIGHT, WINDOW
from cell.lab.events.report import NAMES, EventLine, EventStudy


def table(found: EventStudy) -> Table:
    """Return the detectors at the thresholds in use."""
    notes = [
        f"an event within {WINDOW:g} s of the beginning of a fall is its detection; with the hole, {found.in_hole} searches "
        f"began in it and {found.never} never fell",
        *found.others,
    ]
    shown = Table(title=found.title, caption="\n".join(notes))
    for name in (
        "detector",
        "threshold",
        "stopped by a false event",
        "Wilson 95 %",
        "expected",
        "probes",
        "false finds",
        "at most",
        "detected",
        "Wilson 95 %",
        "delay (s)",
        "p95",
        "way (mm)",
        "p95",
    ):
        shown.add_column(name, justify="left" if name == "detector" else "right")
    for line in found.lines:
        if line.in_use:
            is_judged = line.probes >= 0
            late = line.falls - line.early
            shown.add_row(
                NAMES[line.detector],
                _threshold(line),
                f"{line.stopped}/{line.searches}",
                f"{100 * line.low:.2f} to {100 * line.high:.2f} %",
                "by hand" if math.isnan(line.expected) else f"{100 * line.expected:.2g} %",
                str(line.probes) if is_judged else "-",
                str(line.finds) if is_judged else "not judged",
                f"{100 * line.finds_high:.2f} %" if is_judged else "-",
                f"{line.detected}/{late}",
                f"{100 * line.detected_low:.1f} to {100 * line.detected_high:.1f} %",
                f"{line.delay:.2f}",
                f"{line.delay_p95:.2f}",
                f"{1e3 * line.way:.1f}",
                f"{1e3 * line.way_p95:.1f}",
            )
    return shown


def _threshold(line: EventLine) -> str:
    return f"{1e3 * line.threshold:.2f} mm" if line.detector == HEIGHT else f"{100 * line.threshold:.0f} %"
