"""The tables of the study of calibrations."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from cell.lab.calibration.measure import SIDES, KindLine
from sim.metering import OVER_FORCE


def truth(lines: Sequence[KindLine], title: str) -> Table:
    """Return the number of calibrated arms, and the number of figures whose intervals contain the true value."""
    table = Table(title=title, caption="a figure: friction of a joint at a speed, or its offset; intervals of 95 %")
    for name in ("arms", "calibrated", "intervals that hold", "worst (N·m)"):
        table.add_column(name, justify="left" if name == "arms" else "right")
    table.add_column("not calibrated")
    for line in lines:
        table.add_row(
            line.kind,
            f"{line.calibrated}/{line.arms}",
            f"{line.held}/{line.figures}",
            f"{line.worst:.3f}",
            Text(line.troubles),
        )
    return table


def pegs(lines: Sequence[KindLine]) -> Table:
    """Return success, time and force of the first peg of each arm, without and with its calibration."""
    table = Table(
        title="First peg of each calibrated arm",
        caption="times are of the successes, s; forces are each trial's largest, N",
    )
    names = ("success", "Wilson 95 %", "mean", "p95", "force median", f"within {OVER_FORCE:g} N")
    for name in ("arms", "calibration", *names):
        table.add_column(name, justify="left" if name in ("arms", "calibration") else "right")
    table.add_column("endings other than success")
    for line in lines:
        for side, of in zip(SIDES, line.results, strict=True):
            table.add_row(
                line.kind if side == SIDES[0] else "",
                side,
                f"{of.successes}/{of.trials}",
                f"{100 * of.low:.1f} to {100 * of.high:.1f} %",
                *(f"{value:.1f}" for value in (of.mean, of.p95, of.force_median)),
                f"{of.within}/{of.trials}",
                Text(of.endings),
            )
    return table
