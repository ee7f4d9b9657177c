"""The force of a latch against depth: distinguished from noise, another bottom and a peg that is not held."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP
from drivers.quantities import GripperState, ImpedanceSetpoint, Wrench
from skills.seating.decision import LEAST_PUSH
from skills.seating.latch_likelihood import GRID, PLACE, SHEAR, Way, resistance
from skills.seating.signature import LIFTED, MOST_WAYS, Curve
from tests.fakes import Rig
from tests.unit.skills.seating.test_latch_likelihood import BIAS, LATCH, way_down

PERIOD, SPEED = 0.01, 0.01
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


def lowered(seen, latch=LATCH, *, shallow=0.0, wear=0.0, noise=0.0, above=0.006, hand=HELD):
    """Return the curve after a way down at an even speed to a bottom that is `shallow` higher than stated, and half a second of rest on it."""
    rng, curve, stamp = np.random.default_rng(1), Curve(), 0.0
    way = np.concatenate([np.arange(above, 0.0, -SPEED * PERIOD), np.zeros(50)])
    for height in way:
        felt = (1.0 - wear) * float(resistance(np.array(height + shallow), latch)) if height > 0.0 else 8.0
        force = felt + BIAS + noise * float(rng.standard_normal())
        # The hand goes further down by the deflection of the pads.
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


def test_a_way_down_that_ended_in_a_rest_is_kept_where_the_peg_is_drawn_up_and_not_where_it_is_let_go(seen):
    curve, now = lowered(seen)
    up = drawn_up(curve, seen, now)
    assert up.earlier == up.ways == curve.ways
    assert [way.heights for way in up.earlier] == [curve.heights]
    assert up.after(scan(seen, 0.003, 0.0, now, EMPTY), None, LATCH).earlier == ()


def test_a_way_that_ended_in_no_rest_or_gave_way_is_not_kept(seen):
    """If it yields, it was not the bottom."""
    curve = Curve()
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
    denied = Way(tuple(height + lift for height in denied.heights), denied.forces)
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
