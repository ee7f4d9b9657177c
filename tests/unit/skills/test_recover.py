from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, rotation_about
from drivers.quantities import Pose, SwitchState
from skills import grasp_from_rack
from skills.catalogue import GRASP
from skills.contract import Interrupted, Outcome, Reason, Request
from skills.held_peg import HeldPeg
from skills.pull_out import SHARE, Pull, pull_out
from skills.recover import CLEAR, MARGIN, run
from skills.search.surface import Plane
from tests.fakes import HAND_DOWN, PERIOD, FakeArm, FakeClock, FakeGripper, context_of

CONFIG = load().cell
PARAMS = CONFIG.recover
PULL = Pull()


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
        ctx.devices.gripper.has_peg, ctx.devices.arm.is_blocked = False, False

    ctx.devices.clock.at.append((0.5, slip))
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert ctx.devices.gripper.width == PARAMS.opening
    assert ctx.devices.arm.tcp.position[:2] == pytest.approx(PARAMS.bin[:2])


def test_a_stop_while_the_peg_is_pulled_stops(ctx):
    ctx.callbacks = replace(ctx.callbacks, poll=lambda: Request.STOP if ctx.devices.clock.now() > 0.5 else Request.RUN)
    with pytest.raises(Interrupted):
        run(PARAMS, ctx)
    assert ctx.devices.gripper.read().is_gripping


def test_a_hand_that_is_around_a_peg_in_the_hole_without_gripping_opens_before_it_is_drawn_up(ctx):
    ctx.devices.gripper.has_peg, ctx.devices.arm.is_blocked = False, False
    low = ctx.devices.arm.tcp.position[2]
    heights, release = [], ctx.devices.gripper.release

    def released(width):
        heights.append(ctx.devices.arm.tcp.position[2])
        release(width)

    ctx.devices.gripper.release = released
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert heights[0] == pytest.approx(low, abs=1e-3)


def test_a_hand_that_stays_around_a_peg_in_the_hole_stays_where_it_is(ctx):
    ctx.devices.gripper.has_peg, ctx.devices.arm.is_blocked = False, False
    ctx.devices.gripper.release = lambda width: None
    low = ctx.devices.arm.tcp.position[2]
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason) == (Outcome.FAILURE, Reason.STILL_HELD)
    assert ctx.devices.arm.tcp.position[2] == pytest.approx(low, abs=1e-3)


@pytest.mark.parametrize("normal", [UP, np.array([0.0, 0.06, 1.0]) / np.linalg.norm([0.0, 0.06, 1.0])])
def test_a_peg_is_pulled_along_the_normal_of_the_plate_that_was_felt_and_straight_up_from_one_that_was_not(ctx, normal):
    ctx.peg = HeldPeg(surface=None if normal is UP else Plane(np.array(CONFIG.hole.centre), normal))
    tip, ways = ctx.observe().tip, []
    ctx.callbacks = replace(
        ctx.callbacks, record=lambda seen, held: ways.append(held.tip - tip) if held is not None else None
    )
    stuck = pull_out(CONFIG.hole.centre[2], PULL, PARAMS.transfer.gains, ctx)
    assert stuck == pytest.approx(tip)
    lead = SHARE * ctx.limits.force / PARAMS.transfer.gains.translation
    assert ways[0] == pytest.approx(PULL.speed * PERIOD * normal)
    assert ways[-1] == pytest.approx(lead * normal)


def test_where_the_plate_was_felt_is_forgotten_with_the_next_grasp(ctx):
    ctx.peg = HeldPeg(surface=Plane(np.array(CONFIG.hole.centre), UP))
    ctx.devices.arm.is_blocked, ctx.devices.gripper.has_peg = False, False
    ctx.devices.arm.tcp = Pose(np.array([0.45, 0.0, 0.3]), HAND_DOWN)
    grasp_from_rack.run(CONFIG.params(GRASP), ctx)
    assert ctx.peg.surface is None


@pytest.fixture
def free(ctx):
    """Return the same context with an arm that reaches each setpoint at once, and the places at which the hand was commanded to open."""
    ctx.devices.arm.is_blocked = False
    opened, release = [], ctx.devices.gripper.release
    ctx.devices.gripper.release = lambda width: (
        opened.append((width, ctx.devices.arm.tcp.position.copy())),
        release(width),
    )
    return ctx, opened


def put(ctx, height):
    """Put the end of the held peg so high above the plate, m."""
    place = np.array([*CONFIG.hole.centre[:2], CONFIG.hole.centre[2] + CONFIG.peg.length + height])
    ctx.devices.arm.tcp = Pose(place, HAND_DOWN)
    return place


def test_a_held_peg_in_the_air_is_drawn_up_and_dropped_into_the_bin_and_nowhere_else(free):
    ctx, opened = free
    ctx.devices.clock.wait_until(5.0)
    start = put(ctx, 0.1)
    way = []
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, held: way.append(seen.arm.tcp))
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.SUCCESS, Reason.NONE, True)
    assert result.elapsed == pytest.approx(ctx.devices.clock.now() - 5.0)
    assert [width for width, _ in opened] == [PARAMS.opening]
    assert opened[0][1] == pytest.approx(PARAMS.bin, abs=1e-6)
    assert -ctx.devices.arm.tcp.rotation[:, 0] == pytest.approx(UP, abs=1e-6)
    assert ctx.devices.arm.tcp.rotation[:, 2] == pytest.approx(grasp_from_rack.ACROSS_RACK, abs=1e-6)
    up = [tcp for tcp in way if tcp.position[:2] == pytest.approx(start[:2], abs=1e-9)]
    assert up[-1].position[2] == pytest.approx(start[2] + PARAMS.height, abs=1e-3)


@pytest.mark.parametrize(("height", "pulls"), [(0.9 * CLEAR, True), (1.1 * CLEAR, False)])
def test_a_peg_whose_end_may_touch_the_plate_is_pulled_along_the_hole_first(free, height, pulls):
    ctx, opened = free
    put(ctx, height)
    told, follow = [], ctx.devices.arm.follow
    ctx.devices.arm.follow = lambda setpoint: (told.append(setpoint), follow(setpoint))
    result = run(PARAMS, ctx)
    assert (result.outcome, result.dropped) == (Outcome.SUCCESS, True)
    assert any(setpoint.in_hand is not None for setpoint in told) == pulls
    assert opened[0][1] == pytest.approx(PARAMS.bin, abs=1e-6)


def test_a_seated_peg_is_let_go_where_it_is_and_left_there(free):
    ctx, opened = free
    start = put(ctx, -CONFIG.hole.depth)
    ctx.devices.switch.state = SwitchState.CLOSED
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.SUCCESS, Reason.NONE, False)
    assert [width for width, _ in opened] == [PARAMS.opening] * 2
    assert opened[0][1] == pytest.approx(start)
    assert opened[1][1] == pytest.approx(PARAMS.bin, abs=1e-6)


def test_an_arm_that_has_pulled_in_vain_holds_still_before_the_hand_lets_go(ctx):
    states, release = [], ctx.devices.gripper.release
    ctx.devices.gripper.release = lambda width: (
        states.append((ctx.devices.arm.is_halted, ctx.lead.held)),
        release(width),
    )
    ctx.devices.arm.is_blocked = True
    ctx.devices.clock.every.append(lambda: setattr(ctx.devices.arm, "is_blocked", not states))
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert states[0] == (True, None)


def test_an_empty_hand_is_drawn_up_and_opened_over_the_bin(free):
    ctx, opened = free
    put(ctx, -0.01)
    ctx.devices.gripper.has_peg, ctx.devices.gripper.width = False, 0.0
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.SUCCESS, Reason.NONE, False)
    assert len(opened) == 1


@pytest.mark.parametrize("height", [0.1, -CONFIG.hole.depth])
def test_a_hand_that_does_not_open_is_told_and_has_dropped_nothing(free, height):
    ctx, _ = free
    put(ctx, height)
    ctx.devices.switch.state = SwitchState.CLOSED if height < 0.0 else SwitchState.OPEN
    ctx.devices.gripper.release = lambda width: None
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.FAILURE, Reason.STILL_HELD, False)


def test_the_hand_is_drawn_up_no_further_than_a_margin_within_the_workspace(free):
    ctx, _ = free
    top = ctx.limits.high[2]
    ctx.devices.arm.tcp = Pose(np.array([0.5, 0.0, top + 0.02]), HAND_DOWN)
    way = []
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, held: way.append(seen.arm.tcp.position[2]))
    run(PARAMS, ctx)
    assert way[-1] == pytest.approx(PARAMS.bin[2], abs=1e-6)
    assert min(abs(height - (top - MARGIN)) for height in way) < 1e-3


@pytest.mark.parametrize("limited", [True, False])
def test_only_a_pull_out_of_a_violation_goes_without_the_limits(ctx, limited):
    ctx.devices.arm.force = np.array([0.0, 0.0, -1.1 * ctx.limits.force])
    if not limited:
        assert pull_out(CONFIG.hole.centre[2], PULL, PARAMS.transfer.gains, ctx, limited=False) is not None
        return
    with pytest.raises(Interrupted) as ended:
        pull_out(CONFIG.hole.centre[2], PULL, PARAMS.transfer.gains, ctx)
    assert ended.value.reason is Reason.FORCE_LIMIT


def test_a_leaning_peg_is_shaken_about_its_own_axis(ctx):
    leaning = rotation_about(np.array([0.0, 1.0, 0.0]), 0.1) @ HAND_DOWN
    ctx.devices.arm.tcp = Pose(ctx.devices.arm.tcp.position, leaning)
    told, follow = [], ctx.devices.arm.follow
    ctx.devices.arm.follow = lambda setpoint: (told.append(setpoint), follow(setpoint))
    pull_out(CONFIG.hole.centre[2], PULL, PARAMS.transfer.gains, ctx)
    axes = np.array([setpoint.axis for setpoint in told])
    radius = PULL.dither_radius
    assert angle_between(axes[0], -leaning[:, 0]) < 1e-6
    widest = max(angle_between(axis, -leaning[:, 0]) for axis in axes)
    assert widest == pytest.approx(radius / CONFIG.peg.length, rel=0.2)
    assert all(setpoint.in_hand.length == CONFIG.peg.length for setpoint in told)
    assert all(setpoint.roll == pytest.approx(leaning[:, 2]) for setpoint in told)
