"""How the hand takes a peg from its slot, what it refuses to take, and what it forgets of the peg before."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import SkinUntrustedError
from drivers.frames import UP, rotation_about
from drivers.quantities import Pose
from skills.catalogue import GRASP
from skills.contract import Outcome, Reason
from skills.grasp_from_rack import ACROSS_RACK, run
from skills.held_peg import HeldPeg
from skills.search.surface import Plane
from tests.fakes import HAND_DOWN, PERIOD
from tests.unit.skills.benches import watched

CELL = load().cell
PARAMS, RACK = CELL.params(GRASP), CELL.rack
START = np.array([0.45, 0.0, 0.35])


@pytest.fixture
def ctx():
    return watched(CELL, Pose(START, HAND_DOWN), grip=0.0)


def grip_at(slot):
    """Return the place of the finger centre where it closes on the peg of a slot, which stands on its floor, m."""
    x, y, z = RACK.first
    return np.array([x, y + slot * RACK.pitch, z - RACK.depth + CELL.peg.length])


@pytest.mark.parametrize("slot", [0, 1, RACK.slots + 1])
def test_the_hand_takes_the_peg_of_its_slot_and_lifts_it(ctx, slot):
    ctx.job = ctx.job.model_copy(update={"slot": slot})
    ctx.perception.estimator.theta = 0.04
    ctx.peg = HeldPeg(measured=0.003, grip_share=0.5, surface=Plane(np.zeros(3), UP))
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason, ended.width) == (Outcome.SUCCESS, Reason.NONE, CELL.peg.part.thickness)
    assert (ended.elapsed, ended.theta) == pytest.approx((ctx.devices.clock.now(), 0.04), abs=PERIOD)
    assert (ctx.peg.measured, ctx.peg.grip_share, ctx.peg.surface) == (None, 1.0, None)  # of the peg before
    assert ctx.devices.gripper.opened == [(PARAMS.opening, pytest.approx(START))]
    assert ctx.devices.gripper.closed == [(PARAMS.force, pytest.approx(grip_at(slot % RACK.slots), abs=1e-6))]
    np.testing.assert_allclose(
        ctx.devices.arm.tcp.position, grip_at(slot % RACK.slots) + PARAMS.clearance * UP, atol=1e-6
    )


def test_the_peg_leaves_its_slot_straight_up_and_slowly(ctx):
    run(PARAMS, ctx)
    drawn = [setpoint for _, setpoint in ctx.devices.arm.told if setpoint.twist is not None and not setpoint.is_free]
    heights = np.array([setpoint.tip[2] for setpoint in drawn])
    np.testing.assert_allclose(np.diff(heights), PARAMS.drawing_speed * PERIOD, atol=1e-9)
    assert heights[0] == pytest.approx(grip_at(0)[2], abs=1e-3)
    assert heights[-1] == pytest.approx(grip_at(0)[2] + RACK.depth, abs=2 * PARAMS.drawing_speed * PERIOD)
    assert all(setpoint.tip[:2] == pytest.approx(grip_at(0)[:2]) for setpoint in drawn)
    assert all(setpoint.twist.linear == pytest.approx(PARAMS.drawing_speed * UP) for setpoint in drawn)


def test_an_empty_slot_is_a_missed_grasp_and_the_hand_opens_again(ctx):
    ctx.devices.gripper.has_peg = False
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason, ended.width) == (Outcome.FAILURE, Reason.MISSED_GRASP, 0.0)
    assert ctx.devices.gripper.width == PARAMS.opening
    np.testing.assert_allclose(ctx.devices.arm.tcp.position, grip_at(0), atol=1e-6)


@pytest.mark.parametrize("wider", [0.9, -0.9, 1.1, -1.1])
def test_only_what_is_as_wide_as_the_peg_is_the_peg(ctx, wider):
    ctx.devices.gripper.peg_width += wider * PARAMS.width_tolerance
    ended = run(PARAMS, ctx)
    assert ended.reason is (Reason.NONE if abs(wider) < 1.0 else Reason.MISSED_GRASP)


def test_a_peg_that_stays_in_its_slot_is_a_lost_grasp(ctx):
    half_drawn = grip_at(0)[2] + 0.5 * RACK.depth

    def slip(seen, held):
        if ctx.devices.gripper.force > 0.0 and seen.arm.tcp.position[2] > half_drawn:
            ctx.devices.gripper.has_peg = False

    ctx.callbacks = replace(ctx.callbacks, record=slip)
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.LOST_GRASP)
    assert ctx.devices.gripper.width == PARAMS.opening


@pytest.mark.parametrize(
    ("off", "aslant", "closes"), [(0.9, 0, True), (1.1, 0, False), (0, 0.9, True), (0, 1.1, False)]
)
def test_a_hand_that_does_not_get_to_the_slot_does_not_close(ctx, off, aslant, closes):
    """Over the slot something holds the hand, whatever the command."""
    beside = Pose(
        grip_at(0) + np.array([off * PARAMS.near, 0.0, 0.0]),
        rotation_about(ACROSS_RACK, aslant * PARAMS.askew) @ HAND_DOWN,
    )
    arm, follow = ctx.devices.arm, ctx.devices.arm.follow

    def followed(setpoint):
        follow(setpoint)
        arm.tcp = beside if setpoint.integral_gain > 0.0 else arm.tcp

    arm.follow = followed
    ended = run(PARAMS, ctx)
    assert bool(ctx.devices.gripper.closed) == closes
    assert (ended.reason is Reason.MISSED_GRASP) != closes


def test_a_low_hand_rises_before_it_turns(ctx):
    run(PARAMS, ctx)
    assert max(each.tip[2] for _, each in ctx.devices.arm.told) <= START[2] + 1e-9
    low, aslant = np.array([0.5, 0.1, 0.12]), rotation_about(UP, 0.5) @ HAND_DOWN
    ctx = watched(CELL, Pose(low, aslant), grip=0.0)
    run(PARAMS, ctx)
    told = [each for _, each in ctx.devices.arm.told]
    rising = [each for each in told if each.id == told[0].id]
    assert all(each.tip[:2] == pytest.approx(low[:2]) for each in rising)
    assert rising[-1].tip[2] == pytest.approx(grip_at(0)[2] + PARAMS.clearance, abs=1e-6)
    assert all(each.roll == pytest.approx(aslant[:, 2]) for each in rising)


def test_a_skin_without_a_print_leaves_the_peg_in_its_slot(ctx):
    ctx.perception.estimator.is_healthy = False
    with pytest.raises(SkinUntrustedError):
        run(PARAMS, ctx)
    assert ctx.devices.gripper.width == PARAMS.opening
    np.testing.assert_allclose(ctx.devices.arm.tcp.position, grip_at(0), atol=1e-6)
