"""The decisions of the adjustment, each by itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config import load
from drivers.quantities import InHandTip, Pose
from skills.catalogue import ADJUST
from skills.contract import Outcome, Reason
from skills.seating import CLOSED_TOLERANCE, OPEN_TOLERANCE
from skills.spiral_adjust import CREEP, SLIDING, Aim, Descent, Guide, Stall, given_up_after, run
from tests.fakes import HAND_DOWN, Rig

PARAMS = load().cell.params(ADJUST)
PERIOD, LEAST = PARAMS.dither_period, PARAMS.jammed
DEEP = PARAMS.guided_depth + 1e-6


def test_less_than_the_least_gain_is_no_gain():
    stall = Stall().after(1e-3, 1.0, LEAST)
    assert stall.after(1e-3 + LEAST, 2.0, LEAST) == stall
    assert stall.after(1e-3 + 1.01 * LEAST, 2.0, LEAST).since == 2.0


def test_another_theta_is_no_gain_in_depth():
    stall = Stall(deepest=2e-3, since=1.0).measured_anew(depth=2.5e-3, before=1.9e-3)
    assert (stall.deepest, stall.since) == (pytest.approx(2.6e-3), 1.0)


def test_the_hole_guides_from_its_depth_on_and_for_good():
    shallow = Guide().after(PARAMS.guided_depth, 1.0, PARAMS)
    guided = shallow.after(DEEP, 2.0, PARAMS)
    assert (shallow.is_on, guided.is_on, guided.began) == (False, True, 2.0)
    assert guided.after(0.0, 2.1, PARAMS).began == 2.0


@pytest.mark.parametrize(("gain", "is_jammed"), [(0.0, True), (0.99 * CREEP, True), (1.01 * CREEP, False)])
def test_a_period_in_which_the_peg_creeps_is_a_jam(gain, is_jammed):
    guide = replace(Guide().after(DEEP, 1.0, PARAMS), reached=5e-3)
    assert not guide.after(5e-3, 1.0 + 0.99 * PERIOD, PARAMS).is_jammed
    assert guide.after(5e-3 + gain * LEAST, 1.0 + 1.01 * PERIOD, PARAMS).is_jammed is is_jammed


def test_the_spiral_grows_and_the_guided_circles_fade():
    free = [np.linalg.norm(Guide().offset(time, PARAMS, 1.0)) for time in (1.0, 2.0)]
    guided = [np.linalg.norm(Guide(began=1.0).offset(1.0 + share * PERIOD, PARAMS, 1.0)) for share in (0.1, 0.9)]
    assert free == pytest.approx([PARAMS.growth, 2 * PARAMS.growth])
    assert guided[1] < guided[0] <= PARAMS.dither_radius


def test_a_peg_that_slides_is_not_dithered_and_one_that_rests_is():
    resting = sliding = Descent(0.0)
    for scan in range(1, 31):
        resting, sliding = resting.after(0.0, 0.01), sliding.after(1.01 * SLIDING * 0.01 * scan, 0.01)
    sizes = [
        float(np.linalg.norm(Guide(began=0.0).offset(0.2 * PERIOD, PARAMS, each.rest))) for each in (resting, sliding)
    ]
    assert sizes == pytest.approx([0.8 * PARAMS.dither_radius, 0.0], abs=0.25 * PARAMS.dither_radius)
    assert sizes[1] == 0.0


def test_a_tip_that_rises_slides_nowhere():
    assert Descent(5e-3).after(4e-3, 0.01).rest == 1.0


def test_after_a_jam_the_peg_is_aimed_where_it_rests_and_after_the_next_by_the_plate():
    upright = Pose(np.zeros(3), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]))
    normal, held = np.array([0.0, 0.0, 1.0]), InHandTip(math.radians(2.0), 0.05, 3.0)
    once = Aim(InHandTip(0.0, 0.05, 0.0), normal).freed(held, upright, normal)
    assert once.in_hand is held
    assert once.direction @ normal == pytest.approx(math.cos(held.theta))
    assert once.freed(held, upright, normal).direction is normal


@pytest.mark.parametrize(
    ("short", "times"), [(OPEN_TOLERANCE + 1e-6, 1.0), (OPEN_TOLERANCE - 1e-6, 2.0), (-0.003, 2.0)]
)
def test_a_peg_at_the_bottom_is_given_twice_the_time_of_one_that_stalls_above_it(short, times):
    assert given_up_after(0.02 - short, 0.02, PARAMS) == times * PARAMS.stall_timeout


@pytest.mark.parametrize("most_deep", [CLOSED_TOLERANCE, 0.009])
def test_fingers_that_slide_down_the_peg_are_noticed_below_the_bottom(tmp_path, most_deep):
    """The hand of the fakes sinks as it is told, as fingers do that slide; the switch stays open."""
    rig = Rig(load(), tmp_path)
    ctx = rig.cell.context(1)
    hole = ctx.job.hole
    rig.gripper.grip(30.0)
    rig.arm.tcp = Pose(np.array([*hole.centre[:2], hole.centre[2] + ctx.length]), HAND_DOWN)
    ended = run(PARAMS.model_copy(update={"push_offset": 1e-3, "most_deep": most_deep}), ctx)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert ended.depth == pytest.approx(hole.depth + most_deep, abs=2e-3)
