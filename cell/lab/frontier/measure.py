"""The frontier of speed against accuracy: one point a variant of the cell, all on the same seeds."""

import csv
import json
import logging
import math
import platform
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from cell.cell_config import CellConfig
from cell.config import load
from cell.config_files import presets
from cell.lab.trials import SUMMARY, TABLE, VOID, TrialRow, read_table, run_trials
from cell.provenance import config_hash, versions
from cell.statistics import Z95, mean, wilson
from drivers.errors import CellError, FaultCode
from skills.catalogue import INSERT, SEARCH
from skills.contract import Outcome
from skills.tactile.estimators import ESTIMATORS

logger = logging.getLogger(__name__)

FRONTIER = "frontier.csv"
PRESET, CHAIN = "preset", "chain"
BASES = "as shipped", "as configured"
"""Names of the config that every variant starts from, with nothing given and with a file or keys given."""
START = "paper"
"""Preset from which the chain starts."""
SWEEPS: dict[str, dict[str, tuple[str, ...]]] = {
    "search speed": {f"{speed:g} m/s": (f"search.speed={speed:g}",) for speed in (0.03, 0.05, 0.08, 0.115, 0.15)},
    "rotational gain": {
        f"{gain:g} N·m/rad": (f"insert.gains.rotation={gain:g}",) for gain in (5.0, 10.0, 20.0, 40.0, 48.0)
    },
    "estimator": {name: (f"insert.estimator={name}",) for name in ESTIMATORS},
    "skin rate": {f"{rate:g} Hz": (f"skin.rate={rate:g}",) for rate in (10.0, 20.0, 50.0, 100.0)},
    "layout": {
        "P, parallelogram": ("skin.layout=parallelogram",),
        "D, base to base": ("skin.layout=base_to_base",),
    },
}
"""Swept settings, from the config that every variant starts from: a name for each value, and its keys."""
STEPS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "+ height evidence, judged at rest",
        ("search.evidence", "search.event", "search.dip", "search.fall", "search.rest", "search.probe"),
    ),
    ("+ estimator: {estimator}", ("insert.estimator", *ESTIMATORS, "smoothing", "observer")),
    ("+ path: {path}", ("search",)),
    ("+ insertion that yields", ("insert",)),
    ("+ adjustment that is guided", ("adjust",)),
    ("+ retries: {retries}", ("retries",)),
    ("+ all else", ("",)),
)
"""Steps of the chain, in order; each takes the keys that begin with its prefixes and that no earlier step took."""
QUICK = {"skin rate": ("100 Hz",)}
"""Sweeps that remain in a quick study."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One variant of the cell."""

    family: str
    """Family of the variant: `preset`, `chain`, or what is swept."""
    name: str
    preset: str | None
    """Preset that replaces the config's own; None keeps that."""
    sets: tuple[str, ...]
    """Single keys, `KEY=VALUE`, laid over the preset."""


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
    voids: int
    faults: int
    """Number of trials that a fault ended; they count as not successful."""
    retries: int
    """Number of retries in all trials together."""
    endings: str
    """Endings other than success, with their counts."""
    error: str
    """Reason why the variant could not be run; empty when it could."""


def variants(path: Path | None, sets: Sequence[str], is_quick: bool) -> list[Variant]:
    """Return all variants: the config itself and every preset, the sweeps, and the chain.

    Args:
        path: TOML file of the cell; None is the simulated cell that ships with the program.
        sets: Keys of all variants; the presets and the sweeps go over them.
        is_quick: Whether to return only a few.
    """
    names = [START] if is_quick else sorted(presets(path))
    found = [Variant(PRESET, BASES[bool(path or sets)], None, ()), *(Variant(PRESET, name, name, ()) for name in names)]
    for family, values in SWEEPS.items():
        kept = QUICK.get(family, ()) if is_quick else tuple(values)
        found += [Variant(family, name, None, values[name]) for name in kept]
    steps = chain(_load(path, START, sets), _load(path, None, sets))
    return found + ([steps[0], steps[-1]] if is_quick else steps)


def _load(path: Path | None, preset: str | None, sets: Sequence[str]) -> CellConfig:
    return load(path, preset, [*sets, "sim.pace=max"]).cell


def chain(start: CellConfig, end: CellConfig) -> list[Variant]:
    """Return the steps from `start` to `end`, one at a time; steps that change nothing are left out."""
    below, above = dict(_leaves(start)), dict(_leaves(end))
    left = [key for key in above if key != "preset" and below.get(key) != above[key]]
    taken: list[str] = []
    steps = [Variant(CHAIN, START, START, ())]
    for name, heads in STEPS:
        new = [key for key in left if key.startswith(heads)]
        left = [key for key in left if key not in new]
        if new:
            taken += [f"{key}={json.dumps(above[key])}" for key in new]
            text = name.format(
                estimator=end.params(INSERT).estimator, path=end.params(SEARCH).path, retries=end.retries
            )
            steps.append(Variant(CHAIN, text, START, tuple(taken)))
    return steps


def _leaves(config: CellConfig) -> Iterator[tuple[str, Any]]:
    def of(tree: dict[str, Any], at: str) -> Iterator[tuple[str, Any]]:
        for key, value in tree.items():
            if isinstance(value, dict):
                yield from of(value, f"{at}{key}.")
            else:
                yield f"{at}{key}", value

    return of(config.model_dump(mode="json"), "")


def title_of(seeds: range) -> str:
    """Return trials, seeds and versions in the words of charts and table."""
    return (
        f"{len(seeds)} trials a variant, simulated, seeds {seeds[0]} to {seeds[-1]}; python {platform.python_version()}, "
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
        done: Called with the number of further trials done.

    Raises:
        ConfigError: The config that every variant starts from cannot be used.
    """
    base = _fingerprint(_load(path, None, sets))
    ran: dict[str, tuple[str, list[TrialRow], str]] = {}
    lines: list[FrontierLine] = []
    for variant in tried:
        rows: list[TrialRow] = []
        place, trouble, mark = "", "", ""
        try:
            config = _load(path, variant.preset, [*sets, *variant.sets])
        except CellError as error:
            trouble = str(error)
            done(len(seeds))
        else:
            mark = _fingerprint(config)
            if mark not in ran:
                place = re.sub(r"\W+", "-", f"{variant.family} {variant.name}").strip("-")
                ran[mark] = (place, *_run(config, seeds, workers, folder / place, done))
            else:
                done(len(seeds))
            place, rows, trouble = ran[mark]
        lines.append(_line(variant, place, rows, trouble, is_base=mark == base))
        _write(lines, folder / FRONTIER)
    return lines


def _fingerprint(config: CellConfig) -> str:
    """Return a text that is the same for configs with the same values, whatever their origin."""
    return config_hash(config.model_copy(update={"preset": ""}))


def _run(
    config: CellConfig, seeds: Sequence[int], workers: int, folder: Path, done: Callable[[int], None]
) -> tuple[list[TrialRow], str]:
    rows = _finished(config, seeds, folder)
    if rows:
        done(len(seeds))
        return rows, ""
    told = 0

    def advance(row: TrialRow) -> None:
        nonlocal told
        told += 1
        done(1)

    try:
        return run_trials(config, seeds, workers, folder, advance), ""
    except Exception as error:  # whatever it is, the other variants are worth having
        logger.exception("%s", folder)
        done(len(seeds) - told)
        return [], " ".join(f"{type(error).__name__}: {error}".split())


def _finished(config: CellConfig, seeds: Sequence[int], folder: Path) -> list[TrialRow]:
    """Return the rows of an earlier call with the same config, seeds and versions, or none."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        rows = read_table(folder / TABLE)
    except (OSError, ValueError, KeyError):
        return []
    same = (config_hash(config), {"python": platform.python_version(), **versions()})
    is_same = (summary.get("config_hash"), summary.get("versions")) == same
    return rows if is_same and [row.seed for row in rows] == sorted(seeds) else []


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
        median=_quantile(totals, 0.5),
        p95=_quantile(totals, 0.95),
        search=stage("search_time"),
        insert=stage("insert_time"),
        adjust=stage("adjust_time"),
        force_median=_quantile(forces, 0.5),
        force_p95=_quantile(forces, 0.95),
        voids=sum(row.outcome == VOID for row in rows),
        faults=sum(row.reason in faults for row in rows),
        retries=sum(row.retries for row in rows),
        endings=", ".join(f"{count} x {text}" for text, count in endings.most_common()),
        error=trouble,
    )


def _quantile(values: Any, share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else math.nan


def _write(lines: Sequence[FrontierLine], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(FrontierLine)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(line) for line in lines)
