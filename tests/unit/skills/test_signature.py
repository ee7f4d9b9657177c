"""The force of a latch against depth: told from noise, from a bottom that is another, and from a peg that is not held."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config import load
from drivers.frames import UP
from drivers.parts import Latch
from drivers.quantities import GripperState, ImpedanceSetpoint, Wrench
from skills.seating import LEAST_PUSH
from skills.signature import FORCE_SHARE, GRID, PLACE, SHEAR, Curve, Signature, fitted, resistance
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
    return found is not None and found.is_of(LATCH)


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
    above = np.arange(0.0, 0.0045, GRID)
    assert not fitted(above, np.zeros(len(above)), LATCH).is_of(LATCH)
    assert not fitted(above, -resistance(above, LATCH), LATCH).is_of(LATCH)


@pytest.mark.parametrize(("factor", "is_of"), [(0.99, False), (1.01, True)])
def test_force_and_place_are_judged_at_their_limits(factor, is_of):
    assert Signature(factor * FORCE_SHARE * LATCH.force, 0.0, 0.1).is_of(LATCH) is is_of
    assert Signature(LATCH.force / FORCE_SHARE / factor, 0.0, 0.1).is_of(LATCH) is is_of
    assert Signature(LATCH.force, PLACE / factor, 0.1).is_of(LATCH) is is_of


def test_a_push_too_weak_to_tell_a_bottom_shows_none(seen):
    now = scan(seen, 0.0, 0.0, 0.0)
    weak = replace(pushing(now), tip=now.tip - 0.99 * LEAST_PUSH / 1000.0 * UP)
    curve = lowered(seen)[0].after(now, weak, LATCH)
    assert curve.signature(LATCH, 10.0) is None
