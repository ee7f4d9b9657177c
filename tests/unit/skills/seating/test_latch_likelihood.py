"""Likelihood of a latch over several strokes: against noise, walls that hold a peg back, and another bottom."""

import numpy as np
import pytest

from drivers.parts import Latch
from skills.seating.latch_likelihood import (
    DOUBT,
    FORCE_SHARE,
    GRID,
    PLACE,
    SHEAR,
    Signature,
    Way,
    considered,
    resistance,
    told_by,
)

LATCH = Latch(kind="detent", force=5.0, height=0.003)
BIAS = 3.0
"""Force that the arm reports if nothing resists, N."""


def way_down(*, shallow=0.0, wear=0.0, rubs=(), noise=0.0, rest=0.0, rng=None):
    """Return a way down to a bottom that is `shallow` higher than stated, on which walls hold the peg back: place and width, m, and force, N, of each."""
    above = np.concatenate([np.arange(0.006, 0.0, -1e-4), [0.0]])
    force = BIAS + (1.0 - wear) * resistance(above + shallow, LATCH)
    for place, width, size in rubs:
        force = force + size * np.clip(1.0 - (2.0 * (above - place) / width) ** 2, 0.0, None)
    if noise:
        force = force + noise * rng.standard_normal(len(force))
    force[-1] = BIAS + 11.0
    return Way(tuple((above + rest - SHEAR * force).tolist()), tuple(force.tolist()))


def rubbed(rng, count=4, most=6.0):
    """Return where walls hold a leaning peg back on one way, and how much."""
    return [(rng.uniform(0.0, 0.0045), rng.uniform(3e-4, 1e-3), rng.uniform(0.0, most)) for _ in range(count)]


@pytest.mark.parametrize("share", [0.0, -1.0, FORCE_SHARE - 0.1, 1.0 / FORCE_SHARE + 0.1])
def test_a_curve_of_no_force_or_of_another_one_is_no_latch(share):
    assert not told_by([way_down(wear=1.0 - share)], LATCH).is_sure


@pytest.mark.parametrize(("doubt", "is_sure", "is_refuted"), [(0.99, True, False), (1.01, False, False)])
def test_doubt_is_judged_at_its_limits(doubt, is_sure, is_refuted):
    found = Signature(LATCH.force, 0.0, doubt * DOUBT)
    assert (found.is_sure, found.is_refuted) == (is_sure, is_refuted)
    opposite = Signature(LATCH.force, -0.001, 1.0 - doubt * DOUBT)
    assert (opposite.is_sure, opposite.is_refuted) == (False, is_sure)


@pytest.mark.parametrize("factor", [0.8, 1.2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_latch_of_a_smooth_way_is_told_within_half_a_millimetre_of_its_place(side, factor):
    assert told_by([way_down(shallow=side * (PLACE - 2 * GRID), wear=1.0 - factor)], LATCH).is_sure
    assert not told_by([way_down(shallow=side * (PLACE + GRID), wear=1.0 - factor)], LATCH).is_sure


def test_a_smooth_way_that_denies_the_bottom_is_not_outvoted_by_one_on_which_the_peg_rubbed():
    # Walls hold the peg back where the latch of a seated one would, and at places beside it.
    smooth = way_down(shallow=0.001)
    above = np.array(smooth.heights) + SHEAR * np.array(smooth.forces)
    force = np.maximum(np.array(smooth.forces), BIAS + resistance(above, LATCH))
    force[-1] = smooth.forces[-1]
    misled = Way(tuple((above - SHEAR * force).tolist()), tuple(force.tolist()))
    alone = told_by([misled], LATCH)
    assert not alone.is_sure
    assert not alone.is_refuted
    assert told_by([smooth, misled], LATCH).is_refuted
    assert told_by([misled, smooth], LATCH).is_refuted


def test_walls_only_hold_back_so_that_a_curve_is_trusted_less_where_it_lies_below_the_latch():
    back, on = (told_by([way_down(rubs=[(0.0022, 8e-4, size)])], LATCH) for size in (6.0, -6.0))
    assert back.doubt < on.doubt


def test_whatever_walls_do_no_bottom_that_is_1_mm_higher_is_told_and_a_seated_peg_is():
    rng, told = np.random.default_rng(7), {0.0: 0, 0.001: 0}
    for shallow in told:
        for _ in range(100):
            ways = [way_down(shallow=shallow, rubs=rubbed(rng), noise=0.5, rng=rng) for _ in range(5)]
            told[shallow] += any(told_by(ways[: n + 1], LATCH).is_sure for n in range(5))
    assert told[0.001] == 0
    assert told[0.0] >= 99


def test_a_way_that_shows_no_latch_counts_for_nothing():
    short = Way((0.1, 0.09), (1.0, 1.0))
    assert told_by([short, way_down()], LATCH) == told_by([way_down()], LATCH)
    none = told_by([short], LATCH)
    assert not none.is_sure
    assert not none.is_refuted


@pytest.mark.parametrize("height", [0.0015, 0.003, 0.01])
def test_a_bottom_that_is_1_mm_off_is_considered_whatever_the_height_of_the_latch(height):
    _, offsets = considered(LATCH.model_copy(update={"height": height}))
    assert offsets.max() == -offsets.min() >= max(2.0 * PLACE, height / 2)
