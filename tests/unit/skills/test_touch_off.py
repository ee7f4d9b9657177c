"""Lowering a peg on a surface to measure its height, and the force of the touch."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import WrenchReversedError
from drivers.frames import UP
from drivers.quantities import Pose
from skills.catalogue import GRASP
from skills.contract import Interrupted, Reason
from skills.grasp_from_rack import ACROSS_RACK
from skills.motion import VALIDITY
from skills.touch_off import TouchOff, touch_off
from tests.fakes import HAND_DOWN, PERIOD
from tests.unit.skills.benches import WatchedArm, watched

CELL = load().cell
TRANSFER = CELL.params(GRASP).transfer
LENGTH, STIFFNESS = CELL.peg.length, TRANSFER.gains.translation
TOUCH_OFF = TouchOff()
PLACE = np.array([0.5, 0.02, 0.1])
OFFSET = 2.0
"""Force along z that the arm reports where nothing touches it, N."""


class Spring(WatchedArm):
    """An arm whose tip a surface stops, and that reports a share of what its own stiffness presses with."""

    reported = 1.0

    def follow(self, setpoint):
        super().follow(setpoint)
        self.force = (OFFSET + self.reported * max(STIFFNESS * (self.floor - setpoint.tip[2]), 0.0)) * UP


@pytest.fixture
def ctx():
    """Return the context of a hand whose peg ends 50 mm above a place, at which the surface lies."""
    ctx = watched(CELL, Pose(PLACE + (0.05 + LENGTH) * UP, HAND_DOWN), make=Spring)
    ctx.devices.arm.force, ctx.devices.arm.floor = OFFSET * UP, PLACE[2]
    return ctx


def down(ctx):
    """Return time and setpoint of each scan of the way down and of the rest: neither through free space nor back up."""
    told = [(now, setpoint) for now, setpoint in ctx.devices.arm.told if not setpoint.is_free]
    return [(now, setpoint) for now, setpoint in told if setpoint.twist is None or setpoint.twist.linear[2] < 0.0]


@pytest.mark.parametrize("height", [-0.008, 0.0, 0.005])
def test_a_surface_is_measured_and_the_peg_clear_afterwards(ctx, height):
    ctx.devices.arm.floor = PLACE[2] + height
    np.testing.assert_allclose(touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx), PLACE + height * UP, atol=1e-4)
    clear = PLACE + (max(height, 0.0) + TOUCH_OFF.clear) * UP
    assert ctx.devices.arm.tcp.position - LENGTH * UP == pytest.approx(clear, abs=1e-4)
    up = [setpoint for now, setpoint in ctx.devices.arm.told if now > down(ctx)[-1][0]]
    assert max(setpoint.twist.linear[2] for setpoint in up) <= TOUCH_OFF.speed + 1e-9


def test_the_peg_comes_down_slowly_until_the_surface_bears_it_and_rests(ctx):
    touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx)
    moving = [setpoint for _, setpoint in down(ctx) if setpoint.twist is not None]
    steps = -np.diff([setpoint.tip[2] for setpoint in moving])
    np.testing.assert_allclose(steps, TOUCH_OFF.speed * PERIOD, atol=1e-9)
    assert moving[0].tip[2] == pytest.approx(PLACE[2] + TOUCH_OFF.clear, abs=2 * TOUCH_OFF.speed * PERIOD)
    assert all(setpoint.twist.linear == pytest.approx(-TOUCH_OFF.speed * UP) for setpoint in moving)
    assert not any(setpoint.twist.angular.any() for setpoint in moving)
    # It then rests with the setpoint where it was.
    resting = [(now, setpoint) for now, setpoint in down(ctx) if setpoint.twist is None]
    assert len({setpoint.tip[2] for _, setpoint in resting}) == 1
    assert resting[-1][0] - resting[0][0] == pytest.approx(TOUCH_OFF.rest, abs=3 * PERIOD)
    # The mean force of the last scans was over the threshold, from what free air shows on, and hardly more.
    press = STIFFNESS * (PLACE[2] - resting[0][1].tip[2])
    least, scan = TOUCH_OFF.force, STIFFNESS * TOUCH_OFF.speed * PERIOD
    assert least < press < least + (TOUCH_OFF.scans + 1) * scan < TOUCH_OFF.most


def test_the_setpoint_leads_a_tip_held_by_friction_within_its_bound(ctx):
    """The arm does not report what it presses with, as if its joints took the force."""
    ctx.devices.arm.reported = 0.0
    assert touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx) is None
    assert min(setpoint.tip[2] for _, setpoint in down(ctx)) == pytest.approx(PLACE[2] - TOUCH_OFF.most / STIFFNESS)


def test_a_wrench_of_reversed_sign_ends_the_touch(ctx):
    ctx.devices.arm.reported = -1.0
    with pytest.raises(WrenchReversedError, match=r"^arm: reports \d+ N downwards while it presses down"):
        touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx)


def test_where_there_is_no_surface_the_peg_turns_back(ctx):
    ctx.devices.arm.floor = -np.inf
    assert touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx) is None
    lowest = min(setpoint.tip[2] for _, setpoint in down(ctx))
    assert lowest == pytest.approx(PLACE[2] - TOUCH_OFF.deepest, abs=TOUCH_OFF.speed * PERIOD)
    assert ctx.devices.arm.tcp.position - LENGTH * UP == pytest.approx(PLACE + TOUCH_OFF.clear * UP)


def test_one_upright_motion_with_the_gains_of_the_way(ctx):
    touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx)
    assert len({setpoint.id for _, setpoint in down(ctx)}) == 1
    for now, setpoint in down(ctx):
        np.testing.assert_array_equal(setpoint.axis, UP)
        np.testing.assert_array_equal(setpoint.roll, ACROSS_RACK)
        np.testing.assert_array_equal(setpoint.stiffness, TRANSFER.gains.stiffness())
        np.testing.assert_array_equal(setpoint.damping_ratio, TRANSFER.gains.damping_ratios())
        np.testing.assert_array_equal(setpoint.tip[:2], PLACE[:2])
        assert setpoint.valid_until == pytest.approx(now + VALIDITY)
        assert setpoint.in_hand.length == LENGTH
        assert setpoint.posture is not None


def test_a_peg_that_is_lost_on_the_way_down_ends_it_there(ctx):
    def lose(seen, held):
        if seen.tip[2] < PLACE[2] + 0.5 * TOUCH_OFF.clear:
            ctx.devices.gripper.has_peg = False

    ctx.callbacks = replace(ctx.callbacks, record=lose)
    with pytest.raises(Interrupted) as ended:
        touch_off(PLACE, TRANSFER, TOUCH_OFF, ctx)
    assert ended.value.reason is Reason.LOST_GRASP
    assert ctx.devices.arm.tcp.position[2] - LENGTH > PLACE[2] + 0.4 * TOUCH_OFF.clear
