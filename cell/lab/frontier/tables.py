"""Tables of the frontier."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from cell.lab.frontier.measure import FrontierLine
from sim.metering import JERK_BANDWIDTH, OVER_FORCE


def frontier(lines: Sequence[FrontierLine], title: str) -> Table:
    """Return success and speed of each variant."""
    table = Table(title=title, caption="times are of the successes, s; forces are each trial's largest, N")
    for name in (
        "",
        "variant",
        "success",
        "Wilson 95 %",
        "mean",
        "median",
        "p95",
        "force p95",
        "voids",
        "retries",
        "test",
    ):
        table.add_column(name, justify="left" if name in ("", "variant") else "right")
    table.add_column("endings other than success")
    for before, line in zip((None, *lines), lines, strict=False):
        is_new = before is None or before.family != line.family
        table.add_row(
            line.family if is_new else "",
            line.variant,
            f"{line.successes}/{line.trials}",
            f"{100 * line.low:.1f} to {100 * line.high:.1f} %",
            *(f"{value:.1f}" for value in (line.mean, line.median, line.p95, line.force_p95)),
            str(line.voids),
            str(line.retries),
            line.verdict,
            Text(line.error or line.endings),
        )
    return table


def gentleness(lines: Sequence[FrontierLine]) -> Table:
    """Return force and jerk of each variant."""
    table = Table(title="Force and jerk")
    table.caption = (
        f"over: longest time above {OVER_FORCE:g} N, s; median and p95 of each trial's largest force, N; p95 of its largest jerk "
        f"in free space and elsewhere, m/s³, behind {JERK_BANDWIDTH:g} Hz"
    )
    for name in ("", "variant"):
        table.add_column(name)
    for name in (f"≤ {OVER_FORCE:g} N", "over", "median", "p95", "jerk free", "else"):
        table.add_column(name, justify="right")
    for before, line in zip((None, *lines), lines, strict=False):
        if not line.trials:
            continue
        is_new = before is None or before.family != line.family
        table.add_row(
            line.family if is_new else "",
            line.variant,
            f"{line.within}/{line.trials}",
            f"{line.over_longest:.2f}",
            *(f"{value:.1f}" for value in (line.force_median, line.force_p95)),
            *(f"{value:.0f}" for value in (line.jerk_free, line.jerk_contact)),
        )
    return table
