"""Settings within ranges, selected by an optimiser, and the best one judged on other seeds.

The default ranges have two figures, one for the search and one for the insertion: 0 is the preset `careful`, 1 the cell's
own config. Every setting is therefore between shipped settings. The optimiser is Optuna's tree-structured Parzen estimator.
If a setting is clearly worse than the best one on the same seeds, Optuna's Wilcoxon pruner ends it early.
"""

import json
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.trials import Program, TrialRow, insert_peg, run_trials
from cell.lab.tune.wish import Wish, cost
from drivers.errors import ConfigError
from drivers.quantities import Vector
from skills.contract import Outcome

if TYPE_CHECKING:
    import optuna

SECTIONS = ("search", "insert")
"""Sections of the config that have a figure of their own; `careful` changes them."""
Sets = tuple[str, ...]
Ranges = Mapping[str, tuple[float, float]]
"""Least and largest value of each figure of a setting."""
STYLED: Ranges = dict.fromkeys(SECTIONS, (0.0, 1.0))
"""Default ranges: each section from `careful`, 0, to the cell's own config, 1."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One tested setting."""

    number: int
    figures: Mapping[str, float]
    sets: Sets
    """Keys of the setting on top of the config's own, `KEY=VALUE`."""
    trials: int
    cost: float
    """Mean cost of its trials, see `cell.lab.tune.wish`."""
    is_left: bool
    """True if the optimiser ended the setting before the last seed."""


class Space:
    """Settings of one cell, each a value for every figure of its ranges.

    The figure of a section interpolates the section's keys. If the name of another figure has a dot, the figure is a key of
    the config; otherwise it is a parameter of the program.
    """

    def __init__(
        self,
        path: Path | None,
        sets: Sequence[str],
        ranges: Ranges = STYLED,
        preset: str | None = None,
        make: Callable[[Mapping[str, float]], Program] = lambda figures: insert_peg,
    ) -> None:
        """Read a cell's file and single keys twice, with `preset` and with the preset `careful`.

        Args:
            path: TOML file of the cell.
            sets: Keys of every setting, `KEY=VALUE`.
            ranges: Range of each figure.
            preset: Preset of every setting; None keeps the config's.
            make: Function that returns the program for the figures of a setting.

        Raises:
            ConfigError: The cell or the preset is invalid.
        """
        self._path, self._own, self._preset, self.ranges, self.program = path, tuple(sets), preset, ranges, make
        careful, base = (
            dict(_numbers(load(path, style, sets).cell.model_dump(mode="json"))) for style in ("careful", preset)
        )
        self._figures = {
            key: (careful[key], base[key])
            for key in careful.keys() & base.keys()
            if key.split(".")[0] in SECTIONS
            and careful[key].shape == base[key].shape
            and (careful[key] != base[key]).any()
        }

    def sets(self, figures: Mapping[str, float]) -> Sets:
        """Return the keys of a setting that differ from the config's own."""
        found = []
        for key, (careful, own) in sorted(self._figures.items()):
            place = figures.get(key.split(".")[0], 1.0)
            if place == 1.0:
                continue
            value = careful + place * (own - careful)
            rounded = [float(f"{each:.4g}") for each in np.atleast_1d(value)]
            found.append(f"{key}={json.dumps(rounded if value.ndim else rounded[0])}")
        keys = [f"{name}={value:.4g}" for name, value in figures.items() if "." in name]
        return (*found, *keys)

    def starts(self) -> list[dict[str, float]]:
        """Return the first settings to test: both ends of the ranges of the sections, with the geometric middle of the others."""
        middle = {name: math.sqrt(low * high) for name, (low, high) in self.ranges.items() if name not in SECTIONS}
        styled = [name for name in self.ranges if name in SECTIONS]
        return [{**dict.fromkeys(styled, place), **middle} for place in ((1.0, 0.0) if styled else (1.0,))]

    def config(self, sets: Sets) -> CellConfig:
        """Return the simulated cell with these keys.

        Raises:
            ConfigError: The keys are inconsistent, for example unstable gains.
        """
        return load(self._path, self._preset, [*self._own, "sim.pace=max", *sets]).cell


def tune(
    space: Space,
    wishes: Sequence[Wish],
    seeds: Sequence[int],
    candidates: int,
    workers: int,
    folder: Path,
    done: Callable[[int], None],
) -> list[Candidate]:
    """Test settings, the shipped ones first, and return them in order of cost; a repeated call reuses finished trials.

    Args:
        space: Permitted settings.
        wishes: Conditions of the wish.
        seeds: Seeds, one trial each, the same for every setting.
        candidates: Number of settings.
        workers: Number of processes.
        folder: Folder of the settings' trials.
        done: Called with the number of further trials completed or saved.

    Raises:
        ConfigError: The optimiser is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise ConfigError("tune: Optuna is not installed; pip install 'tactile-insertion-cell[tune]'") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)  # its version is pinned
    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(seed=seeds[0], n_startup_trials=max(candidates // 3, 2)),
        pruner=optuna.pruners.WilcoxonPruner(p_threshold=0.1, n_startup_steps=min(4, len(seeds))),
    )
    for start in space.starts():
        study.enqueue_trial(start)
    found = []
    for number in range(candidates):
        asked = study.ask()
        figures = {
            name: asked.suggest_float(name, low, high, log=name not in SECTIONS)
            for name, (low, high) in space.ranges.items()
        }
        sets = space.sets(figures)
        try:
            config = space.config(sets)
        except ConfigError:
            study.tell(asked, state=optuna.trial.TrialState.FAIL)
            done(len(seeds))
            continue
        left = _Left(asked, wishes)
        rows = run_trials(
            config,
            seeds,
            workers,
            folder / f"setting-{number:03d}",
            lambda row: done(1),
            is_enough=left,
            program=space.program(figures),
        )
        done(len(seeds) - len(rows))
        mean = sum(cost(row, wishes) for row in rows) / len(rows)
        study.tell(asked, mean)
        found.append(Candidate(number, figures, sets, len(rows), mean, len(rows) < len(seeds)))
    return sorted(found, key=lambda each: (each.is_left, each.cost))


def toml(sets: Sets) -> str:
    """Return keys as the lines of a recipe."""
    return "".join(f"{key} = {value}\n" for key, value in (text.split("=", 1) for text in sets))


class _Left:
    """Reports every trial of one setting to the optimiser, and returns its decision to end the setting."""

    def __init__(self, asked: "optuna.Trial", wishes: Sequence[Wish]) -> None:
        self._asked, self._wishes, self._told = asked, wishes, 0

    def __call__(self, rows: Sequence[TrialRow]) -> bool:
        if len(rows) > self._told:
            self._told = len(rows)
            self._asked.report(cost(rows[-1], self._wishes), len(rows) - 1)
        # A setting ends if its first 4 trials, or more, have no success. The pruner cannot end such a setting, as long as no
        # other setting is better.
        is_hopeless = len(rows) >= 4 and all(row.outcome != Outcome.SUCCESS for row in rows)
        return len(rows) == self._told and (is_hopeless or self._asked.should_prune())


def _numbers(tree: Mapping[str, Any], at: str = "") -> Iterator[tuple[str, Vector]]:
    """Yield every figure and every list of figures of a config, with its key."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{at}{key}.")
        elif _is_figure(value) or (isinstance(value, list) and value and all(map(_is_figure, value))):
            yield f"{at}{key}", np.array(value, dtype=float)


def _is_figure(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
