"""The facts of a report as tables of text, for terminals and documents; pure."""

from collections.abc import Sequence
from pathlib import Path

from cell.records.statistics import spread
from cell.records.wall_clock import local
from cell.report.facts import Facts
from drivers.errors import ConfigError

HTML, PDF = ".html", ".pdf"
"""Suffixes of the file formats of a report."""

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
    low, high = facts.total.interval
    share = "no runs" if facts.total.share is None else f"{100 * facts.total.share:.1f} %"
    times = [
        ("cycle: command to answer", _time(facts.cycle, "median"), _time(facts.cycle, "p95"), _n(facts.cycle)),
        (
            "search + insert + adjust",
            _time(facts.insertion, "median"),
            _time(facts.insertion, "p95"),
            _n(facts.insertion),
        ),
    ]
    for stage in facts.stages:
        name = stage.name.replace("_", " ")
        times.append((name, _time(stage.counted, "median"), _time(stage.counted, "p95"), _n(stage.counted)))
        times.append(("with its transfer", _time(stage.whole, "median"), _time(stage.whole, "p95"), _n(stage.whole)))
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
                ("residual of theta", _drift(facts)),
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


def _time(times: dict[str, float] | None, which: str) -> str:
    return "-" if times is None else f"{times[which]:.2f}"


def _n(times: dict[str, float] | None) -> str:
    return "0" if times is None else str(int(times["n"]))


def _forces(facts: Facts) -> str:
    found = spread(facts.forces)
    if found is None:
        return "not on record"
    return f"median {found['median']:.1f} N, p95 {found['p95']:.1f} N, most {max(facts.forces):.1f} N"


def _drift(facts: Facts) -> str:
    drift = facts.drift
    if drift is None:
        return f"{len(facts.residuals)} on record, too few for a trend"
    verdict = "rises: look at the pads" if drift.is_shown else "does not rise beyond chance"
    return f"{verdict}; {drift.per_day:+.4f} a day ({drift.low:+.4f} to {drift.high:+.4f}, n = {drift.n})"
