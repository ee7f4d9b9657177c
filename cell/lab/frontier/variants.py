"""Variants of the frontier: presets, the published method, sweeps up to failure, and the chain between the methods."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cell.config.cell_config import CellConfig
from cell.config.files import presets
from cell.lab.frontier.measure import Variant, load_variant
from cell.lab.paper import LABORATORY, ONE_ARM, ONE_BOARD
from cell.records.statistics import RateTest
from skills.catalogue import INSERT
from skills.tactile.estimators import ESTIMATORS

PRESET, PUBLISHED, CHAIN = "preset", "published method", "chain"
BASES = "as shipped", "as configured"
"""Names of the base config: without arguments, and with a file or keys."""
START = "paper"
"""Preset at the start of the chain."""
HERE, THERE = "in this cell", "in a laboratory as it fits"
"""Names of the published method: in the default cell, and in a cell with the pads, plate and skin of the published
experiment."""
SWEEPS: dict[str, dict[str, tuple[str, ...]]] = {
    "size of the errors": {f"reality {scale:g}": (f"reality.scale={scale:g}",) for scale in (0.0, 1.0, 2.0, 3.0)},
    "clearance": {f"{1e3 * gap:g} mm": (f"hole.diameter={0.008 + gap:.5f}",) for gap in (1e-4, 5e-5, 2e-5, 1e-5)},
    "search speed": {f"{speed:g} m/s": (f"search.speed={speed:g}",) for speed in (0.05, 0.115, 0.15)},
    "part": {
        **{
            f"round {1e3 * size:g} mm": (f"peg.diameter={size:g}", f"hole.diameter={size + 1e-4:g}")
            for size in (0.003, 0.004, 0.008, 0.016)
        },
        "8 x 8 mm": ("peg.shape=square", "peg.sides=[0.008,0.008]", "hole.sides=[0.0081,0.0081]"),
        "12 x 8 mm": ("peg.shape=rectangular", "peg.sides=[0.012,0.008]", "hole.sides=[0.0121,0.0081]"),
    },
    "friction of the plate": {
        **{f"{ratio:g}": (f"contact.friction={ratio:g}",) for ratio in (0.1, 0.6, 0.8)},
        "0.1 to 0.4": (),
    },
    "estimator": {name: (f"insert.estimator={name}",) for name in ESTIMATORS},
}
"""Sweeps from the base config up to the failure of a method: a name for each value, and its keys. Over a hole of 8.1 mm
a search is limited to 0.15 m/s, whatever the setting."""
ALL_DRAWN = "+ arms, boards, pads, plate and skin as drawn"
STEPS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("+ estimator: {estimator}", ("insert.estimator", *ESTIMATORS, "smoothing")),
    ("+ search: lanes, height evidence", ("search",)),
    ("+ insertion that yields", ("insert",)),
    ("+ adjustment that is guided", ("adjust",)),
    ("+ retries: {retries}", ("retries",)),
    (ALL_DRAWN, ("reality", *LABORATORY)),
    ("+ all else", ("",)),
)
"""Steps of the chain, in order. Each takes the keys with its prefixes that no earlier step took, and replaces the
printed skill of that section by the cell's own."""
QUICK = {"size of the errors": ("reality 0",)}
"""Sweeps of a quick study."""
CLOSE, COARSE = RateTest(good=0.01, bad=0.05, least=8), RateTest(good=0.02, bad=0.25, least=6)
"""Tests that end a setting's trials: for the presets, and for all other variants, which only show the limits of a
method."""


def rate_tests() -> Mapping[str, RateTest]:
    """Return the test that ends the trials of each family."""
    return {PRESET: CLOSE, **dict.fromkeys((PUBLISHED, *SWEEPS, CHAIN), COARSE)}


def variants(path: Path | None, sets: Sequence[str], is_quick: bool) -> list[Variant]:
    """Return all variants: the config itself and every preset, the published method, the sweeps, and the chain.

    Args:
        path: TOML file of the cell; None is the simulated cell that ships with the program.
        sets: Keys of all variants; presets and sweeps override them.
        is_quick: True to return only a few.
    """
    own = BASES[bool(path or sets)]
    found = [Variant(PRESET, own, None, ())]
    if not is_quick:
        found += [Variant(PRESET, name, name, ()) for name in sorted(presets(path)) if name != START]
    laboratory = (*ONE_ARM, *(f"{key}={value:g}" for key, value in LABORATORY.items()))
    found += [Variant(PUBLISHED, HERE, START, ())]
    found += [] if is_quick else [Variant(PUBLISHED, THERE, START, laboratory)]
    for family, values in SWEEPS.items():
        kept = QUICK.get(family, ()) if is_quick else tuple(values)
        found += [Variant(family, name, None, values[name]) for name in kept]
    steps = chain(load_variant(path, START, [*sets, *laboratory]), load_variant(path, None, sets), laboratory)
    return found + ([steps[0], steps[-1]] if is_quick else steps)


def chain(start: CellConfig, end: CellConfig, sets: tuple[str, ...] = ()) -> list[Variant]:
    """Return the steps from `start`, the preset with `sets`, to `end`, one at a time, without steps that change nothing."""
    below, above = dict(_leaves(start)), dict(_leaves(end))
    left = [key for key in above if key != "preset" and not key.startswith("paper") and below.get(key) != above[key]]
    printed, kept_to_the_end = (each.paper.skills if each.paper is not None else () for each in (start, end))
    taken: list[str] = [*sets]
    steps = [Variant(CHAIN, START, START, sets)]
    for name, heads in STEPS:
        new = [key for key in left if key.startswith(heads)]
        left = [key for key in left if key not in new]
        if name == ALL_DRAWN:
            taken = [each for each in taken if each not in ONE_BOARD]
        kept = tuple(skill for skill in printed if skill not in heads or skill in kept_to_the_end)
        if new or kept != printed:
            taken += [f"{key}={json.dumps(above[key])}" for key in new]
            taken += [f"paper.skills={json.dumps(kept)}"] if kept != printed else []
            text = name.format(estimator=end.params(INSERT).estimator, retries=end.retries)
            steps.append(Variant(CHAIN, text, START, tuple(taken)))
        printed = kept
    return steps


def _leaves(config: CellConfig) -> Iterator[tuple[str, Any]]:
    def of(tree: dict[str, Any], at: str) -> Iterator[tuple[str, Any]]:
        for key, value in tree.items():
            if isinstance(value, dict):
                yield from of(value, f"{at}{key}.")
            else:
                yield f"{at}{key}", value

    return of(config.model_dump(mode="json"), "")
