"""How a hand lets go of a seated peg, and what it says of the peg that it leaves."""

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, rotation_about
from drivers.quantities import GripperState, ImpedanceSetpoint, Pose, SwitchState
from skills.catalogue import RELEASE
from skills.contract import Outcome, Reason
from skills.motion import VALIDITY
from skills.release_and_retract import let_go, run
from tests.fakes import HAND_DOWN, PERIOD, FakeArm, FakeClock, FakeGripper, context_of

CELL = load().cell
PARAMS = CELL.params(RELEASE)
PLACE = np.array([*CELL.hole.centre[:2], CELL.hole.centre[2] + 0.03])
SLANT = rotation_about(UP, 0.3) @ HAND_DOWN
THICKNESS = CELL.peg.part.thickness


class SlowHand(FakeGripper):
    """A hand whose fingers move for a set time after the command to open, s, and then stand this far apart, m."""

    def __init__(self, clock: FakeClock, opens_for: float = 0.0, opens_to: float | None = None) -> None:
        super().__init__(THICKNESS)
        self.clock, self.opens_for, self.opens_to = clock, opens_for, opens_to
        self.told = -np.inf

    def release(self, width: float) -> None:
        super().release(width if self.opens_to is None else self.opens_to)
        self.told = self.clock.now()

    def read(self) -> GripperState:
        is_moving = self.clock.now() - self.told < self.opens_for - 1e-9
        return GripperState(THICKNESS if is_moving else self.width, self.force > 0.0, is_moving)


@pytest.fixture
def make():
    """Return what makes the context of a hand that grips a seated peg."""

    def made(**how):
        clock = FakeClock()
        arm, hand = FakeArm(clock), SlowHand(clock, **how)
        arm.tcp = Pose(PLACE.copy(), SLANT)
        hand.grip(30.0)
        ctx = context_of(CELL, arm, hand)
        ctx.devices.switch.state = SwitchState.CLOSED
        return ctx

    return made


def test_the_hand_opens_where_it_is_and_draws_straight_back_up_without_turning(make):
    ctx = make()
    ctx.devices.clock.wait_until(3.0)
    heights, release = [], ctx.devices.gripper.release
    ctx.devices.gripper.release = lambda width: (heights.append(ctx.devices.arm.tcp.position[2]), release(width))
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason, ended.stayed) == (Outcome.SUCCESS, Reason.NONE, True)
    assert (heights, ctx.devices.gripper.width) == ([PLACE[2]], PARAMS.opening)
    np.testing.assert_allclose(ctx.devices.arm.tcp.position, PLACE + PARAMS.height * UP, atol=1e-9)
    np.testing.assert_allclose(ctx.devices.arm.tcp.rotation, SLANT, atol=1e-9)
    assert ended.elapsed == pytest.approx(ctx.devices.clock.now() - 3.0, abs=PERIOD)


@pytest.mark.parametrize(("when", "reason"), [(0.05, Reason.NOT_SEATED), (None, Reason.NONE)])
def test_a_peg_that_came_along_with_the_hand_was_not_left_seated(make, when, reason):
    ctx = make()
    if when is not None:
        ctx.devices.clock.at.append((when, lambda: setattr(ctx.devices.switch, "state", SwitchState.OPEN)))
    ended = run(PARAMS, ctx)
    assert ended.reason is reason
    assert (ended.outcome, ended.stayed) == (
        (Outcome.SUCCESS, True) if reason is Reason.NONE else (Outcome.FAILURE, False)
    )


@pytest.mark.parametrize(("after", "reason"), [(0.4, Reason.NONE), (2.0, Reason.NOT_SEATED)])
def test_a_switch_that_does_not_answer_at_the_end_is_waited_for(make, after, reason):
    ctx = make()
    ctx.devices.switch.state = SwitchState.UNKNOWN
    drawn_back = 1.0  # s, more than the way takes
    ctx.devices.clock.at.append((drawn_back + after, lambda: setattr(ctx.devices.switch, "state", SwitchState.CLOSED)))
    assert run(PARAMS, ctx).reason is reason


def test_a_hole_without_a_switch_asks_none(make):
    ctx = make()
    force = load(
        sets=["hole.evidence=force", "hole.latch.kind=detent", "hole.latch.force=5.0", "hole.latch.height=0.003"]
    )
    ctx.job, ctx.devices.switch.state = force.cell.job(), SwitchState.UNKNOWN
    assert run(PARAMS, ctx).outcome is Outcome.SUCCESS


def test_a_hand_that_does_not_open_is_not_drawn_away(make):
    ctx = make(opens_to=THICKNESS)
    ended = run(PARAMS, ctx)
    assert (ended.outcome, ended.reason, ended.stayed) == (Outcome.FAILURE, Reason.STILL_HELD, True)
    np.testing.assert_array_equal(ctx.devices.arm.tcp.position, PLACE)


@pytest.mark.parametrize(("takes", "is_open"), [(0.2, True), (PARAMS.opening_time + 1.0, False)])
def test_a_hand_is_waited_for_as_long_as_its_fingers_may_take(make, takes, is_open):
    ctx = make(opens_for=takes)
    assert let_go(PARAMS.opening, PARAMS.opening_time, ctx) is is_open
    assert ctx.devices.clock.now() == pytest.approx(min(takes, PARAMS.opening_time), abs=2 * PERIOD)


def test_the_arm_keeps_its_setpoint_at_rest_while_the_fingers_move(make):
    ctx = make(opens_for=0.3)
    ctx.follow(ImpedanceSetpoint(5, PLACE, UP, np.full(6, 100.0), np.ones(6), 0.05, roll=SLANT[:, 2]))
    kept, follow = [], ctx.devices.arm.follow
    ctx.devices.arm.follow = lambda setpoint: (kept.append((ctx.devices.clock.now(), setpoint)), follow(setpoint))
    let_go(PARAMS.opening, PARAMS.opening_time, ctx)
    assert len(kept) == pytest.approx(0.3 / PERIOD, abs=1)
    assert all(setpoint.valid_until == pytest.approx(now + VALIDITY) for now, setpoint in kept)
    assert {setpoint.id for _, setpoint in kept} == {5}


def test_letting_go_goes_without_the_limits_of_force_and_workspace(make):
    ctx = make(opens_for=0.1)
    ctx.devices.arm.force = np.array([0.0, 0.0, 2.0 * CELL.limits.force])
    assert let_go(PARAMS.opening, PARAMS.opening_time, ctx)
