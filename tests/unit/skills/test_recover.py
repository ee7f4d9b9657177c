"""How the hand takes whatever it holds to the bin, out of a hole, out of the air and out of a violation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, rotation_about
from drivers.quantities import Pose, SwitchState
from skills.contract import Interrupted, Outcome, Reason, Request
from skills.grasp_from_rack import ACROSS_RACK
from skills.held_peg import HeldPeg
from skills.motion import Goal
from skills.pull_out import PullOut, approach, pull_out
from skills.recover import run
from skills.search.surface import Plane
from tests.fakes import HAND_DOWN, PERIOD
from tests.unit.skills.benches import watched

CONFIG = load().cell
PARAMS, HOLE = CONFIG.recover, np.array(CONFIG.hole.centre)
PULL, GAINS = PullOut(), PARAMS.transfer.gains


def with_end_at(height):
    """Return the hand whose peg ends so high above the plate, m."""
    return Pose(HOLE + (CONFIG.peg.length + height) * UP, HAND_DOWN)


@pytest.fixture
def ctx():
    """Return the context of a hand whose peg stands 20 mm deep in something and does not come out."""
    ctx = watched(CONFIG, with_end_at(-0.02))
    ctx.devices.arm.is_blocked = True
    return ctx


def free(height):
    """Return the context of a hand whose peg ends so high above the plate, m, and that is free to move."""
    return watched(CONFIG, with_end_at(height))


def ended(ctx):
    """Recover; return how it ended."""
    result = run(PARAMS, ctx)
    return result.outcome, result.reason, result.dropped


def opened(ctx):
    """Return where the hand was commanded to open as far as the parameters say, m."""
    assert {width for width, _ in ctx.devices.gripper.opened} == {PARAMS.opening}
    return [place for _, place in ctx.devices.gripper.opened]


def test_a_peg_that_slips_out_while_pulled_is_left_behind(ctx):
    def slip():
        ctx.devices.gripper.has_peg, ctx.devices.arm.is_blocked = False, False

    ctx.devices.clock.at.append((0.5, slip))
    assert ended(ctx) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert ctx.devices.gripper.width == PARAMS.opening
    assert ctx.devices.arm.tcp.position[:2] == pytest.approx(PARAMS.bin[:2])


def test_a_stop_while_the_peg_is_pulled_stops(ctx):
    ctx.callbacks = replace(ctx.callbacks, poll=lambda: Request.STOP if ctx.devices.clock.now() > 0.5 else Request.RUN)
    with pytest.raises(Interrupted):
        run(PARAMS, ctx)
    assert ctx.devices.gripper.read().is_gripping


@pytest.mark.parametrize(("opens", "reason"), [(True, Reason.JAMMED), (False, Reason.STILL_HELD)])
def test_a_hand_around_a_peg_opens_before_it_rises(opens, reason):
    """It does not grip the peg; if it does not open, it stays where it is."""
    ctx = free(-0.02)
    ctx.devices.gripper.has_peg, ctx.devices.gripper.opens = False, opens
    low = ctx.devices.arm.tcp.position[2]
    assert ended(ctx) == (Outcome.FAILURE, reason, False)
    assert opened(ctx)[0][2] == pytest.approx(low, abs=1e-3)
    assert (ctx.devices.arm.tcp.position[2] > low + 1e-3) == opens


@pytest.mark.parametrize("normal", [UP, np.array([0.0, 0.06, 1.0]) / np.linalg.norm([0.0, 0.06, 1.0])])
def test_a_peg_is_pulled_along_the_normal_of_the_felt_plate(ctx, normal):
    ctx.peg = HeldPeg(surface=None if normal is UP else Plane(HOLE, normal))
    tip = ctx.observe().tip
    assert pull_out(HOLE[2], PULL, GAINS, ctx) == pytest.approx(tip)
    ways = [setpoint.tip - tip for _, setpoint in ctx.devices.arm.told]
    assert ways[0] == pytest.approx(PULL.speed * PERIOD * normal)
    assert ways[-1] == pytest.approx(PULL.share * ctx.limits.force / GAINS.translation * normal)


def test_a_held_peg_in_the_air_is_dropped_into_the_bin():
    ctx = free(0.1)
    ctx.devices.clock.wait_until(5.0)
    start, way = ctx.devices.arm.tcp.position, []
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, held: way.append(seen.arm.tcp.position))
    result = run(PARAMS, ctx)
    assert (result.outcome, result.reason, result.dropped) == (Outcome.SUCCESS, Reason.NONE, True)
    assert result.elapsed == pytest.approx(ctx.devices.clock.now() - 5.0)
    assert opened(ctx) == [pytest.approx(PARAMS.bin, abs=1e-6)]
    assert -ctx.devices.arm.tcp.rotation[:, 0] == pytest.approx(UP, abs=1e-6)
    assert ctx.devices.arm.tcp.rotation[:, 2] == pytest.approx(ACROSS_RACK, abs=1e-6)
    up = [place for place in way if place[:2] == pytest.approx(start[:2], abs=1e-9)]
    assert up[-1][2] == pytest.approx(start[2] + PARAMS.height, abs=1e-3)


@pytest.mark.parametrize(("height", "pulls"), [(0.9 * PARAMS.clear, True), (1.1 * PARAMS.clear, False)])
def test_a_peg_near_the_plate_is_pulled_along_the_hole_first(height, pulls):
    ctx = free(height)
    assert ended(ctx) == (Outcome.SUCCESS, Reason.NONE, True)
    assert any(setpoint.in_hand is not None for _, setpoint in ctx.devices.arm.told) == pulls
    assert opened(ctx) == [pytest.approx(PARAMS.bin, abs=1e-6)]


def test_a_seated_peg_is_let_go_where_it_is_and_left_there():
    ctx = free(-CONFIG.hole.depth)
    ctx.devices.switch.state, start = SwitchState.CLOSED, ctx.devices.arm.tcp.position
    assert ended(ctx) == (Outcome.SUCCESS, Reason.NONE, False)
    assert opened(ctx) == [pytest.approx(start), pytest.approx(PARAMS.bin, abs=1e-6)]


def test_after_a_vain_pull_the_arm_rests_before_the_hand_opens(ctx):
    states, arm, release = [], ctx.devices.arm, ctx.devices.gripper.release
    ctx.devices.gripper.release = lambda width: (states.append((arm.is_halted, ctx.lead.held)), release(width))
    ctx.devices.clock.every.append(lambda: setattr(ctx.devices.arm, "is_blocked", not states))
    assert ended(ctx) == (Outcome.FAILURE, Reason.JAMMED, False)
    assert states[0] == (True, None)


def test_an_empty_hand_is_drawn_up_and_opened_over_the_bin():
    ctx = free(-0.01)
    ctx.devices.gripper.has_peg, ctx.devices.gripper.width = False, 0.0
    assert ended(ctx) == (Outcome.SUCCESS, Reason.NONE, False)
    assert len(opened(ctx)) == 1


@pytest.mark.parametrize(("height", "state"), [(0.1, SwitchState.OPEN), (-CONFIG.hole.depth, SwitchState.CLOSED)])
def test_a_hand_that_does_not_open_has_dropped_nothing(height, state):
    ctx = free(height)
    ctx.devices.switch.state, ctx.devices.gripper.opens = state, False
    assert ended(ctx) == (Outcome.FAILURE, Reason.STILL_HELD, False)


def test_the_hand_is_drawn_up_within_the_workspace():
    ctx = free(0.1)
    top, way = ctx.limits.high[2], []
    ctx.devices.arm.tcp = Pose(np.array([0.5, 0.0, top + 0.02]), HAND_DOWN)
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, held: way.append(seen.arm.tcp.position[2]))
    run(PARAMS, ctx)
    assert way[-1] == pytest.approx(PARAMS.bin[2], abs=1e-6)
    assert min(abs(height - (top - PARAMS.margin)) for height in way) < 1e-3


def test_only_a_pull_out_of_a_violation_goes_without_the_limits(ctx):
    ctx.devices.arm.force = np.array([0.0, 0.0, -1.1 * ctx.limits.force])
    assert pull_out(HOLE[2], PULL, GAINS, ctx, limited=False) is not None
    with pytest.raises(Interrupted) as ended:
        pull_out(HOLE[2], PULL, GAINS, ctx)
    assert ended.value.reason is Reason.FORCE_LIMIT


@pytest.mark.parametrize(("turned", "moves"), [(0.0, 1), (0.05, 1), (0.5, 2)])
def test_a_peg_that_turned_on_the_way_up_is_moved_again(turned, moves):
    ctx = free(0.03)
    ctx.devices.clock.at.append((0.1, lambda: setattr(ctx.perception.estimator, "theta", turned)))
    goal = Goal(HOLE + np.array([0.02, 0.0, 0.02]), UP, HAND_DOWN[:, 2])
    assert approach(goal, PARAMS.transfer, PULL, ctx) is None
    assert len({setpoint.id for _, setpoint in ctx.devices.arm.told}) == moves
    assert math.dist(ctx.observe().tip, goal.tip) < PULL.near


def test_a_leaning_peg_is_shaken_about_its_own_axis(ctx):
    leaning = rotation_about(np.array([0.0, 1.0, 0.0]), 0.1) @ HAND_DOWN
    ctx.devices.arm.tcp = Pose(ctx.devices.arm.tcp.position, leaning)
    pull_out(HOLE[2], PULL, GAINS, ctx)
    told = [setpoint for _, setpoint in ctx.devices.arm.told]
    away = [angle_between(setpoint.axis, -leaning[:, 0]) for setpoint in told]
    assert away[0] < 1e-6
    assert max(away) == pytest.approx(PULL.dither_radius / CONFIG.peg.length, rel=0.2)
    assert all(setpoint.in_hand.length == CONFIG.peg.length for setpoint in told)
    assert all(setpoint.roll == pytest.approx(leaning[:, 2]) for setpoint in told)
