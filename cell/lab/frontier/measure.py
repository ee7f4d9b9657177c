"""Frontier of speed against accuracy: one point per variant of the cell, all on the same seeds."""

import json
import logging
import math
import platform
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.rate_test import RateTest, Verdict
from cell.lab.rows import average, average_error, quantile, successes, write_rows
from cell.lab.trials import (
    SUMMARY,
    TABLE,
    VOID,
    MakeProbe,
    Program,
    TrialRow,
    insert_peg,
    no_probe,
    read_table,
    run_trials,
)
from cell.records.provenance import config_hash, versions
from cell.records.statistics import wilson
from drivers.errors import CellError, FaultCode
from sim.world.metering import OVER_FORCE
from skills.contract import Outcome

logger = logging.getLogger(__name__)

FAULTS = {code.name.lower() for code in FaultCode}
"""Reasons of trials that ended with a fault."""

FRONTIER = "frontier.csv"
TITLE = "title.txt"
"""File with the title of the charts: trials, seeds, errors and versions."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One variant of the cell."""

    family: str
    """Group of variants to compare: the presets, a swept quantity, or the steps of a chain."""
    name: str
    preset: str | None
    """Preset that replaces the config's own; None keeps the config's."""
    sets: tuple[str, ...]
    """Single keys, `KEY=VALUE`, on top of the preset."""
    probe: MakeProbe = no_probe
    """Function that prepares each trial and returns its probe."""
    program: Program = insert_peg
    """Program of its trials."""


@dataclass(frozen=True, slots=True)
class FrontierLine:
    """Result of one variant; times are those of its successes, s, and NaN if there are none."""

    family: str
    variant: str
    preset: str
    sets: str
    """Keys that differ from the preset, separated by spaces."""
    folder: str
    """Folder of its trials, common to variants with the same config."""
    is_base: bool
    """True if the config is the base of all variants."""
    trials: int
    successes: int
    low: float
    """Lower end of the Wilson 95 % interval of the success rate."""
    high: float
    mean: float
    """Mean of the total time, search + insertion + adjustment, s."""
    mean_error: float
    """Half width of the mean's 95 % interval, normal, s; NaN for fewer than two successes."""
    median: float
    p95: float
    search: float
    """Mean time of the search, s; the next fields contain the other stages."""
    insert: float
    adjust: float
    force_median: float
    """Median of the largest contact force over all trials, N."""
    force_p95: float
    within: int
    """Number of trials whose largest contact force is at most `OVER_FORCE`."""
    over_longest: float
    """Longest time of a trial above that force, s."""
    theta: float
    """Median over all trials of the root mean square error of theta, rad."""
    tip: float
    """Median over all trials of the root mean square error of the tip's place, m."""
    jerk_free: float
    """95th percentile of the trials' largest jerk in free space, m/s³; the next field is the jerk elsewhere."""
    jerk_contact: float
    voids: int
    faults: int
    """Number of trials that a fault ended; they are not successful."""
    retries: int
    """Number of retries in all trials together."""
    endings: str
    """Endings other than success, with their counts."""
    error: str
    """Reason why the variant did not run; empty if it ran."""
    turn_median: float = math.nan
    """Median of the peg's largest rotation in the hand over all trials, rad."""
    turn_p95: float = math.nan
    verdict: str = ""
    """Result of the sequential test that ended the trials; empty if every seed ran."""


def load_variant(path: Path | None, preset: str | None, sets: Sequence[str]) -> CellConfig:
    """Return the cell of a file, a preset and single keys, at the fastest pace.

    Raises:
        ConfigError: One of them is invalid.
    """
    return load(path, preset, [*sets, "sim.pace=max"]).cell


def title_of(seeds: range, of_each: str = "") -> str:
    """Return the description of trials, seeds and versions for charts and table.

    Args:
        seeds: Seeds, one trial each.
        of_each: Number of trials of a variant, in words; empty if every seed ran.
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
    """Run every variant on the same seeds and write frontier.csv; finished trials in the folder are reused.

    If a variant does not run, its line contains the error, and the others continue.

    Args:
        path: TOML file of the cell, see `variants`.
        sets: Keys of all variants.
        tried: Variants to run.
        seeds: Seeds, one trial each, for every variant.
        workers: Number of processes.
        folder: Folder of the variants' folders.
        done: Called with the number of further trials completed, or saved by a test.
        tests: Test by family that ends a variant's trials; a family without one runs every seed.
        scheduler: Address of a Dask scheduler whose workers run the trials instead.

    Raises:
        ConfigError: The base config of the variants is invalid.
    """
    base = _fingerprint(load_variant(path, None, sets))
    ran: dict[object, tuple[str, list[TrialRow], str, RateTest | None]] = {}
    lines: list[FrontierLine] = []
    for variant in tried:
        rows: list[TrialRow] = []
        place, trouble, verdict = "", "", ""
        mark: object = None
        try:
            config = load_variant(path, variant.preset, [*sets, *variant.sets])
        except CellError as error:
            trouble = str(error)
            done(len(seeds))
        else:
            mark = _fingerprint(config, variant.probe, variant.program)
            if mark not in ran:
                place = re.sub(r"\W+", "-", f"{variant.family} {variant.name}").strip("-")
                test = tests.get(variant.family) if tests else None
                task = Task(config, seeds, test, folder / place, workers, scheduler, variant.probe, variant.program)
                ran[mark] = (place, *_run(task, done), test)
            else:
                done(len(seeds))
            place, rows, trouble, test = ran[mark]
            verdict = answer(test, rows) if test is not None and rows else ""
        lines.append(replace(_line(variant, place, rows, trouble, is_base=mark == base), verdict=verdict))
        write_rows(lines, folder / FRONTIER)
    return lines


def _fingerprint(config: CellConfig, probe: MakeProbe = no_probe, program: Program = insert_peg) -> object:
    """Return a value that is equal for configs with the same values, whatever their origin, and the same probe and program."""
    return config_hash(config.model_copy(update={"preset": "", "world": ""})), probe, program


@dataclass(frozen=True, slots=True)
class Task:
    """Trials of one variant: config, folder, and stopping test."""

    config: CellConfig
    seeds: Sequence[int]
    test: RateTest | None
    """Test that can end the trials before the last seed; None runs every seed."""
    folder: Path
    workers: int
    scheduler: str | None
    probe: MakeProbe
    program: Program

    def is_enough(self, rows: Sequence[TrialRow]) -> bool:
        """Return True if the rows of the first seeds decide the test, or all seeds have run."""
        answered = self.test is not None and answer(self.test, rows) is not Verdict.OPEN
        return answered or len(rows) == len(self.seeds)


def answer(test: RateTest, rows: Sequence[TrialRow]) -> Verdict:
    """Return the result of a test on trials; every trial except a success is a loss."""
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
                task.probe,
                task.program,
            )
    except Exception as error:  # any error: the results of the other variants are still useful
        logger.exception("%s", task.folder)
        trouble = " ".join(f"{type(error).__name__}: {error}".split())
    done(len(task.seeds) - told)
    return rows, trouble


def _finished(task: Task) -> list[TrialRow]:
    """Return the rows of an earlier call with the same config, seeds, test and versions, or None."""
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
    good = successes(rows)
    totals, forces = _column(good, "total_time"), np.array(_column(rows, "peak_contact_force"))
    turns = _column(rows, "max_in_hand_rotation")
    low, high = wilson(len(good), len(rows))
    endings = Counter(
        " ".join(f"{row.outcome} {row.stage} {row.reason}".split()) for row in rows if row.outcome != Outcome.SUCCESS
    )
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
        mean=average(totals),
        mean_error=average_error(totals),
        median=quantile(totals, 0.5),
        p95=quantile(totals, 0.95),
        search=average(_column(good, "search_time")),
        insert=average(_column(good, "insert_time")),
        adjust=average(_column(good, "adjust_time")),
        force_median=quantile(forces, 0.5),
        force_p95=quantile(forces, 0.95),
        within=int(np.count_nonzero(forces <= OVER_FORCE)),
        over_longest=max(_column(rows, "time_over_20N"), default=math.nan),
        theta=quantile(_column(rows, "theta_rmse"), 0.5),
        tip=quantile(_column(rows, "tip_rmse"), 0.5),
        jerk_free=quantile(_column(rows, "jerk_free"), 0.95),
        jerk_contact=quantile(_column(rows, "jerk_contact"), 0.95),
        voids=_column(rows, "outcome").count(VOID),
        faults=sum(map(FAULTS.__contains__, _column(rows, "reason"))),
        retries=sum(_column(rows, "retries")),
        endings=", ".join(f"{count} x {text}" for text, count in endings.most_common()),
        error=trouble,
        turn_median=quantile(turns, 0.5),
        turn_p95=quantile(turns, 0.95),
    )


def _column(rows: Sequence[TrialRow], name: str) -> list[Any]:
    """Return the values of one field, without those of stages that were not reached."""
    return [value for row in rows if (value := getattr(row, name)) is not None]
