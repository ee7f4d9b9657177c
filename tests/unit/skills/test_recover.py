import numpy as np
import pytest

from cell.config import load
from drivers.frames import UP
from drivers.quantities import Pose
from skills import grasp_from_rack
from skills.catalogue import GRASP
from skills.contract import Interrupted, Outcome, Reason, Request
from skills.pull_out import SHARE, SPEED, pull_out
from skills.recover import run
from skills.surface import Plane
from tests.fakes import HAND_DOWN, PERIOD, FakeArm, FakeClock, FakeGripper, context_of

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


@pytest.mark.parametrize("normal", [UP, np.array([0.0, 0.06, 1.0]) / np.linalg.norm([0.0, 0.06, 1.0])])
def test_a_peg_is_pulled_along_the_normal_of_the_plate_that_was_felt_and_straight_up_from_one_that_was_not(ctx, normal):
    ctx.surface = None if normal is UP else Plane(np.array(CONFIG.hole.centre), normal)
    tip, ways = ctx.observe().tip, []
    ctx.record = lambda seen, held: ways.append(held.tip - tip) if held is not None else None
    stuck = pull_out(CONFIG.hole.centre[2], PARAMS.transfer.gains, ctx)
    assert stuck == pytest.approx(tip)
    lead = SHARE * ctx.limits.force / PARAMS.transfer.gains.translation
    assert ways[0] == pytest.approx(SPEED * PERIOD * normal)
    assert ways[-1] == pytest.approx(lead * normal)


def test_where_the_plate_was_felt_is_forgotten_with_the_next_grasp(ctx):
    ctx.surface = Plane(np.array(CONFIG.hole.centre), UP)
    ctx.arm.is_blocked, ctx.gripper.has_peg = False, False
    ctx.arm.tcp = Pose(np.array([0.45, 0.0, 0.3]), HAND_DOWN)
    grasp_from_rack.run(CONFIG.params(GRASP), ctx)
    assert ctx.surface is None
