"""How a hand lets go of a seated peg, and what it says of the peg that it leaves."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, rotation_about
from drivers.quantities import GripperState, ImpedanceSetpoint, Pose, SwitchState
from skills.catalogue import RELEASE
from skills.contract import Outcome, Reason, Request
from skills.flow import run_stage
from skills.motion import VALIDITY
from skills.release_and_retract import HAND_TIME, let_go, run
from tests.fakes import HAND_DOWN, PERIOD, FakeClock, context_of
from tests.unit.skills.benches import WatchedArm, WatchedHand

CELL = load().cell
PARAMS = CELL.params(RELEASE)
PLACE = np.array([*CELL.hole.centre[:2], CELL.hole.centre[2] + 0.03])
SLANT = rotation_about(UP, 0.3) @ HAND_DOWN
THICKNESS = CELL.peg.part.thickness


class SlowHand(WatchedHand):
    """A hand whose fingers move for a set time after the command to open, s."""

    def __init__(self, arm: WatchedArm, opens_for: float, opens: bool) -> None:
        super().__init__(THICKNESS, arm)
        self.opens_for, self.opens, self.told = opens_for, opens, -np.inf

    def release(self, width: float) -> None:
        super().release(width)
        self.told = self.arm.clock.now()

    def read(self) -> GripperState:
        is_moving = self.arm.clock.now() - self.told < self.opens_for - 1e-9
        return GripperState(THICKNESS if is_moving else self.width, self.force > 0.0, is_moving)


def make(opens_for=0.0, opens=True):
    """Return the context of a hand that grips a seated peg."""
    arm = WatchedArm(FakeClock())
    arm.tcp = Pose(PLACE.copy(), SLANT)
    hand = SlowHand(arm, opens_for, opens)
    hand.grip(30.0)
    ctx = context_of(CELL, arm, hand)
    ctx.devices.switch.state = SwitchState.CLOSED
    return ctx


def test_the_hand_opens_where_it_is_and_draws_straight_up():
    ctx = make()
    ctx.devices.clock.wait_until(3.0)
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason, ended.stayed) == (Outcome.SUCCESS, Reason.NONE, True)
    assert ctx.devices.gripper.opened == [(PARAMS.opening, pytest.approx(PLACE))]
    np.testing.assert_allclose(ctx.devices.arm.tcp.position, PLACE + PARAMS.height * UP, atol=1e-9)
    np.testing.assert_allclose(ctx.devices.arm.tcp.rotation, SLANT, atol=1e-9)
    assert ended.elapsed == pytest.approx(ctx.devices.clock.now() - 3.0, abs=PERIOD)


@pytest.mark.parametrize(("asked", "opened"), [(Request.HOLD, [2.0]), (Request.STOP, [])])
def test_a_request_before_the_first_scan_comes_before_the_hand_opens(asked, opened):
    ctx = make()
    clock, hand = ctx.devices.clock, ctx.devices.gripper
    ctx.callbacks = replace(ctx.callbacks, poll=lambda: asked if clock.now() < 2.0 else Request.RUN)
    run_stage("release_and_retract", partial(run, PARAMS), ctx)
    assert [hand.told] * len(hand.opened) == pytest.approx(opened, abs=PERIOD)


@pytest.mark.parametrize(
    ("state", "changes", "reason"),
    [
        (SwitchState.CLOSED, (9.0, SwitchState.CLOSED), Reason.NONE),
        (SwitchState.CLOSED, (0.05, SwitchState.OPEN), Reason.NOT_SEATED),
        (SwitchState.UNKNOWN, (1.1, SwitchState.CLOSED), Reason.NONE),
        (SwitchState.UNKNOWN, (3.0, SwitchState.CLOSED), Reason.NOT_SEATED),
    ],
    ids=["stays", "comes along", "answers late", "answers too late"],
)
def test_a_peg_counts_as_left_seated_if_the_switch_confirms(state, changes, reason):
    """The hand is drawn back within a second."""
    ctx, (when, later) = make(), changes
    ctx.devices.switch.state = state
    ctx.devices.clock.at.append((when, lambda: setattr(ctx.devices.switch, "state", later)))
    ended, stayed = run(PARAMS, ctx), reason is Reason.NONE
    assert (ended.reason, ended.stayed) == (reason, stayed)
    assert ended.outcome is (Outcome.SUCCESS if stayed else Outcome.FAILURE)


def test_a_hole_without_a_switch_asks_none():
    ctx = make()
    force = load(sets=["hole.evidence=force", "hole.latch={kind='detent',force=5.0,height=0.003}"])
    ctx.job, ctx.devices.switch.state = force.cell.job(), SwitchState.UNKNOWN
    assert run(PARAMS, ctx).outcome is Outcome.SUCCESS


def test_a_hand_that_does_not_open_is_not_drawn_away():
    ctx = make(opens=False)
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason, ended.stayed) == (Outcome.FAILURE, Reason.STILL_HELD, True)
    np.testing.assert_array_equal(ctx.devices.arm.tcp.position, PLACE)


@pytest.mark.parametrize(("takes", "is_open"), [(0.2, True), (HAND_TIME + 1.0, False)])
def test_let_go_waits_for_the_fingers(takes, is_open):
    ctx = make(opens_for=takes)
    assert let_go(PARAMS.opening, ctx) is is_open
    assert ctx.devices.clock.now() == pytest.approx(min(takes, HAND_TIME), abs=2 * PERIOD)


def test_the_arm_keeps_its_setpoint_at_rest_while_the_fingers_move():
    ctx = make(opens_for=0.3)
    ctx.follow(ImpedanceSetpoint(5, PLACE, UP, np.full(6, 100.0), np.ones(6), 0.05, roll=SLANT[:, 2]))
    let_go(PARAMS.opening, ctx)
    kept = ctx.devices.arm.told[1:]
    assert len(kept) == pytest.approx(0.3 / PERIOD, abs=1)
    assert all(setpoint.valid_until == pytest.approx(now + VALIDITY) for now, setpoint in kept)
    assert {setpoint.id for _, setpoint in kept} == {5}


def test_letting_go_goes_without_the_limits_of_force_and_workspace():
    ctx = make(opens_for=0.1)
    ctx.devices.arm.force = np.array([0.0, 0.0, 2.0 * CELL.limits.force])
    assert let_go(PARAMS.opening, ctx)
