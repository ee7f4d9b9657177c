import numpy as np
import pytest

from cell.config import load
from drivers.quantities import Pose
from skills.contract import Interrupted, Outcome, Reason, Request
from skills.recover import run
from tests.fakes import HAND_DOWN, FakeArm, FakeClock, FakeGripper, context_of

CONFIG = load().cell
PARAMS = CONFIG.recover


@pytest.fixture
def ctx():
    """Return the context of a fake cell whose hand holds a peg that stands 20 mm deep in something and does not come out."""
    clock = FakeClock()
    arm, hand = FakeArm(clock), FakeGripper(CONFIG.peg.part.thickness)
    arm.tcp = Pose(np.array([*CONFIG.hole.centre[:2], CONFIG.hole.centre[2] + CONFIG.peg.length - 0.02]), HAND_DOWN)
    arm.is_blocked = True
    hand.grip(30.0)
    return context_of(CONFIG, arm, hand)


def test_a_peg_that_slips_out_of_the_hand_while_it_is_pulled_is_left_behind_by_an_open_hand(ctx):
    def slip():
        ctx.gripper.has_peg, ctx.arm.is_blocked = False, False

    ctx.clock.at.append((0.5, slip))
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert ctx.gripper.width == PARAMS.opening
    assert ctx.arm.tcp.position[:2] == pytest.approx(PARAMS.bin[:2])


def test_a_stop_while_the_peg_is_pulled_stops(ctx):
    ctx.poll = lambda: Request.STOP if ctx.clock.now() > 0.5 else Request.RUN
    with pytest.raises(Interrupted):
        run(PARAMS, ctx)
    assert ctx.gripper.read().is_gripping


def test_a_hand_that_is_around_a_peg_in_the_hole_without_gripping_opens_before_it_is_drawn_up(ctx):
    ctx.gripper.has_peg, ctx.arm.is_blocked = False, False
    low = ctx.arm.tcp.position[2]
    heights, release = [], ctx.gripper.release

    def released(width):
        heights.append(ctx.arm.tcp.position[2])
        release(width)

    ctx.gripper.release = released
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert heights[0] == pytest.approx(low, abs=1e-3)


def test_a_hand_that_stays_around_a_peg_in_the_hole_stays_where_it_is(ctx):
    ctx.gripper.has_peg, ctx.arm.is_blocked = False, False
    ctx.gripper.release = lambda width: None
    low = ctx.arm.tcp.position[2]
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason) == (Outcome.FAILURE, Reason.STILL_HELD)
    assert ctx.arm.tcp.position[2] == pytest.approx(low, abs=1e-3)
