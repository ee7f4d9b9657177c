"""The fit of the figures that [gibbons] does not print: candidates, their misfit to Table I, and which of them fit.

The procedure is fixed beforehand. Candidate 0 is the preset `paper`, candidate 1 has figures found by hand, and the others are
drawn evenly from the logarithms between the bounds below, from a seed of their own. All run on the same first half of the seeds.
The one with the least misfit there, and those that fit nearly as well, run on the other half, and only that is reported.
"""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.lab.frontier.measure import FrontierLine, Variant
from cell.lab.published import PUBLISHED, StageLine, stage_table
from cell.lab.trials import TABLE as ROWS
from cell.lab.trials import read_table

TABLE = "paper.csv"
FIT, JUDGE = "fit", "judge"
"""Families of the trials of the first and of the second half of the seeds."""
PRESET = "paper"
CANDIDATES_SEED = 1
"""Seed of the drawn candidates; the trials have their own."""
NEARLY = 1.25
"""Candidates whose misfit is at most so many times the least fit nearly as well."""
JUDGED = 3
"""Largest number of candidates that are judged on the other half."""
TIME_ERROR = math.log(1.2)
"""Deviation of the logarithm of a stage's time that counts as one: 20 %."""
WORST = 5.0
"""Largest deviation that counts for a figure; one of a stage that no trial reached is never better than one that was."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """One figure that [gibbons] does not print."""

    key: str
    low: float
    high: float
    by_hand: float
    """Figure found by hand, from which the search begins."""
    bounds: str
    """Reason for the bounds."""


UNKNOWNS: tuple[Unknown, ...] = (
    Unknown("search.speed", 0.03, 0.15, 0.06, "published time over the area at passes of about a hole's width"),
    Unknown("search.pitch", 0.6, 1.6, 1.4, "half a peg to the width over which a leaning peg falls in"),
    Unknown("search.push_stiffness", 400.0, 1500.0, 1500.0, "4 to 15 N at the shipped offset of 10 mm"),
    Unknown("search.event.threshold", 0.08, 0.3, 0.12, "[gibbons] has 15 % as an example of a drop"),
    Unknown("insert.gains.rotation", 1.0, 40.0, 1.5, "a slow to a stiff hand"),
    Unknown("insert.integral_gain", 0.05, 5.0, 0.09, "a minute to a tenth of a second to make up for friction"),
    Unknown("adjust.gains.rotation", 5.0, 40.0, 8.0, "a slow to a stiff hand"),
    Unknown("grip.friction", 0.3, 1.0, 0.8, "rubber on metal, greased to tacky"),
    Unknown("contact.friction", 0.1, 0.4, 0.2, "metal on metal, greased to dry"),
    Unknown(
        "skin.noise",
        0.003,
        0.015,
        0.003,
        "[cyskin], 0.3 to 4 % of a touch; larger noise than the shipped hides every event",
    ),
)
"""Figures that are searched. Joint friction, gravity and the like are drawn for each trial by `reality.scale=1`."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One set of figures and its success on one half of the seeds."""

    name: str
    half: str
    figures: Mapping[str, float]
    """Figures by key; empty for the preset."""
    stages: Sequence[StageLine]
    """Search, insertion, adjustment and total."""
    misfit: float
    """Root mean square of the deviations from Table I; NaN where nothing could be run."""
    error: str
    """Reason why it could not be run; empty when it could."""


def figures(count: int) -> list[dict[str, float]]:
    """Return the figures of so many candidates, by key: the preset's own (none), those found by hand, and drawn ones."""
    rng = np.random.default_rng(CANDIDATES_SEED)
    found = [{}, {unknown.key: unknown.by_hand for unknown in UNKNOWNS}]
    while len(found) < count:
        drawn = {u.key: math.exp(rng.uniform(math.log(u.low), math.log(u.high))) for u in UNKNOWNS}
        found.append({key: float(f"{value:.3g}") for key, value in drawn.items()})
    return found[:count]


def variant(number: int, half: str, chosen: Mapping[str, float]) -> Variant:
    """Return a candidate as a variant of the preset under honest errors."""
    sets = ("reality.scale=1", *(f"{key}={value:g}" for key, value in chosen.items()))
    return Variant(half, f"{number:03d}", PRESET, sets)


def judge(line: FrontierLine, chosen: Mapping[str, float], folder: Path) -> Candidate:
    """Return a candidate from the trials of its variant, which are in `folder`."""
    rows = read_table(folder / line.folder / ROWS) if line.trials else []
    stages = stage_table([row.tried() for row in rows])
    return Candidate(line.variant, line.family, chosen, stages, misfit(stages) if rows else math.nan, line.error)


def misfit(stages: Sequence[StageLine]) -> float:
    """Return the root mean square of six deviations: of each stage's success in standard deviations of the difference of two
    proportions, and of the logarithm of its mean time in steps of 20 %; none counts for more than `WORST`.
    """
    squares = []
    for stage, published in zip(stages, PUBLISHED, strict=False):
        if not stage.attempts:
            squares += [WORST**2] * 2
            continue
        # Agresti's addition keeps a rate of 1 from having no spread.
        rate = (published.successes + 1) / (published.attempts + 2)
        spread = math.sqrt(rate * (1.0 - rate) * (1.0 / stage.attempts + 1.0 / published.attempts))
        lost = (stage.successes / stage.attempts - published.successes / published.attempts) / spread
        late = math.log(stage.time / published.time) / TIME_ERROR if stage.time else WORST
        squares += [min(abs(each), WORST) ** 2 for each in (lost, late)]
    return math.sqrt(sum(squares) / len(squares))


def fitting(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that fit best or nearly as well, the best first; none where nothing could be run."""
    tried = sorted((each for each in candidates if not math.isnan(each.misfit)), key=lambda each: each.misfit)
    return [each for each in tried if each.misfit <= NEARLY * tried[0].misfit]


def write(candidates: Sequence[Candidate], path: Path) -> None:
    """Write a row for every candidate on each half on which it ran."""
    heads = [f"{stage.name}_{what}" for stage in PUBLISHED for what in ("successes", "attempts", "time")]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["candidate", "half", "misfit", *heads, *(unknown.key for unknown in UNKNOWNS), "error"])
        for each in candidates:
            told = [
                value for line in each.stages[: len(PUBLISHED)] for value in (line.successes, line.attempts, line.time)
            ]
            chosen = [each.figures.get(unknown.key) for unknown in UNKNOWNS]
            writer.writerow([each.name, each.half, each.misfit, *told, *chosen, each.error])
