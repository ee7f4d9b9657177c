"""Yield, times, reasons, forces and the drift of the pads over many runs; pure."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from cell.records.statistics import Z95, spread, wilson
from cell.records.told import Kind, Told
from cell.report.figures import Figures, unpacked
from drivers.errors import FAULTS, FaultCode
from drivers.quantities import Vector
from skills.catalogue import CATALOGUE, GRASP
from skills.contract import Outcome

LEAST_DRIFT = 10
"""Least number of runs for the computation of a drift."""
DAY, QUARTER = 86400.0, 900.0
"""Length of a day and of a quarter of an hour, s."""
LONGEST_STOP = 3600.0
"""Longest time between two starts that counts as lost to the first run, s; a longer one is a break of the line."""


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
    """Time from the starts of these runs to the starts of the next ones, at most `LONGEST_STOP` each, min."""
    cumulative: float
    """Share of this kind and all kinds that cost more time in the lost time."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Trend of the residual of theta right after the grasp; it grows as the pads wear."""

    n: int
    per_day: float
    """Slope of the least-squares line, 1/day."""
    low: float
    high: float
    """Limits of its 95 % interval, 1/day."""

    @property
    def is_shown(self) -> bool:
        """True if the whole interval is above zero."""
        return self.low > 0.0


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of a report."""

    since: str
    """Earliest wall time, ISO 8601 UTC; empty for all records."""
    first: str
    last: str
    """Starts of the first and the last run, wall time, ISO 8601 UTC."""
    outcomes: Mapping[str, int]
    total: Yield
    by_day: Sequence[tuple[str, Yield]]
    """Date in local time and its yield."""
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


def facts_of(told: Told, since: str = "") -> Facts:
    """Return the facts of the ended runs."""
    figures = unpacked(told)
    is_good, started = figures.is_good, figures.of_run["started"]
    time, residual = _residuals(figures)
    outcomes: Counter[str] = Counter()
    for kind, places in figures.kinds:
        outcomes[kind.outcome] += len(places)
    return Facts(
        since=since,
        first=_moment(started[:1]),
        last=_moment(started[-1:]),
        outcomes=dict(outcomes),
        total=Yield(int(is_good.sum()), len(is_good)),
        by_day=_by_day(figures),
        cycle=spread(_known(figures.of_run["cycle_time"][is_good])),
        insertion=spread(_insertions(figures)),
        stages=_stage_times(figures),
        losses=_losses(figures),
        forces=_known(figures.of_run["peak_force"]).tolist(),
        residuals=list(zip(time.tolist(), residual.tolist(), strict=True)),
        drift=drift_of(time, residual),
    )


def drift_of(time: Vector, value: Vector) -> Drift | None:
    """Return the trend of residuals at times in days; None if there are too few runs, or all have the same time."""
    if len(time) < LEAST_DRIFT:
        return None
    spent = time - time.mean()
    if not (scatter := float(spent @ spent)):
        return None
    slope = float(spent @ (value - value.mean())) / scatter
    left = value - value.mean() - slope * spent
    error = float(np.sqrt(left @ left / (len(value) - 2) / scatter))
    return Drift(len(value), slope, slope - Z95 * error, slope + Z95 * error)


def _known(values: Vector) -> Vector:
    """Return the values without NaN."""
    return values[~np.isnan(values)]


def _moment(seconds: Vector) -> str:
    """Return a wall time of the records as text; empty without times."""
    known = _known(seconds).tolist()
    return datetime.fromtimestamp(known[0], UTC).isoformat(timespec="milliseconds") if known else ""


def _insertions(figures: Figures) -> Vector:
    """Return the total time of the counted stages, s, of each successful run with any of them on record."""
    counted = [figures.of_stage[name]["counted"] for name in CATALOGUE.counted if name in figures.of_stage]
    if not counted:
        return np.empty(0)
    times = np.array(counted)[:, figures.is_good]
    is_known = ~np.isnan(times).all(axis=0)
    sums: Vector = np.nansum(times, axis=0)[is_known]
    return sums


def _by_day(figures: Figures) -> list[tuple[str, Yield]]:
    # Every time zone changes its offset at a full quarter of an hour.
    started = figures.of_run["started"]
    quarters, place = np.unique(np.floor(_known(started) / QUARTER).astype(int), return_inverse=True)
    good = np.bincount(place, figures.is_good[~np.isnan(started)], len(quarters)).astype(int)
    days: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for quarter, *counts in zip(quarters.tolist(), good.tolist(), np.bincount(place).tolist(), strict=True):
        day = days[datetime.fromtimestamp(QUARTER * quarter).astimezone().date().isoformat()]
        day[0] += counts[0]
        day[1] += counts[1]
    return [(day, Yield(good, runs)) for day, (good, runs) in days.items()]


def _stage_times(figures: Figures) -> list[StageTimes]:
    found = []
    for name in CATALOGUE.stages.values():
        # Journals of layout 1 hold only the times counted by skills, which are used only for the insertion time.
        of_stage = figures.of_stage.get(name)
        if of_stage is not None and (is_known := figures.is_good & ~np.isnan(of_stage["whole"])).any():
            counted, whole = (_known(of_stage[which][is_known]) for which in ("counted", "whole"))
            found.append(StageTimes(name, len(whole), spread(counted), spread(whole)))
    return found


def _losses(figures: Figures) -> list[Loss]:
    """Return the kinds of runs without success, the most expensive in time first."""
    lost = _lost(figures)
    ways: dict[str, list[float]] = defaultdict(list)
    for kind, places in figures.kinds:
        if kind.outcome != Outcome.SUCCESS:
            ways[_way(kind)] += lost[np.array(places)].tolist()
    whole, so_far, found = sum(map(sum, ways.values())), 0.0, []
    for what, times in sorted(ways.items(), key=lambda way: (-sum(way[1]), way[0])):
        so_far += sum(times)
        found.append(Loss(what, len(times), sum(times) / 60.0, so_far / whole if whole else 1.0))
    return found


def _lost(figures: Figures) -> Vector:
    """Return the time from the start of each run to the start of the next, or to its own end if it is the last, s."""
    started, cycle = figures.of_run["started"], np.nan_to_num(figures.of_run["cycle_time"])
    after = np.append(started[1:], np.nan) - started
    return np.clip(np.where(np.isnan(after), cycle, after), 0.0, LONGEST_STOP)


def _way(kind: Kind) -> str:
    if kind.fault:
        known = FaultCode(kind.fault) if kind.fault in set(FaultCode) else None
        return f"fault {kind.fault}" + (f": {FAULTS[known].meaning}" if known is not None else "")
    words = (kind.reason or kind.outcome).replace("_", " ")
    return f"{words} in {kind.stage.replace('_', ' ')}" if kind.stage else words


def _residuals(figures: Figures) -> tuple[Vector, Vector]:
    """Return the time since the first run, days, and the residual of theta right after the grasp, of runs with a residual."""
    if GRASP.name not in figures.of_stage:
        return np.empty(0), np.empty(0)
    started, values = figures.of_run["started"], figures.of_stage[GRASP.name]["residual"]
    is_known = ~np.isnan(values) & ~np.isnan(started)
    return (started[is_known] - np.nanmin(started)) / DAY, values[is_known]
