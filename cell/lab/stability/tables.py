"""Table of the study of stability."""

from rich.table import Table

from cell.config.margins import MARGIN
from cell.lab.stability.report import UNITS, StabilityReport


def table(report: StabilityReport) -> Table:
    """Return the margins for the terminal."""
    found = Table(title="Gains that the skin steers, against the boundary of theory")
    for name in ("skill", "gain", "value", "unstable from", "margin"):
        found.add_column(name, justify="left" if name in ("skill", "gain") else "right")
    for line in report.shipped:
        unit = UNITS[line.kind]
        found.add_row(
            line.skill, line.kind, f"{line.gain:g} {unit}", f"{line.limit:.4g} {unit}", f"{line.margin:.2f} times"
        )
    arm, guard = report.data["against_theory"], report.data["guard"]
    found.caption = (
        f"margin needed {MARGIN:g}; n = {report.data['cases']}. Observer off: {arm['stable_below']} stable below the boundary"
        f" and {arm['unstable_below']} not, {arm['unstable_above']} unstable above it and {arm['stable_above']} not."
        f" Observer on: {guard['unstable_with_observer']} unstable."
        f" Guard: stops {guard['unstable_stopped']} of {guard['unstable']} unstable, {guard['stable_stopped']} of {guard['stable']} stable."
    )
    return found
