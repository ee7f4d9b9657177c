"""The force of a latch against depth: its likelihood over several strokes, and when enough was seen."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.frames import UP
from drivers.parts import Latch
from drivers.quantities import GripperState, ImpedanceSetpoint, Wrench
from skills.seating.decision import DOUBTED
from skills.seating.latch_likelihood import (
    BEFORE,
    DOUBT,
    FORCE_SHARE,
    GRID,
    MOST_WAYS,
    PLACE,
    SHEAR,
    InsertionStroke,
    Signature,
    considered,
    resistance,
    told_by,
)
from skills.seating.latch_looks import LEAST_LOOKS, MOST_LOOKS, TURNING_BACK, Looks, is_enough
from skills.seating.signature import LIFTED, StrokeCurve

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
    return InsertionStroke(tuple((above + rest - SHEAR * force).tolist()), tuple(force.tolist()))


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
def test_a_smooth_stroke_shows_the_latch_within_half_a_millimetre(side, factor):
    assert told_by([way_down(shallow=side * (PLACE - 2 * GRID), wear=1.0 - factor)], LATCH).is_sure
    assert not told_by([way_down(shallow=side * (PLACE + GRID), wear=1.0 - factor)], LATCH).is_sure


def test_a_rubbing_stroke_does_not_outvote_a_smooth_one():
    # Walls hold the peg back where the latch of a seated one would, and at places beside it.
    smooth = way_down(shallow=0.001)
    above = np.array(smooth.heights) + SHEAR * np.array(smooth.forces)
    force = np.maximum(np.array(smooth.forces), BIAS + resistance(above, LATCH))
    force[-1] = smooth.forces[-1]
    misled = InsertionStroke(tuple((above - SHEAR * force).tolist()), tuple(force.tolist()))
    alone = told_by([misled], LATCH)
    assert not alone.is_sure
    assert not alone.is_refuted
    assert told_by([smooth, misled], LATCH).is_refuted
    assert told_by([misled, smooth], LATCH).is_refuted


def test_a_curve_below_the_latch_is_trusted_less():
    back, on = (told_by([way_down(rubs=[(0.0022, 8e-4, size)])], LATCH) for size in (6.0, -6.0))
    assert back.doubt < on.doubt


def test_rubbing_walls_neither_seat_a_higher_peg_nor_hide_a_seated():
    rng, told = np.random.default_rng(7), {0.0: 0, 0.001: 0}
    for shallow in told:
        for _ in range(100):
            ways = [way_down(shallow=shallow, rubs=rubbed(rng), noise=0.5, rng=rng) for _ in range(5)]
            told[shallow] += any(told_by(ways[: n + 1], LATCH).is_sure for n in range(5))
    assert told[0.001] == 0
    assert told[0.0] >= 99


def test_a_way_that_shows_no_latch_counts_for_nothing():
    short = InsertionStroke((0.1, 0.09), (1.0, 1.0))
    assert told_by([short, way_down()], LATCH) == told_by([way_down()], LATCH)
    none = told_by([short], LATCH)
    assert not none.is_sure
    assert not none.is_refuted


@pytest.mark.parametrize("height", [0.0015, 0.003, 0.01])
def test_a_bottom_1_mm_off_is_considered_for_any_latch(height):
    _, offsets = considered(LATCH.model_copy(update={"height": height}))
    assert offsets.max() == -offsets.min() >= max(2.0 * PLACE, height / 2)


PERIOD, SPEED = 0.01, 0.01
REST = 8.0
"""Force at which the bottom bears the push, N."""
HELD, EMPTY = GripperState(0.008, True, False), GripperState(0.0, False, False)


def scan(seen, height, force, stamp, hand=HELD):
    """Return a scan with hand and tip `height` above where the peg shall rest."""
    pose = replace(seen.arm.tcp, position=seen.arm.tcp.position + height * UP)
    arm = replace(seen.arm, tcp=pose, wrench=Wrench(force * UP, np.zeros(3)))
    return replace(seen, stamp=stamp, arm=arm, tip=seen.tip + height * UP, gripper=hand)


def pushing(seen):
    return ImpedanceSetpoint(1, seen.tip - 0.011 * UP, UP, np.full(6, 1000.0), np.ones(6), seen.stamp + 1.0)


def descent(seen, stamp=0.0, *, shallow=0.0, wear=0.0, rub=0.0, bias=0.0, noise=0.0, above=0.006, rest=50, hand=HELD):
    """Yield the scans of a way down at an even speed to a bottom that is `shallow` higher than stated, and of a rest on it.

    Behind the latch, walls that a leaning peg rubs at hold it back with the force `rub`.
    """
    rng = np.random.default_rng(1)
    for n, height in enumerate(np.concatenate([np.arange(above, 0.0, -SPEED * PERIOD), np.zeros(rest)])):
        felt = (1.0 - wear) * float(resistance(np.array(height + shallow), LATCH)) + rub * (height < LATCH.height / 2)
        force = (felt if height > 0.0 else REST) + bias + noise * float(rng.standard_normal())
        # The hand goes further down by the deflection of the pads.
        yield scan(seen, height - SHEAR * force, force, stamp + n * PERIOD, hand)


def lowered(seen, **way):
    """Return the curve after a way down and half a second of rest, and the time, s."""
    curve = StrokeCurve()
    for now in descent(seen, bias=BIAS, **way):
        curve = curve.after(now, pushing(now), LATCH)
    return curve, now.stamp


def shows(curve, now):
    found = curve.signature(LATCH, now)
    return found is not None and found.is_sure


def test_a_stroke_through_the_latch_shows_force_and_place(seen):
    curve, now = lowered(seen)
    found = curve.signature(LATCH, now)
    assert found.force == pytest.approx(LATCH.force, rel=0.05)
    assert abs(found.offset) <= 2 * GRID
    assert shows(curve, now)


@pytest.mark.parametrize(
    ("way", "is_shown"),
    [
        ({"noise": 1.0}, True),
        *(({"shallow": shallow, "noise": 0.5}, False) for shallow in (0.001, 0.0015, 0.003, 0.005)),
        ({"wear": 1.0, "noise": 1.0}, False),
        ({"hand": EMPTY}, False),
        ({"above": 0.003}, False),
    ],
    ids=["noise", *[f"bottom {higher} mm higher" for higher in (1, 1.5, 3, 5)], "worn", "empty hand", "begun in it"],
)
def test_only_a_latch_that_a_held_peg_went_through_is_shown(seen, way, is_shown):
    curve, now = lowered(seen, **way)
    assert shows(curve, now) is is_shown


def test_a_peg_that_rests_nowhere_shows_nothing(seen):
    curve, now = lowered(seen)
    assert curve.signature(LATCH, now - 0.48) is None


@pytest.mark.parametrize(("height", "hand"), [(0.0, EMPTY), (0.01, HELD)], ids=["lost", "drawn out"])
def test_a_peg_that_is_lost_or_drawn_out_begins_anew(seen, height, hand):
    curve, now = lowered(seen)
    assert not shows(curve.after(scan(seen, height, 0.0, now, hand), None, LATCH), now + 1.0)


def drawn_up(curve, seen, now, height=1.1 * LIFTED):
    return curve.after(scan(seen, height, 0.0, now), None, LATCH)


def test_a_stroke_to_a_rest_is_kept_until_the_peg_is_released(seen):
    curve, now = lowered(seen)
    up = drawn_up(curve, seen, now)
    assert up.earlier == up.ways == curve.ways
    assert [way.heights for way in up.earlier] == [curve.heights]
    assert up.after(scan(seen, 0.003, 0.0, now, EMPTY), None, LATCH).earlier == ()


def test_a_stroke_without_a_firm_rest_is_not_kept(seen):
    """If it yields, it was not the bottom."""
    curve = StrokeCurve()
    for n, height in enumerate(np.arange(0.006, 0.0, -SPEED * PERIOD)):
        curve = curve.after(scan(seen, height, 0.0, n * PERIOD), None, LATCH)
    assert drawn_up(curve, seen, 1.0).earlier == ()
    curve, now = lowered(seen)
    deeper = scan(seen, -0.001, 0.0, now)
    gave_way = curve.after(deeper, pushing(deeper), LATCH)
    assert (curve.has_rested, gave_way.has_rested) == (True, False)
    assert drawn_up(gave_way, seen, now).earlier == ()


@pytest.mark.parametrize(
    ("rest", "counts"), [(0.9 * PLACE, True), (-0.9 * PLACE, True), (1.1 * PLACE, False), (-1.1 * PLACE, False)]
)
def test_ways_count_together_where_they_ended_at_the_same_height(seen, rest, counts):
    curve, now = lowered(seen)
    denied = way_down(shallow=0.001)
    lift = curve.heights[-1] + rest - denied.heights[-1]
    denied = InsertionStroke(tuple(height + lift for height in denied.heights), denied.forces)
    alone = curve.signature(LATCH, now)
    assert alone.is_sure
    assert (replace(curve, earlier=(denied,)).signature(LATCH, now) != alone) is counts


def test_no_more_ways_are_kept_than_are_needed(seen):
    curve, now = lowered(seen)
    many = replace(curve, earlier=tuple(way_down() for _ in range(MOST_WAYS)))
    up = drawn_up(many, seen, now)
    assert len(up.earlier) == MOST_WAYS
    assert up.earlier[-1].heights == curve.heights


PUSH = 0.008


def looked_down(looks, seen, stamp, beyond=0.0, **way):
    """Return the looks after a way down and a rest, and the time after it, s."""
    for now in descent(seen, stamp, **way):
        if looks.is_shown or looks.is_lifting:
            break
        looks, stamp = looks.after(now, pushing(now), LATCH, beyond).pulling(PUSH, PERIOD), now.stamp + PERIOD
    return looks, stamp


def lifted(looks, seen, stamp):
    """Return the looks after the hand has been drawn up as they ask for."""
    height = 0.0
    while looks.is_lifting:
        height += SPEED * PERIOD
        now = scan(seen, height, -5.0, stamp)
        looks = looks.after(now, replace(pushing(now), tip=now.tip + PUSH * UP), LATCH, 0.0).pulling(PUSH, PERIOD)
        stamp += PERIOD
    return looks, stamp, height


def test_a_peg_with_a_hidden_latch_is_drawn_up_and_pushed_again(seen):
    looks, stamp = looked_down(Looks(), seen, 0.0, rub=5.0)
    assert (looks.is_shown, looks.is_lifting, looks.missed, looks.is_over) == (False, True, 1, False)
    looks, stamp, height = lifted(looks, seen, stamp)
    assert height == pytest.approx(LATCH.height + BEFORE, abs=2.0 * SPEED * PERIOD)
    looks, _ = looked_down(looks, seen, stamp)
    assert looks.is_shown


def given_up_after(seen, **way):
    """Return the number of equal strokes after which a peg is given up, and whether its latch was detected."""
    looks, stamp = Looks(), 0.0
    for count in range(1, MOST_LOOKS + 1):
        looks, stamp = looked_down(looks, seen, stamp, **way)
        if looks.is_over or looks.is_shown:
            return count, looks.is_shown
        looks, stamp, _ = lifted(looks, seen, stamp)
    return MOST_LOOKS + 1, False


@pytest.mark.parametrize(
    ("way", "looks"),
    [({"wear": 1.0}, LEAST_LOOKS), ({"shallow": 0.001}, LEAST_LOOKS), ({"wear": 1.05 - FORCE_SHARE}, MOST_LOOKS)],
    ids=["no latch", "another bottom", "in doubt"],
)
def test_a_peg_is_given_up_after_some_looks(seen, way, looks):
    assert given_up_after(seen, **way) == (looks, False)


def test_a_rest_away_from_the_bottom_is_no_look(seen):
    looks, _ = looked_down(Looks(), seen, 0.0, wear=1.0, beyond=-1.01 * DOUBTED)
    assert (looks.missed, looks.is_lifting) == (0, False)


def test_fingers_that_slide_down_a_resting_peg_change_nothing(seen):
    looks, stamp = looked_down(Looks(), seen, 0.0, rest=25)
    before = looks.curve.signature(LATCH, stamp)
    for n in range(20):
        now = scan(seen, -SHEAR * REST - n * 1e-5, REST, stamp + n * PERIOD)
        looks = looks.after(now, pushing(now), LATCH, 0.0)
    assert before is not None
    assert looks.curve.signature(LATCH, stamp + 1.0) == before


def test_push_becomes_pull_no_faster_than_the_gate_bears(seen):
    looks = Looks().pulling(PUSH, PERIOD)
    assert looks.pull == -PUSH
    looks, pulls = replace(looks, missed=1, top=1.0), []
    for _ in range(100):
        looks = looks.pulling(PUSH, PERIOD)
        pulls.append(looks.pull)
    assert np.diff([-PUSH, *pulls]).max() <= TURNING_BACK * PERIOD + 1e-12
    assert pulls[-1] == PUSH
    looks = replace(looks, top=-math.inf).pulling(PUSH, PERIOD)
    assert looks.pull < PUSH


DETENT = Latch(kind="detent", force=5.0, height=0.003)
NOISES = ((0.3, 0.3), (1.0, 0.5), (1.0, 1.0))
"""White noise of the force per scan, N, up to the largest of `arm.wrench_noise`, and root mean square of the friction
force that wanders along the path, N; assumed, up to the same value."""
SCANS, WAY, FORCE_OF_BOTTOM = 70, 0.006, 11.0
"""Number of scans on the path, its length, m, and the force of the bottom, N, as in simulated insertions."""
SPREAD, SPREAD_OF_PLACE = 1.2, 1e-4
"""Largest factor of the latch's force, and standard deviation of its position, m, as in config/reality.toml."""
CURVES = 40


def is_seated(shallow: float, wear: float, noise: tuple[float, float], rng: np.random.Generator) -> bool:
    """Return True if a drawn part is judged as seated on one of its downward motions."""
    place = float(np.clip(rng.normal(0.0, SPREAD_OF_PLACE), -3.0 * SPREAD_OF_PLACE, 3.0 * SPREAD_OF_PLACE))
    share, ways = (1.0 - wear) * SPREAD ** rng.uniform(-1.0, 1.0), []
    for looks in range(1, MOST_LOOKS + 1):
        height = np.sort(np.concatenate([[0.0, WAY], rng.uniform(0.0, WAY, SCANS)]))
        walk = np.cumsum(rng.standard_normal(height.size))
        walk -= walk.mean()
        force = share * resistance(height + shallow - place, DETENT)
        force += noise[0] * rng.standard_normal(height.size) + noise[1] * walk / walk.std()
        force[0] = FORCE_OF_BOTTOM
        ways.append(InsertionStroke(tuple((height - SHEAR * force)[::-1].tolist()), tuple(force[::-1].tolist())))
        told = told_by(ways, DETENT)
        if told.is_sure or is_enough(looks, told):
            return told.is_sure
    return False


@pytest.mark.parametrize(
    ("shallow", "wear", "noises", "least", "most"),
    [
        (0.0, 0.0, NOISES, 39, CURVES),
        (0.0, 1.0, NOISES, 0, 0),
        (0.0015, 0.0, NOISES, 0, 0),
        (0.001, 0.0, NOISES[:2], 0, 0),
    ],
    ids=["seated", "worn out", "bottom 1.5 mm higher", "bottom 1 mm higher"],
)
def test_noise_alone_neither_hides_a_latch_nor_makes_one(shallow, wear, noises, least, most):
    rng = np.random.default_rng(1)
    for noise in noises:
        assert least <= sum(is_seated(shallow, wear, noise, rng) for _ in range(CURVES)) <= most
