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


def drawn_up(curve, seen, now, height=1.1 * LIFTED):
    return curve.after(scan(seen, height, 0.0, now), None, LATCH)


def test_a_way_down_that_ended_in_a_rest_is_kept_where_the_peg_is_drawn_up_and_not_where_it_is_let_go(seen):
    curve, now = lowered(seen)
    up = drawn_up(curve, seen, now)
    assert up.earlier == up.ways == curve.ways
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
