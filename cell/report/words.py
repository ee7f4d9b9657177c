"""The facts of a report as tables of text, for terminals and documents; pure."""

from collections.abc import Sequence
from pathlib import Path

from cell.records.statistics import spread
from cell.records.wall_clock import headed, local
from cell.report.facts import WORN, Facts, Trend
from drivers.errors import ConfigError

HTML, PDF = ".html", ".pdf"
"""Suffixes of the file formats of a report."""
MOST_SHIFTS = 21
"""Largest number of shifts in a table: a week of three a day."""

Table = tuple[str, tuple[str, ...], Sequence[tuple[str, ...]]]
"""Title, head and rows of a table."""


def require_kind(path: Path) -> None:
    """Require a known suffix of the file.

    Raises:
        ConfigError: The suffix is unknown.
    """
    if path.suffix.lower() not in (HTML, PDF):
        raise ConfigError(f"--out {path}: *{HTML}, *{PDF} allowed")


def tables(facts: Facts) -> list[Table]:
    """Return the content of a report as tables."""
    return [*overview(facts), *([_shifts(facts), _trends(facts)] if facts.shifts else [])]


def overview(facts: Facts) -> list[Table]:
    """Return yield, times and losses as tables; the first cell of each row is its name."""
    low, high = facts.total.interval
    share = "no runs" if facts.total.share is None else _percent(facts.total.share)
    times = [
        ("cycle: command to answer", *_times(facts.cycle)),
        ("search + insert + adjust", *_times(facts.insertion)),
    ]
    for stage in facts.stages:
        name = stage.name.replace("_", " ")
        times.append((name, *_times(stage.counted)))
        times.append((f"{name} with its transfer", *_times(stage.whole)))
    counts = ", ".join(f"{count} {outcome}" for outcome, count in facts.outcomes.items())
    found: list[Table] = [
        (
            "Yield",
            ("what", "found"),
            [
                ("runs", f"{facts.total.runs} ended: {counts}" if facts.total.runs else "none"),
                ("yield", f"{share}, 95 % interval {100 * low:.1f} to {100 * high:.1f} %"),
                ("first run", local(facts.first)),
                ("last run", local(facts.last)),
                ("largest force", _forces(facts)),
                ("wear: residual of theta", _drift(facts)),
            ],
        ),
        ("Times of successful runs", ("time", "median (s)", "p95 (s)", "n"), times),
    ]
    if facts.losses:
        rows = [
            (loss.what, str(loss.count), f"{loss.minutes:.1f}", f"{100 * loss.cumulative:.0f} %")
            for loss in facts.losses
        ]
        found.append(("Where time was lost", ("what", "runs", "lost until the next start (min)", "together"), rows))
    return found


def _shifts(facts: Facts) -> Table:
    rows = []
    for shift in facts.shifts[-MOST_SHIFTS:]:
        low, high = shift.runs.interval
        rows.append(
            (
                shift.start[5:],
                str(shift.runs.runs),
                _percent(shift.runs.share),
                f"{100 * low:.1f} to {100 * high:.1f} %",
                _percent(shift.availability),
                f"{shift.minutes:.1f}",
            )
        )
    head = (_from(facts), "runs", "yield", "95 % interval", "available", "lost (min)")
    return f"Shifts, {_last(facts)}; available: no abort or fault waits for its reset", head, rows


def _trends(facts: Facts) -> Table:
    rows = [
        (shift.start[5:], *(_mean(trend, shift.start) for trend in facts.trends))
        for shift in facts.shifts[-MOST_SHIFTS:]
    ]
    for place, name in enumerate(("lower limit", "upper limit")):
        rows.append((name, *("-" if trend.limits is None else f"{trend.limits[place]:.2f}" for trend in facts.trends)))
    head = (_from(facts), *(trend.name.replace("_", " ") for trend in facts.trends))
    return (
        f"Mean times of successful runs with transfers (s), {_last(facts)}; * outside the limits of all shifts",
        head,
        rows,
    )


def _from(facts: Facts) -> str:
    return headed("shift from", (shift.start for shift in facts.shifts[-MOST_SHIFTS:]))


def _mean(trend: Trend, shift: str) -> str:
    if shift not in trend.means:
        return "-"
    return f"{trend.means[shift]:.2f}{'*' * trend.is_beyond(shift)}"


def _last(facts: Facts) -> str:
    shown = min(len(facts.shifts), MOST_SHIFTS)
    return f"the last {shown} of {len(facts.shifts)}" if shown < len(facts.shifts) else f"all {shown}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _times(times: dict[str, float] | None) -> tuple[str, str, str]:
    """Return median, 95th percentile and number of the times."""
    return ("-", "-", "0") if times is None else (f"{times['median']:.2f}", f"{times['p95']:.2f}", str(int(times["n"])))


def _forces(facts: Facts) -> str:
    found = spread(facts.forces)
    if found is None:
        return "not on record"
    return f"median {found['median']:.1f} N, p95 {found['p95']:.1f} N, most {max(facts.forces):.1f} N"


def _drift(facts: Facts) -> str:
    drift = facts.drift
    if drift is None:
        return f"{len(facts.residuals)} on record, too few for a trend"
    left = drift.days_left
    verdict = "does not rise beyond chance" if left is None else f"rises, {left:.0f} days to the limit"
    return (
        f"{drift.present:.3f} now, at most {WORN}: {verdict}; "
        f"{drift.per_day:+.4f} a day ({drift.low:+.4f} to {drift.high:+.4f}, n = {drift.n})"
    )
