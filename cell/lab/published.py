"""The published insertions, [gibbons], Table I, and this cell's stages beside them; pure."""

from collections.abc import Sequence
from dataclasses import dataclass

from cell.statistics import mean


@dataclass(frozen=True, slots=True)
class PublishedStage:
    """One row of [gibbons], Table I."""

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
PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL = 38, 40, 54.1


@dataclass(frozen=True, slots=True)
class StageLine:
    """This cell's figures for one stage, a row of the table."""

    name: str
    successes: int
    attempts: int
    time: float | None
    """Mean time of the stage's successes, s; None where there are none."""


@dataclass(frozen=True, slots=True)
class Tried:
    """The part of a trial that the stage table needs."""

    succeeded: bool
    stage: str
    """Skill that was reached last."""
    times: dict[str, float]
    """Time of each of the published stages that was reached, s."""


def stage_table(trials: Sequence[Tried]) -> list[StageLine]:
    """Return attempts, successes and mean time of every published stage, and of the whole, in that order.

    A stage was attempted when it has a time, and succeeded when the trial went on to another stage or succeeded.
    """
    lines = []
    for stage in PUBLISHED:
        tried = [trial for trial in trials if stage.name in trial.times]
        good = [trial.times[stage.name] for trial in tried if trial.succeeded or trial.stage != stage.name]
        lines.append(StageLine(stage.name, len(good), len(tried), mean(good)))
    totals = [sum(trial.times.values()) for trial in trials if trial.succeeded]
    return [*lines, StageLine("total", len(totals), len(trials), mean(totals))]
