"""Published insertions, [gibbons], Table I, and the same stages of this cell; without side effects."""

from collections.abc import Sequence
from dataclasses import dataclass

from cell.records.statistics import mean


@dataclass(frozen=True, slots=True)
class PublishedStage:
    """One row of [gibbons], Table I, or the total of its rows."""

    name: str
    label: str
    successes: int
    attempts: int
    time: float
    """Mean time, s."""


PUBLISHED: tuple[PublishedStage, ...] = (
    PublishedStage("spray_search", "search", 39, 40, 19.9),
    PublishedStage("tactile_insert", "insertion", 38, 39, 24.1),
    PublishedStage("spiral_adjust", "adjustment", 38, 38, 10.1),
)
PUBLISHED_TOTAL = PublishedStage("total", "total", 38, 40, 54.1)


@dataclass(frozen=True, slots=True)
class StageLine:
    """Figures of this cell for one stage, a row of the table."""

    name: str
    successes: int
    attempts: int
    time: float | None
    """Mean time of the stage's successes, s; None if there are none."""


@dataclass(frozen=True, slots=True)
class Tried:
    """Data of one trial for the stage table."""

    succeeded: bool
    stage: str
    """Last skill reached."""
    times: dict[str, float]
    """Time of each published stage that was reached, s."""


def stage_table(trials: Sequence[Tried]) -> list[StageLine]:
    """Return attempts, successes and mean time of every published stage and of the whole, in that order.

    A stage with a time is an attempt. It succeeded if the trial continued to another stage or succeeded.
    """
    lines = []
    for stage in PUBLISHED:
        tried = [trial for trial in trials if stage.name in trial.times]
        good = [trial.times[stage.name] for trial in tried if trial.succeeded or trial.stage != stage.name]
        lines.append(StageLine(stage.name, len(good), len(tried), mean(good)))
    totals = [sum(trial.times.values()) for trial in trials if trial.succeeded]
    return [*lines, StageLine("total", len(totals), len(trials), mean(totals))]
