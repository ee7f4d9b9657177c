"""Yield, times, reasons, forces and the drift of the pads over many runs; pure."""

import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from cell.journal_schema import RunTold, StageTold
from cell.statistics import Z95, spread, wilson
from drivers.errors import FAULTS, FaultCode
from skills.catalogue import CATALOGUE, GRASP

LEAST_DRIFT = 10
"""Least number of runs from which a drift is computed."""
DAY = 86400.0


@dataclass(frozen=True, slots=True)
class Yield:
    """Share of the ended runs that succeeded, with its 95 % interval after [wilson]."""

    good: int
    runs: int

    @property
    def share(self) -> float | None:
        """Return the share; None of no runs."""
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
    """Time that the skill counts as its own, as in Table I of [gibbons], s: mean, median and p95 of successful runs."""
    whole: dict[str, float] | None
    """Time with the way to the stage's place, s: mean, median and p95 of successful runs."""


@dataclass(frozen=True, slots=True)
class Loss:
    """One way in which runs did not succeed."""

    what: str
    count: int
    cumulative: float
    """Share of all runs that did not succeed which this and the more frequent ways make up."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Trend of the residual of theta right after the grasp: pads that wear explain less and less of what they read."""

    n: int
    per_day: float
    """Slope of the least-squares line, 1/day."""
    low: float
    high: float
    """Limits of its 95 % interval, 1/day."""

    @property
    def is_shown(self) -> bool:
        """Whether the interval leaves zero out, upward."""
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
    """Time from command to answer, s, of runs that succeeded."""
    insertion: dict[str, float] | None
    """Search, insertion and adjustment together, the total of [gibbons], s, of runs that succeeded."""
    stages: Sequence[StageTimes]
    losses: Sequence[Loss]
    forces: Sequence[float]
    """Largest force of each run, N."""
    residuals: Sequence[tuple[float, float]]
    """Time since the first run, days, and residual of theta right after the grasp, 0 to 1."""
    drift: Drift | None


def facts_of(runs: Sequence[RunTold], stages: Sequence[StageTold], since: str = "") -> Facts:
    """Return what runs, oldest first, and their stages say together."""
    ended = [row for row in runs if row.outcome != "running"]
    good = [row for row in ended if row.outcome == "success"]
    of_good = _by_name(stages, {row.run for row in good})
    residuals = _residuals(ended, stages)
    return Facts(
        since=since,
        first=ended[0].started if ended else "",
        last=ended[-1].started if ended else "",
        outcomes=dict(Counter(row.outcome for row in ended)),
        total=Yield(len(good), len(ended)),
        by_day=_by_day(ended),
        cycle=spread([row.cycle_time for row in good if row.cycle_time is not None]),
        insertion=spread(_insertions(good, of_good)),
        stages=_stage_times(of_good),
        losses=_losses(ended),
        forces=[row.peak_force for row in ended if row.peak_force is not None],
        residuals=residuals,
        drift=drift_of(residuals),
    )


def drift_of(residuals: Sequence[tuple[float, float]]) -> Drift | None:
    """Return the trend of (time in days, residual) pairs; None of too few, or of all at one time."""
    if len(residuals) < LEAST_DRIFT:
        return None
    time, value = np.array(residuals).T
    spent = time - time.mean()
    if not (scatter := float(spent @ spent)):
        return None
    slope = float(spent @ (value - value.mean())) / scatter
    left = value - value.mean() - slope * spent
    error = float(np.sqrt(left @ left / (len(value) - 2) / scatter))
    return Drift(len(value), slope, slope - Z95 * error, slope + Z95 * error)


def _by_name(stages: Sequence[StageTold], runs: set[int]) -> dict[str, list[StageTold]]:
    """Return the stages of some runs by name."""
    found: dict[str, list[StageTold]] = defaultdict(list)
    for stage in stages:
        if stage.run in runs:
            found[stage.name].append(stage)
    return found


def _insertions(good: Sequence[RunTold], stages: Mapping[str, Sequence[StageTold]]) -> list[float]:
    """Return the time that the stages which count took together, s, of each run that has any of them on record."""
    sums: dict[int, float] = defaultdict(float)
    for name in CATALOGUE.counted:
        for stage in stages.get(name, ()):
            if stage.counted is not None:
                sums[stage.run] += stage.counted
    for row in good:
        if row.stage_times and any(name in CATALOGUE.counted for name, _ in json.loads(row.stage_times)):
            sums[row.run] = sum(time for name, time in json.loads(row.stage_times) if name in CATALOGUE.counted)
    return list(sums.values())


def _by_day(ended: Sequence[RunTold]) -> list[tuple[str, Yield]]:
    hours: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for row in ended:
        # No time zone changes its offset but at a full quarter of an hour.
        counts = hours[row.started[: len("2025-01-31T06:0")]]
        counts[0] += row.outcome == "success"
        counts[1] += 1
    days: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for hour, (good, runs) in hours.items():
        day = days[datetime.fromisoformat(f"{hour}0:00+00:00").astimezone().date().isoformat()]
        day[0] += good
        day[1] += runs
    return [(day, Yield(good, runs)) for day, (good, runs) in days.items()]


def _stage_times(stages: Mapping[str, Sequence[StageTold]]) -> list[StageTimes]:
    found = []
    for name in CATALOGUE.stages.values():
        if name in stages:
            counted = [stage.counted for stage in stages[name] if stage.counted is not None]
            whole = [stage.whole for stage in stages[name]]
            found.append(StageTimes(name, len(whole), spread(counted), spread(whole)))
    return found


def _losses(ended: Sequence[RunTold]) -> list[Loss]:
    ways = Counter(_way(row) for row in ended if row.outcome != "success")
    lost, so_far, found = sum(ways.values()), 0, []
    for what, count in sorted(ways.items(), key=lambda way: (-way[1], way[0])):
        so_far += count
        found.append(Loss(what, count, so_far / lost))
    return found


def _way(row: RunTold) -> str:
    if row.fault:
        known = FaultCode(row.fault) if row.fault in set(FaultCode) else None
        return f"fault {row.fault}" + (f": {FAULTS[known].meaning}" if known is not None else "")
    words = (row.reason or row.outcome).replace("_", " ")
    return f"{words} in {row.stage.replace('_', ' ')}" if row.stage else words


def _residuals(ended: Sequence[RunTold], stages: Sequence[StageTold]) -> list[tuple[float, float]]:
    seen = {stage.run: stage.residual for stage in stages if stage.name == GRASP.name and stage.residual is not None}
    known = [row for row in ended if row.run in seen]
    if not known:
        return []
    # Wall times are ISO 8601 in UTC throughout, which numpy reads at once.
    times = np.array([row.started.partition("+")[0] for row in (ended[0], *known)], dtype="datetime64[ms]")
    days = (times[1:] - times[0]) / np.timedelta64(1, "D")
    return list(zip(days.tolist(), (seen[row.run] for row in known), strict=True))
