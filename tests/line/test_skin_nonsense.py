"""A skin that reports nonsense during the search ends it with a fault within the longest blind time."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from drivers.errors import SkinUntrustedError
from skills.catalogue import CATALOGUE
from skills.contract import LONGEST_BLIND

SPOILT_AFTER = 1.0
"""Of sliding over the plate, s."""
TOUCHED = 4e-3
"""The middle of the tilted end is no higher than this above the plate when its edge touches, m."""

NONSENSE = {
    "frozen": lambda raw, rng: np.full_like(raw, 7000) + np.arange(raw.size, dtype=np.uint16).reshape(raw.shape) * 40,
    "drawn at random": lambda raw, rng: rng.integers(0, 40_000, raw.shape).astype(np.uint16),
}
"""One kind without a trusted taxel, and one that the estimator rejects; tests of the estimators have every kind."""


@pytest.mark.parametrize("kind", NONSENSE)
def test_nonsense_from_the_skin_stops_the_search_with_a_fault(kind):
    config = load(sets=["sim.pace=max", "sim.seed=3"]).cell
    cell, rng = assemble(config), np.random.default_rng(2)
    began = []

    def disturb(raw):
        is_spoilt = bool(began) and cell.clock.now() > began[0] + SPOILT_AFTER
        return NONSENSE[kind](raw, rng) if is_spoilt else raw

    cell.skin._disturb = disturb
    with opened(cell):
        ctx = cell.context(3)

        def record(seen, setpoint):
            if ctx.stage == "spray_search" and not began and seen.tip[2] < config.hole.centre[2] + TOUCHED:
                began.append(seen.stamp)

        ctx.callbacks = replace(ctx.callbacks, record=record)
        with pytest.raises(SkinUntrustedError):
            CATALOGUE["insert_peg"].run(config.skill_set(), ctx)
        assert ctx.stage == "spray_search"
        assert cell.clock.now() < began[0] + SPOILT_AFTER + LONGEST_BLIND + 0.2
