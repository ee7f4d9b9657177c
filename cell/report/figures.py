"""The figures of many runs as arrays, unpacked from the journal's rows; pure."""

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cell.records.told import RUN_FIGURES, STAGE_FIGURES, Kind, Told
from drivers.quantities import Vector
from skills.contract import Outcome

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Figures:
    """Kinds of runs, and arrays with one value per run; NaN means not on record."""

    kinds: Sequence[tuple[Kind, Sequence[int]]]
    """Each kind with the places of its runs in the arrays."""
    is_good: Flags
    """True if the run succeeded."""
    of_run: Mapping[str, Vector]
    """Array of each of `RUN_FIGURES`."""
    of_stage: Mapping[str, Mapping[str, Vector]]
    """Array of each of `STAGE_FIGURES`, by the name of the stage."""


def unpacked(told: Told) -> Figures:
    """Return the figures of runs."""
    count = len(told.figures)
    kinds, is_good = [], np.zeros(count, dtype=bool)
    of_run = {name: np.full(count, np.nan) for name in RUN_FIGURES}
    of_stage: dict[str, dict[str, Vector]] = {}
    for text, alike in _alike(told.kind).items():
        kind, places = Kind(*json.loads(text)), np.array(alike)
        kinds.append((kind, alike))
        is_good[places] = kind.outcome == Outcome.SUCCESS
        width = len(RUN_FIGURES) + len(STAGE_FIGURES) * len(kind.names)
        packed = b"".join([told.figures[place] for place in alike])
        values = iter(np.frombuffer(packed, "<f8").reshape(-1, width).T)
        for name in RUN_FIGURES:
            of_run[name][places] = next(values)
        for stage in kind.names:
            arrays = of_stage.setdefault(stage, {name: np.full(count, np.nan) for name in STAGE_FIGURES})
            for name in STAGE_FIGURES:
                arrays[name][places] = next(values)
    return Figures(kinds, is_good, of_run, of_stage)


def _alike(kinds: Sequence[str]) -> Mapping[str, list[int]]:
    """Return the places of each kind."""
    found: dict[str, list[int]] = defaultdict(list)
    for place, kind in enumerate(kinds):
        found[kind].append(place)
    return found
