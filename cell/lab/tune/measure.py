"""Settings between the shipped presets, selected by an optimiser, and the best one judged on other seeds.

Three numbers represent all gains: one each for search, insertion and adjustment, from 0, the gentlest preset, over 1 to
2, the fastest. Every setting is therefore between shipped settings. The optimiser is Optuna's tree-structured Parzen
estimator. If a setting is clearly worse than the best one on the same seeds, Optuna's Wilcoxon pruner ends it early.
"""

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.trials import TrialRow, run_trials
from cell.lab.tune.wish import Wish, cost
from drivers.errors import ConfigError
from drivers.quantities import Vector

if TYPE_CHECKING:
    import optuna

STYLES = ("careful", "balanced", "fast")
"""Presets from the gentlest to the fastest."""
SECTIONS = ("search", "insert", "adjust")
"""Sections with a number of their own."""
QUICKEST = float(len(STYLES) - 1)
Sets = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One tested setting."""

    number: int
    style: Mapping[str, float]
    """Number of each section, 0 to 2."""
    sets: Sets
    """Keys of the setting on top of the config's own, `KEY=VALUE`."""
    trials: int
    cost: float
    """Mean cost of its trials, see `cell.lab.tune.wish`."""
    is_left: bool
    """True if it ended before the last seed."""


class Space:
    """Settings between the presets of one cell."""

    def __init__(self, path: Path | None, sets: Sequence[str]) -> None:
        """Read the presets on top of a cell's file and single keys.

        Raises:
            ConfigError: The cell or one of the presets is invalid.
        """
        self._path, self._own = path, tuple(sets)
        cells = [load(path, style, [*sets, "sim.pace=max"]).cell for style in STYLES]
        leaves = [dict(_numbers(cell.model_dump(mode="json"))) for cell in cells]
        self._base = dict(_numbers(load(path, None, sets).cell.model_dump(mode="json")))
        self._figures = {
            key: tuple(each[key] for each in leaves)
            for key in leaves[0]
            if key.split(".")[0] in SECTIONS
            and all(key in each and each[key].shape == leaves[0][key].shape for each in leaves)
            and any((each[key] != leaves[0][key]).any() for each in leaves)
        }

    def sets(self, style: Mapping[str, float]) -> Sets:
        """Return the keys of a setting that differ from the config's own, each interpolated between two presets."""
        found = []
        for key, figures in self._figures.items():
            place = min(max(style[key.split(".")[0]], 0.0), QUICKEST)
            below = min(int(place), len(figures) - 2)
            value = figures[below] + (place - below) * (figures[below + 1] - figures[below])
            if not np.allclose(value, self._base.get(key, np.nan)):
                rounded = [float(f"{each:.4g}") for each in np.atleast_1d(value)]
                found.append(f"{key}={json.dumps(rounded if value.ndim else rounded[0])}")
        return tuple(found)

    def config(self, sets: Sets) -> CellConfig:
        """Return the simulated cell with these keys.

        Raises:
            ConfigError: The keys are inconsistent, for example unstable gains.
        """
        return load(self._path, None, [*self._own, "sim.pace=max", *sets]).cell


def tune(
    space: Space,
    wishes: Sequence[Wish],
    seeds: Sequence[int],
    candidates: int,
    workers: int,
    folder: Path,
    done: Callable[[int], None],
) -> list[Candidate]:
    """Test settings, the presets first, and return them, cheapest first; a repeated call reuses finished trials.

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
    optuna = _optimiser()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)  # its version is pinned
    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(seed=seeds[0], n_startup_trials=max(candidates // 3, len(STYLES))),
        pruner=optuna.pruners.WilcoxonPruner(p_threshold=0.1, n_startup_steps=min(4, len(seeds))),
    )
    for place in range(len(STYLES)):
        study.enqueue_trial(dict.fromkeys(SECTIONS, float(place)))
    found = []
    for number in range(candidates):
        asked = study.ask()
        style = {name: asked.suggest_float(name, 0.0, QUICKEST) for name in SECTIONS}
        sets = space.sets(style)
        try:
            config = space.config(sets)
        except ConfigError:
            study.tell(asked, state=optuna.trial.TrialState.FAIL)
            done(len(seeds))
            continue
        left = _Left(asked, wishes)
        rows = run_trials(config, seeds, workers, folder / f"setting-{number:03d}", lambda row: done(1), None, left)
        done(len(seeds) - len(rows))
        mean = sum(cost(row, wishes) for row in rows) / len(rows)
        study.tell(asked, mean)
        found.append(Candidate(number, style, sets, len(rows), mean, len(rows) < len(seeds)))
    return sorted(found, key=lambda each: (each.is_left, each.cost))


def judge(
    space: Space, sets: Sets, seeds: Sequence[int], workers: int, folder: Path, done: Callable[[TrialRow], None]
) -> list[TrialRow]:
    """Return the trials of a setting on seeds that the choice did not use."""
    return run_trials(space.config(sets), seeds, workers, folder, done)


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
        return len(rows) == self._told and self._asked.should_prune()


def _optimiser() -> Any:
    try:
        import optuna
    except ImportError:
        raise ConfigError("tune: Optuna is not installed; pip install 'tactile-insertion-cell[tune]'") from None
    return optuna


def _numbers(tree: Mapping[str, Any], at: str = "") -> Iterator[tuple[str, Vector]]:
    """Return every figure, and every list of figures, of a config by its key."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{at}{key}.")
        elif _is_figure(value) or (isinstance(value, list) and value and all(map(_is_figure, value))):
            yield f"{at}{key}", np.array(value, dtype=float)


def _is_figure(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
