"""The force of a latch against depth: told from noise, from a bottom that is another, and from a peg that is not held."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config import load
from drivers.frames import UP
from drivers.parts import Latch
from drivers.quantities import GripperState, ImpedanceSetpoint, Wrench
from skills.latch_likelihood import (
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
    unlikelihood,
)
from skills.seating import LEAST_PUSH
from skills.signature import LIFTED, MOST_WAYS, Curve
from tests.fakes import Rig

LATCH = Latch(kind="detent", force=5.0, height=0.003)
PERIOD, SPEED, BIAS = 0.01, 0.01, 3.0
HELD, EMPTY = GripperState(0.008, True, False), GripperState(0.0, False, False)


@pytest.fixture
def seen(tmp_path):
    return Rig(load(), tmp_path).cell.context(0).observe()


def scan(seen, height, force, stamp, hand=HELD):
    """Return a scan with hand and tip `height` above where the peg shall rest."""
    pose = replace(seen.arm.tcp, position=seen.arm.tcp.position + height * UP)
    arm = replace(seen.arm, tcp=pose, wrench=Wrench(force * UP, np.zeros(3)))
    return replace(seen, stamp=stamp, arm=arm, tip=seen.tip + height * UP, gripper=hand)


def pushing(seen):
    return ImpedanceSetpoint(1, seen.tip - 0.011 * UP, UP, np.full(6, 1000.0), np.ones(6), seen.stamp + 1.0)


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


def lowered(seen, latch=LATCH, *, shallow=0.0, wear=0.0, noise=0.0, above=0.006, hand=HELD):
    """Return the curve after a way down at an even speed to a bottom that is `shallow` higher than stated, and half a second of rest on it."""
    rng, curve, stamp = np.random.default_rng(1), Curve(), 0.0
    way = np.concatenate([np.arange(above, 0.0, -SPEED * PERIOD), np.zeros(50)])
    for height in way:
        felt = (1.0 - wear) * float(resistance(np.array(height + shallow), latch)) if height > 0.0 else 8.0
        force = felt + BIAS + noise * float(rng.standard_normal())
        # What the pads give way the hand goes further down.
        now = scan(seen, height - SHEAR * force, force, stamp, hand)
        curve, stamp = curve.after(now, pushing(now), latch), stamp + PERIOD
    return curve, stamp - PERIOD


def shows(curve, now):
    found = curve.signature(LATCH, now)
    return found is not None and found.is_sure


def test_a_peg_that_went_through_its_latch_to_the_bottom_shows_force_and_place(seen):
    curve, now = lowered(seen)
    found = curve.signature(LATCH, now)
    assert found is not None
    assert found.force == pytest.approx(LATCH.force, rel=0.05)
    assert abs(found.offset) <= 2 * GRID
    assert shows(curve, now)


def test_noise_of_the_force_does_not_hide_it(seen):
    assert shows(lowered(seen, noise=1.0)[0], 10.0)


@pytest.mark.parametrize("shallow", [0.001, 0.0015, 0.003, 0.005])
def test_a_bottom_that_is_higher_is_none(seen, shallow):
    curve, now = lowered(seen, shallow=shallow, noise=0.5)
    assert not shows(curve, now)


def test_a_latch_that_is_worn_out_is_none(seen):
    assert not shows(lowered(seen, wear=1.0, noise=1.0)[0], 10.0)


def test_a_peg_that_rests_nowhere_shows_nothing(seen):
    curve, now = lowered(seen)
    assert curve.signature(LATCH, now - 0.48) is None


def test_a_hand_that_holds_nothing_shows_nothing(seen):
    curve, now = lowered(seen, hand=EMPTY)
    assert curve == Curve()
    assert not shows(curve, now)


def test_a_peg_that_is_lost_on_the_way_begins_anew(seen):
    curve, now = lowered(seen)
    lost = curve.after(scan(seen, 0.0, 0.0, now, EMPTY), None, LATCH)
    assert not shows(lost, now + 1.0)


def test_a_peg_that_is_drawn_out_begins_anew(seen):
    curve, now = lowered(seen)
    assert not shows(curve.after(scan(seen, 0.01, 0.0, now), None, LATCH), now + 1.0)


def test_a_way_that_begins_in_the_latch_does_not_show_it(seen):
    curve, now = lowered(seen, above=0.003)
    assert curve.signature(LATCH, now) is None


def test_a_curve_without_any_force_is_no_latch():
    assert not told_by([way_down(wear=1.0)], LATCH).is_sure
    assert not told_by([way_down(wear=2.0)], LATCH).is_sure


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


@pytest.mark.parametrize("share", [FORCE_SHARE - 0.1, 1.0 / FORCE_SHARE + 0.1])
def test_a_latch_of_another_force_is_none(share):
    assert not told_by([way_down(wear=1.0 - share)], LATCH).is_sure


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


def test_the_likelihood_is_that_of_every_force_and_place_that_are_considered():
    shares, offsets = considered(LATCH)
    table = unlikelihood(way_down(), LATCH)
    assert table.shape == (shares.size, offsets.size)
    best = np.unravel_index(table.argmin(), table.shape)
    assert shares[best[0], 0] == pytest.approx(1.0)
    assert offsets[0, best[1]] == pytest.approx(0.0, abs=GRID / 2)


def drawn_up(curve, seen, now, height=1.1 * LIFTED):
    return curve.after(scan(seen, height, 0.0, now), None, LATCH)


def test_a_way_down_that_ended_in_a_rest_is_kept_where_the_peg_is_drawn_up_and_not_where_it_is_let_go(seen):
    curve, now = lowered(seen)
    up = drawn_up(curve, seen, now)
    assert [way.heights for way in up.earlier] == [curve.heights]
    assert up.after(scan(seen, 0.003, 0.0, now, EMPTY), None, LATCH).earlier == ()


def test_a_way_that_ended_in_no_rest_is_not_kept(seen):
    curve = Curve()
    for n, height in enumerate(np.arange(0.006, 0.0, -SPEED * PERIOD)):
        curve = curve.after(scan(seen, height, 0.0, n * PERIOD), None, LATCH)
    assert drawn_up(curve, seen, 1.0).earlier == ()


def test_what_gave_way_was_no_bottom_and_is_not_kept(seen):
    curve, now = lowered(seen)
    assert curve.has_rested
    deeper = curve.after(scan(seen, -0.001, 0.0, now), pushing(scan(seen, -0.001, 0.0, now)), LATCH)
    assert not deeper.has_rested
    assert drawn_up(deeper, seen, now).earlier == ()


@pytest.mark.parametrize(
    ("rest", "counts"), [(0.9 * PLACE, True), (-0.9 * PLACE, True), (1.1 * PLACE, False), (-1.1 * PLACE, False)]
)
def test_ways_count_together_where_they_ended_at_the_same_height(seen, rest, counts):
    curve, now = lowered(seen)
    here, force = float(curve.heights[-1]), curve.forces[-1]
    denied = way_down(shallow=0.001)
    lift = (
        here
        + SHEAR * force
        + rest
        - SHEAR * (force - denied.forces[-1])
        - denied.heights[-1]
        - SHEAR * denied.forces[-1]
    )
    denied = Way(tuple(height + lift for height in denied.heights), denied.forces)
    assert denied.heights[-1] - here == pytest.approx(rest, abs=1e-9)
    alone = curve.signature(LATCH, now)
    assert alone.is_sure
    assert (replace(curve, earlier=(denied,)).signature(LATCH, now) != alone) is counts


def test_no_more_ways_are_kept_than_are_needed(seen):
    curve, now = lowered(seen)
    many = replace(curve, earlier=tuple(way_down() for _ in range(MOST_WAYS)))
    up = drawn_up(many, seen, now)
    assert len(up.earlier) == MOST_WAYS
    assert up.earlier[-1].heights == curve.heights


def test_a_push_too_weak_to_tell_a_bottom_shows_none(seen):
    now = scan(seen, 0.0, 0.0, 0.0)
    weak = replace(pushing(now), tip=now.tip - 0.99 * LEAST_PUSH / 1000.0 * UP)
    curve = lowered(seen)[0].after(now, weak, LATCH)
    assert curve.signature(LATCH, 10.0) is None
