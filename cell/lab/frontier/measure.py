"""The frontier of speed against accuracy: one point a variant of the cell, all on the same seeds."""

import json
import logging
import math
import platform
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cell.assembly import make_tracker
from cell.cell_config import CellConfig
from cell.config import load
from cell.lab.rows import quantile, write_rows
from cell.lab.trials import SUMMARY, TABLE, VOID, MakeTracker, TrialRow, read_table, run_trials
from cell.provenance import config_hash, versions
from cell.statistics import Z95, RateTest, Verdict, mean, wilson
from drivers.errors import CellError, FaultCode
from sim.metering import OVER_FORCE
from skills.contract import Outcome

logger = logging.getLogger(__name__)

FRONTIER = "frontier.csv"
TITLE = "title.txt"
"""File of the words under which the charts are drawn: trials, seeds, errors and versions."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One variant of the cell."""

    family: str
    """Group of variants that are compared: the presets, what is swept, or the steps of a chain."""
    name: str
    preset: str | None
    """Preset that replaces the config's own; None keeps that."""
    sets: tuple[str, ...]
    """Single keys, `KEY=VALUE`, laid over the preset."""
    tracker: MakeTracker = make_tracker
    """Function that makes the tracker of theta."""


@dataclass(frozen=True, slots=True)
class FrontierLine:
    """Result of one variant; times are of its successes, s, and NaN where there are none."""

    family: str
    variant: str
    preset: str
    sets: str
    """Keys that differ from the preset, parted by blanks."""
    folder: str
    """Folder of its trials; variants with the same config share it."""
    is_base: bool
    """Whether the config is the one that every variant starts from."""
    trials: int
    successes: int
    low: float
    """Lower end of the Wilson 95 % interval of the success rate."""
    high: float
    mean: float
    """Mean of the total time, search + insertion + adjustment, s."""
    mean_error: float
    """Half width of the mean's 95 % interval, normal, s; NaN below two successes."""
    median: float
    p95: float
    search: float
    """Mean time of the search, s; the next fields are those of the other stages."""
    insert: float
    adjust: float
    force_median: float
    """Median over all trials of the largest contact force, N."""
    force_p95: float
    within: int
    """Number of trials whose largest contact force is at most `OVER_FORCE`."""
    over_longest: float
    """Longest time of a trial above that force, s."""
    jerk_free: float
    """95th percentile of the trials' largest jerk in free space, m/s³; the next field is that elsewhere."""
    jerk_contact: float
    voids: int
    faults: int
    """Number of trials that a fault ended; they count as not successful."""
    retries: int
    """Number of retries in all trials together."""
    endings: str
    """Endings other than success, with their counts."""
    error: str
    """Reason why the variant could not be run; empty when it could."""
    verdict: str = ""
    """Answer of the sequential test that ended the trials; empty where every seed was run."""


def load_variant(path: Path | None, preset: str | None, sets: Sequence[str]) -> CellConfig:
    """Return the cell of a file, a preset and single keys, at its fastest pace.

    Raises:
        ConfigError: One of them cannot be used.
    """
    return load(path, preset, [*sets, "sim.pace=max"]).cell


def title_of(seeds: range, of_each: str = "") -> str:
    """Return trials, seeds and versions in the words of charts and table.

    Args:
        seeds: Seeds, one trial each.
        of_each: Number of trials of a variant, in words; empty where every seed was run.
    """
    return (
        f"{of_each or len(seeds)} trials a variant, simulated, seeds {seeds[0]} to {seeds[-1]}; python {platform.python_version()}, "
        + ", ".join(f"{name} {versions()[name]}" for name in ("mujoco", "numpy", "code"))
    )


def measure(
    path: Path | None,
    sets: Sequence[str],
    tried: Sequence[Variant],
    seeds: Sequence[int],
    workers: int,
    folder: Path,
    done: Callable[[int], None],
    tests: Mapping[str, RateTest] | None = None,
    scheduler: str | None = None,
) -> list[FrontierLine]:
    """Run every variant on the same seeds and write frontier.csv; finished trials in the folder are taken up.

    A variant that cannot be run has its error in its line, and the others go on.

    Args:
        path: TOML file of the cell, see `variants`.
        sets: Keys of all variants.
        tried: Variants to run.
        seeds: Seeds, one trial each, for every variant.
        workers: Number of processes.
        folder: Folder of the variants' folders.
        done: Called with the number of further trials done, or saved by a test.
        tests: Test by family that ends a variant's trials; a family without one runs every seed.
        scheduler: Address of a Dask scheduler whose workers shall run the trials instead.

    Raises:
        ConfigError: The config that every variant starts from cannot be used.
    """
    base = _fingerprint(load_variant(path, None, sets))
    ran: dict[str, tuple[str, list[TrialRow], str, RateTest | None]] = {}
    lines: list[FrontierLine] = []
    for variant in tried:
        rows: list[TrialRow] = []
        place, trouble, mark, verdict = "", "", "", ""
        try:
            config = load_variant(path, variant.preset, [*sets, *variant.sets])
        except CellError as error:
            trouble = str(error)
            done(len(seeds))
        else:
            mark = _fingerprint(config, variant.tracker)
            if mark not in ran:
                place = re.sub(r"\W+", "-", f"{variant.family} {variant.name}").strip("-")
                test = tests.get(variant.family) if tests else None
                task = Task(config, seeds, test, folder / place, workers, scheduler, variant.tracker)
                ran[mark] = (place, *_run(task, done), test)
            else:
                done(len(seeds))
            place, rows, trouble, test = ran[mark]
            verdict = answer(test, rows) if test is not None and rows else ""
        lines.append(replace(_line(variant, place, rows, trouble, is_base=mark == base), verdict=verdict))
        write_rows(lines, folder / FRONTIER)
    return lines


def _fingerprint(config: CellConfig, tracker: MakeTracker = make_tracker) -> str:
    """Return a text that is the same for configs with the same values, whatever their origin, and the same tracker."""
    return f"{config_hash(config.model_copy(update={'preset': '', 'world': ''}))} {tracker.__name__}"


@dataclass(frozen=True, slots=True)
class Task:
    """The trials of one variant: what is run, where, and when it is enough."""

    config: CellConfig
    seeds: Sequence[int]
    test: RateTest | None
    """Test that ends the trials before the last seed; None runs every seed."""
    folder: Path
    workers: int
    scheduler: str | None
    tracker: MakeTracker

    def is_enough(self, rows: Sequence[TrialRow]) -> bool:
        """Return whether the rows of the first seeds answer the question, or are all that may be run."""
        answered = self.test is not None and answer(self.test, rows) is not Verdict.OPEN
        return answered or len(rows) == len(self.seeds)


def answer(test: RateTest, rows: Sequence[TrialRow]) -> Verdict:
    """Return what a test says of trials; whatever is not a success is lost."""
    return test.verdict(sum(row.outcome != Outcome.SUCCESS for row in rows), len(rows))


def _run(task: Task, done: Callable[[int], None]) -> tuple[list[TrialRow], str]:
    rows, trouble, told = _finished(task), "", 0

    def advance(row: TrialRow) -> None:
        nonlocal told
        told += 1
        done(1)

    try:
        if not rows:
            rows = run_trials(
                task.config,
                task.seeds,
                task.workers,
                task.folder,
                advance,
                task.scheduler,
                task.is_enough,
                task.tracker,
            )
    except Exception as error:  # whatever it is, the other variants are worth having
        logger.exception("%s", task.folder)
        trouble = " ".join(f"{type(error).__name__}: {error}".split())
    done(len(task.seeds) - told)
    return rows, trouble


def _finished(task: Task) -> list[TrialRow]:
    """Return the rows of an earlier call with the same config, seeds, test and versions, or none."""
    try:
        summary = json.loads((task.folder / SUMMARY).read_text(encoding="utf-8"))
        rows = read_table(task.folder / TABLE)
    except (OSError, ValueError, KeyError):
        return []
    same = (config_hash(task.config), {"python": platform.python_version(), **versions()})
    is_same = (summary.get("config_hash"), summary.get("versions")) == same
    is_first = [row.seed for row in rows] == sorted(task.seeds)[: len(rows)]
    enough = (count for count in range(1, len(rows) + 1) if task.is_enough(rows[:count]))
    return rows if is_same and is_first and next(enough, 0) == len(rows) else []


def _line(variant: Variant, place: str, rows: Sequence[TrialRow], trouble: str, is_base: bool) -> FrontierLine:
    good = [row for row in rows if row.outcome == Outcome.SUCCESS]
    totals = np.array([row.total_time for row in good], dtype=float)
    forces = np.array([row.peak_contact_force for row in rows])
    low, high = wilson(len(good), len(rows))
    faults = {code.name.lower() for code in FaultCode}
    endings = Counter(
        " ".join(filter(None, (row.outcome, row.stage, row.reason))) for row in rows if row.outcome != Outcome.SUCCESS
    )

    def stage(name: str) -> float:
        value = mean(value for row in good if (value := getattr(row, name)) is not None)
        return math.nan if value is None else value

    return FrontierLine(
        family=variant.family,
        variant=variant.name,
        preset=variant.preset or "",
        sets=" ".join(variant.sets),
        folder=place,
        is_base=is_base,
        trials=len(rows),
        successes=len(good),
        low=low,
        high=high,
        mean=float(totals.mean()) if len(good) else math.nan,
        mean_error=Z95 * float(totals.std(ddof=1)) / math.sqrt(len(good)) if len(good) > 1 else math.nan,
        median=quantile(totals, 0.5),
        p95=quantile(totals, 0.95),
        search=stage("search_time"),
        insert=stage("insert_time"),
        adjust=stage("adjust_time"),
        force_median=quantile(forces, 0.5),
        force_p95=quantile(forces, 0.95),
        within=int(np.count_nonzero(forces <= OVER_FORCE)),
        over_longest=max((row.time_over_20N for row in rows), default=math.nan),
        jerk_free=quantile([row.jerk_free for row in rows], 0.95),
        jerk_contact=quantile([row.jerk_contact for row in rows], 0.95),
        voids=sum(row.outcome == VOID for row in rows),
        faults=sum(row.reason in faults for row in rows),
        retries=sum(row.retries for row in rows),
        endings=", ".join(f"{count} x {text}" for text, count in endings.most_common()),
        error=trouble,
    )
