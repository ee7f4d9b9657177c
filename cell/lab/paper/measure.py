"""Fit of the figures that [gibbons] does not print: candidates, their misfit to Table I, and the selection.

The procedure is fixed beforehand. Printed figures stay unchanged. The fit searches the others one stage at a time:
search, insertion, adjustment. Each stage uses the results of the stages before it, and its own seeds. Candidate 0 has
the figures found by hand; a separate seed draws the others uniformly in the logarithm between the bounds in `unknowns`.
All run a few trials that end after their stage. The candidates with the smallest misfit of the stage's two published
figures run more, and the best of these again (successive halving, [jamieson]). The best candidate of the last rung is
kept; those that fit nearly as well give the spread. The kept figures then run once on the other half of the seeds, and
only this result is reported.

A trial is judged as in [gibbons]: the peg is seated if it has pressed the switch under the hole. A false detection of
the hole is a failure of the search.
"""

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cell.lab.frontier.measure import Variant
from cell.lab.paper.unknowns import ADJUST, INSERT, ONE_ARM, SEARCH, UNKNOWNS, by_hand, of_stage
from cell.lab.published import PUBLISHED, PublishedStage, StageLine, Tried, stage_table
from cell.lab.trials import VOID, TrialRow

TABLE = "paper.csv"
JUDGE = "judge"
"""Family of the trials on the other half of the seeds; the first half has the families of the stages."""
PRESET = "paper"
CANDIDATES_SEED = 1
"""Seed of the drawn candidates; the trials have separate seeds."""
NEARLY = 1.25
"""Largest ratio of a misfit to the smallest one at which a candidate fits nearly as well."""
TIME_ERROR = math.log(1.2)
"""Unit of deviation of the logarithm of a stage's time: 20 %."""
WORST = 5.0
"""Upper limit of a figure's deviation; a stage without trials is never better than one with trials."""
NEAR = 8.1e-3
"""Largest distance of the peg's end from the hole's axis for a correct detection, m; the edge in the hole leads the end
by up to 4 mm."""
SEEDS = 33
"""Number of seeds of a stage's round."""
OTHER_HALF = 500
"""Seed offset between the judging and the fit."""

Rungs = Sequence[tuple[int, int]]
"""Number of candidates and of further trials of each, rung by rung."""
RUNGS: Mapping[str, Rungs] = {
    SEARCH: ((4, 8), (2, 8)),
    INSERT: ((8, 8), (3, 16)),
    ADJUST: ((6, 8), (3, 16)),
}
QUICK: Mapping[str, Rungs] = {SEARCH: ((2, 1),), INSERT: ((1, 1),), ADJUST: ((1, 1),)}
ENDED: Mapping[str, tuple[str, ...]] = {
    SEARCH: ("paper.insert.timeout=0.02",),
    INSERT: ("paper.adjust.timeout=0.02",),
    ADJUST: (),
}
"""Keys that end a trial after its stage."""

Run = Callable[[Sequence[Variant], Sequence[int]], Sequence[tuple[Sequence[TrialRow], str]]]
"""Function that runs variants on seeds; returns for each its rows, and the reason if it did not run."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One set of figures and the result of its trials."""

    name: str
    half: str
    """Stage of the round in which it was tested, or `JUDGE`."""
    figures: Mapping[str, float]
    """Figures by key."""
    stages: Sequence[StageLine]
    """Search, insertion, adjustment and total."""
    misfit: float
    """Root mean square of the deviations from Table I, of its stage or of all three; NaN if nothing ran."""
    error: str
    """Reason why it did not run; empty if it ran."""
    rung: int = 0
    """Number of its last rung."""
    rows: Sequence[TrialRow] = field(default=(), repr=False)


def tried(row: TrialRow) -> Tried:
    """Return a trial judged as in [gibbons]: by the switch; a false detection is a failure of the search."""
    times = row.tried().times
    if row.found_error is not None and row.found_error > NEAR:
        return Tried(False, SEARCH, {SEARCH: times[SEARCH]} if SEARCH in times else {})
    return Tried(row.switch_closed and row.outcome != VOID, row.stage, times)


def drawn(stage: str, count: int) -> list[dict[str, float]]:
    """Return this number of candidates of a stage's round, by key: the figures found by hand, and drawn ones."""
    rng = np.random.default_rng([CANDIDATES_SEED, [each.name for each in PUBLISHED].index(stage)])
    unknowns = of_stage(stage)
    found = [{each.key: each.by_hand for each in unknowns}]
    while len(found) < count:
        values = {each.key: math.exp(rng.uniform(math.log(each.low), math.log(each.high))) for each in unknowns}
        found.append({key: float(f"{value:.3g}") for key, value in values.items()})
    return found[:count]


def variant(name: str, half: str, chosen: Mapping[str, float], ended: Sequence[str] = ()) -> Variant:
    """Return a candidate as a variant of the preset under honest errors."""
    sets = (*ONE_ARM, *(f"{key}={value:g}" for key, value in chosen.items()), *ended)
    return Variant(half, name, PRESET, sets)


def fit(run: Run, first: int, rungs: Mapping[str, Rungs]) -> tuple[dict[str, float], list[Candidate]]:
    """Return the fitted figures, and every candidate.

    Args:
        run: Runs variants.
        first: First seed of the first half.
        rungs: Rungs of each stage's round.
    """
    chosen, found = by_hand(), []
    for number, stage in enumerate(PUBLISHED):
        candidates = [
            Candidate(f"{n:02d}", stage.name, {**chosen, **figures}, [], math.nan, "")
            for n, figures in enumerate(drawn(stage.name, rungs[stage.name][0][0]))
        ]
        candidates = _halved(run, stage, candidates, first + number * SEEDS, rungs[stage.name])
        chosen = dict(candidates[0].figures)
        found += candidates
    return chosen, found


def number(rungs: Mapping[str, Rungs]) -> int:
    """Return the number of trials of a fit."""
    return sum(candidates * trials for each in rungs.values() for candidates, trials in each)


def _halved(
    run: Run, stage: PublishedStage, candidates: Sequence[Candidate], seed: int, rungs: Rungs
) -> list[Candidate]:
    """Return the candidates of one round, the best of the last rung first."""
    alive: list[Candidate] = list(candidates)
    left: list[Candidate] = []
    for rung, (count, trials) in enumerate(rungs):
        alive, out = alive[:count], alive[count:]
        left = out + left
        variants = [variant(f"{each.name} rung {rung}", stage.name, each.figures, ENDED[stage.name]) for each in alive]
        results = run(variants, range(seed, seed + trials))
        seed += trials
        alive = [_joined(each, rows, error, stage, rung) for each, (rows, error) in zip(alive, results, strict=True)]
        alive.sort(key=lambda each: math.inf if math.isnan(each.misfit) else each.misfit)
    return alive + left


def _joined(before: Candidate, rows: Sequence[TrialRow], error: str, stage: PublishedStage, rung: int) -> Candidate:
    """Return a candidate with further trials."""
    rows = [*before.rows, *rows]
    trials = [tried(row) for row in rows]
    stages = stage_table(trials)
    found = misfit(stages, [stage], time_error(trials, stage)) if rows else math.nan
    return replace(before, stages=stages, misfit=found, error=error, rung=rung, rows=rows)


def time_error(trials: Sequence[Tried], stage: PublishedStage) -> float:
    """Return the standard error of a stage's mean time over its successes, as a share of the mean; 0 if there is none."""
    good = [t for t in trials if stage.name in t.times and (t.succeeded or t.stage != stage.name)]
    times = np.array([trial.times[stage.name] for trial in good])
    return float(times.std(ddof=1) / times.mean()) / math.sqrt(len(times)) if len(times) > 1 else 0.0


def judged(name: str, chosen: Mapping[str, float], rows: Sequence[TrialRow], error: str) -> Candidate:
    """Return the kept figures with their trials on the other half of the seeds."""
    stages = stage_table([tried(row) for row in rows])
    return Candidate(name, JUDGE, chosen, stages, misfit(stages) if rows else math.nan, error, 0, rows)


def misfit(stages: Sequence[StageLine], of: Sequence[PublishedStage] = PUBLISHED, time_error: float = 0.0) -> float:
    """Return the root mean square of the deviations of success and time, stage by stage. Success is in standard
    deviations of the difference of two proportions, the logarithm of the mean time in units of 20 %; `WORST` limits
    each.

    Args:
        stages: The stages of the trials.
        of: Published stages to include.
        time_error: Standard error of the mean times, as a share of them; it widens the units, because a few holes can
            all be near.
    """
    squares = []
    for stage, published in zip(stages, PUBLISHED, strict=False):
        if published not in of:
            continue
        if not stage.attempts:
            squares += [WORST**2] * 2
            continue
        # Agresti's correction gives a rate of 1 a nonzero spread.
        rate = (published.successes + 1) / (published.attempts + 2)
        spread = math.sqrt(rate * (1.0 - rate) * (1.0 / stage.attempts + 1.0 / published.attempts))
        lost = (stage.successes / stage.attempts - published.successes / published.attempts) / spread
        late = math.log(stage.time / published.time) / math.hypot(TIME_ERROR, time_error) if stage.time else WORST
        squares += [min(abs(each), WORST) ** 2 for each in (lost, late)]
    return math.sqrt(sum(squares) / len(squares))


def fitting(candidates: Sequence[Candidate], stage: str) -> list[Candidate]:
    """Return the candidates of a stage's last rung that fit best or nearly as well, the best first; none if nothing ran."""
    run = [each for each in candidates if each.half == stage and not math.isnan(each.misfit)]
    last = max((each.rung for each in run), default=0)
    found = sorted((each for each in run if each.rung == last), key=lambda each: each.misfit)
    return [each for each in found if each.misfit <= NEARLY * found[0].misfit]


def write(candidates: Sequence[Candidate], path: Path) -> None:
    """Write one row per candidate."""
    heads = [f"{stage.name}_{what}" for stage in PUBLISHED for what in ("successes", "attempts", "time")]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["candidate", "half", "rung", "trials", "misfit", *heads, *(unknown.key for unknown in UNKNOWNS), "error"]
        )
        for each in candidates:
            told = [
                value for line in each.stages[: len(PUBLISHED)] for value in (line.successes, line.attempts, line.time)
            ] or [None] * len(heads)
            chosen = [each.figures.get(unknown.key) for unknown in UNKNOWNS]
            writer.writerow([each.name, each.half, each.rung, len(each.rows), each.misfit, *told, *chosen, each.error])
