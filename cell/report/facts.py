"""Yield, times, reasons, forces, trends and the drift of the pads over many runs, counted by the index of the journal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.records import wall_clock
from cell.records.journal import Journal
from cell.records.run_query import RunQuery
from cell.records.statistics import Z95, spread, wilson
from cell.report import queries
from drivers.errors import FAULTS, FaultCode
from drivers.quantities import Vector
from skills.catalogue import CATALOGUE
from skills.contract import Outcome

LEAST_DRIFT = 10
"""Least number of runs for the computation of a drift."""
WORN = 0.3
"""Residual of theta at which the pads must be changed, fraction; above it `robust` trusts a frame only within its noise."""


@dataclass(frozen=True, slots=True)
class Yield:
    """Share of successful runs among the ended ones, with its 95 % interval after [wilson]."""

    good: int
    runs: int

    @property
    def share(self) -> float | None:
        """Return the share; None without runs."""
        return self.good / self.runs if self.runs else None

    @property
    def interval(self) -> tuple[float, float]:
        """Return the limits of the interval."""
        return wilson(self.good, self.runs)


@dataclass(frozen=True, slots=True)
class StageTimes:
    """Times of one stage over all runs that reached it, all tries of a run together."""

    name: str
    n: int
    counted: dict[str, float] | None
    """Time counted by the skill, as in Table I of [gibbons], s: mean, median and p95 of successful runs."""
    whole: dict[str, float] | None
    """Time with the transfer to the stage's place, s: mean, median and p95 of successful runs."""


@dataclass(frozen=True, slots=True)
class Loss:
    """One kind of run without success."""

    what: str
    count: int
    minutes: float
    """Time from the starts of these runs to the starts of the next ones, at most `queries.LONGEST_STOP` each, min."""
    cumulative: float
    """Share of the lost time that this kind and all more expensive kinds cost together, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Trend of the residual of theta right after the grasp; it grows as the pads wear."""

    n: int
    present: float
    """Residual of the line at the last run, fraction."""
    per_day: float
    """Slope of the least-squares line, 1/day."""
    low: float
    high: float
    """Limits of its 95 % interval, 1/day."""

    @property
    def is_shown(self) -> bool:
        """True if the whole interval is above zero."""
        return self.low > 0.0

    @property
    def days_left(self) -> float | None:
        """Return the days until the line reaches `WORN`; None if it does not rise."""
        return max(WORN - self.present, 0.0) / self.per_day if self.is_shown else None


@dataclass(frozen=True, slots=True)
class Shift:
    """One shift with at least one run."""

    start: str
    """Date and time of its start, local time."""
    runs: Yield
    minutes: float
    """Time lost by runs without success, min, as in `Loss`."""
    availability: float | None
    """Share of the shift, from the first run of the report on, in which the cell needed no reset after an abort or fault."""


@dataclass(frozen=True, slots=True)
class Trend:
    """Means of a time by shift, with their limits."""

    name: str
    """Stage, or `queries.CYCLE`; the times of stages are those with transfers."""
    means: Mapping[str, float]
    """Mean of successful runs, s, by the start of the shift."""
    limits: tuple[float, float] | None
    """Limits within which a shift's mean differs from the others only by chance, s; None if there are too few shifts."""

    def is_beyond(self, shift: str) -> bool:
        """Return True if the mean of a shift is outside the limits."""
        return self.limits is not None and not self.limits[0] <= self.means[shift] <= self.limits[1]


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of a report."""

    since: str
    until: str
    """Limits of the starts, wall time, ISO 8601 UTC; empty for none."""
    first: str
    last: str
    """Starts of the first and the last run, wall time, ISO 8601 UTC."""
    outcomes: Mapping[str, int]
    total: Yield
    shifts: Sequence[Shift]
    trends: Sequence[Trend]
    """Cycle and stages by shift."""
    cycle: dict[str, float] | None
    """Time from command to answer, s, of successful runs."""
    insertion: dict[str, float] | None
    """Total time of search, insertion and adjustment as in [gibbons], s, of successful runs."""
    stages: Sequence[StageTimes]
    losses: Sequence[Loss]
    forces: Sequence[float]
    """Largest force of each run, N."""
    residuals: Sequence[tuple[float, float]]
    """Time since the first run, days, and residual of theta right after the grasp, 0 to 1."""
    drift: Drift | None


def facts_of(journal: Journal, query: RunQuery, starts: Sequence[str] = queries.SHIFTS) -> Facts:
    """Return the facts of the ended runs that a query selects; `starts` are the times at which shifts start, `HH:MM`, local time."""
    ends = min(query.until or wall_clock.now_text(), wall_clock.now_text())
    for statement, values in queries.prepared(query, starts, ends):
        journal.ask(statement, values)
    totals = journal.ask(queries.TOTALS)
    outcomes = {outcome: count for outcome, count, _, _ in totals}
    residuals = journal.ask(queries.RESIDUALS)
    return Facts(
        since=query.since,
        until=query.until,
        first=min((first for _, _, first, _ in totals), default=""),
        last=max((last for _, _, _, last in totals), default=""),
        outcomes=outcomes,
        total=Yield(outcomes.get(Outcome.SUCCESS, 0), sum(outcomes.values())),
        shifts=[
            Shift(start, Yield(good, runs), minutes, share)
            for start, good, runs, minutes, share in journal.ask(queries.by_shift(starts), [ends])
        ],
        trends=_trends(journal),
        cycle=spread(_column(journal.ask(queries.CYCLES))),
        insertion=spread(_column(journal.ask(queries.INSERTIONS))),
        stages=_stage_times(journal),
        losses=_losses(journal),
        forces=_column(journal.ask(queries.FORCES)),
        residuals=residuals,
        drift=drift_of(*np.array(residuals).reshape(-1, 2).T),
    )


def drift_of(time: Vector, value: Vector) -> Drift | None:
    """Return the trend of the residuals `value` over `time`, days; None if there are too few runs, or all have the same time."""
    if len(time) < LEAST_DRIFT:
        return None
    spent = time - time.mean()
    if not (scatter := float(spent @ spent)):
        return None
    slope = float(spent @ (value - value.mean())) / scatter
    left = value - value.mean() - slope * spent
    error = float(np.sqrt(left @ left / (len(value) - 2) / scatter))
    present = float(value.mean() + slope * spent.max())
    return Drift(len(value), present, slope, slope - Z95 * error, slope + Z95 * error)


def _column(rows: Sequence[tuple[float, ...]]) -> list[float]:
    return [value for (value,) in rows]


def _trends(journal: Journal) -> list[Trend]:
    limits = {name: (low, high) for name, low, high in journal.ask(queries.LIMITS)}
    means: dict[str, dict[str, float]] = {}
    for shift, name, mean in journal.ask(queries.MEANS):
        means.setdefault(name, {})[shift] = mean
    names = [name for name in (queries.CYCLE, *CATALOGUE.stages.values()) if name in means]
    return [Trend(name, means[name], limits.get(name)) for name in names]


def _stage_times(journal: Journal) -> list[StageTimes]:
    found = []
    for name in CATALOGUE.stages.values():
        if rows := journal.ask(queries.STAGE.format(name=name)):
            counted = [time for time, _ in rows if time is not None]
            found.append(StageTimes(name, len(rows), spread(counted), spread([whole for _, whole in rows])))
    return found


def _losses(journal: Journal) -> list[Loss]:
    """Return the kinds of runs without success, the most expensive in time first."""
    rows = journal.ask(queries.LOSSES)
    whole, so_far, found = sum(minutes for *_, minutes in rows), 0.0, []
    for fault, stage, reason, count, minutes in rows:
        so_far += minutes
        found.append(Loss(_way(fault, stage, reason), count, minutes, so_far / whole if whole else 1.0))
    return found


def _way(fault: int, stage: str, reason: str) -> str:
    if fault:
        known = FaultCode(fault) if fault in set(FaultCode) else None
        return f"fault {fault}" + (f": {FAULTS[known].meaning}" if known is not None else "")
    return (f"{reason} in {stage}" if stage else reason).replace("_", " ")
