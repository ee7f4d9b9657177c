"""The hand on its way over the plate, while the peg turns in it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config import load
from drivers.frames import angle_between, end_point
from skills.catalogue import SEARCH
from skills.search.course import make_course
from skills.search.feel import Evidence
from skills.search.phases import Sliding
from skills.search.sweep import Sweep
from skills.surface import SurfaceEstimate
from skills.tactile.hole_event import HoleEvent
from tests.fakes import Rig

TURN = 0.2


@pytest.fixture
def sweeping(tmp_path):
    """Return a function that begins a search above the plate, and its first observation; the hand is as the course asks for."""

    def begin(**keys):
        rig = Rig(load(), tmp_path)
        params = rig.loaded.cell.params(SEARCH).model_copy(update=keys)
        ctx = rig.cell.context(1)
        course = make_course(params, ctx.job, np.random.default_rng(1))
        closing, axis = course.closing, course.axis
        frame = np.column_stack([-axis, np.cross(closing, -axis), closing])
        rig.arm.tcp = replace(rig.arm.tcp, position=course.first + ctx.length * axis, rotation=frame)
        evidence = Evidence(params, SurfaceEstimate(), HoleEvent(params.event, params.timeout), ctx.scan_period)
        sweep = Sweep(params, ctx, course, evidence)
        return sweep, ctx.observe(), ctx

    return begin


def turned(seen, theta, length):
    """Return an observation in which the peg has turned in a hand that stands still."""
    tip, axis = end_point(seen.arm.tcp, theta, length)
    return replace(seen, peg=replace(seen.peg, theta=theta), tip=tip, axis=axis)


@pytest.mark.parametrize(("keeps", "asked"), [("hand", 0.0), ("peg", TURN)])
def test_the_hand_does_not_turn_after_a_peg_that_the_plate_turns(sweeping, keeps, asked):
    sweep, seen, ctx = sweeping(keeps=keeps)
    seen = turned(seen, seen.peg.theta + TURN, ctx.length)
    sweep.finds(seen)
    assert angle_between(sweep.setpoint(seen).axis, seen.axis) == pytest.approx(asked, abs=1e-6)


@pytest.mark.parametrize(
    ("keeps", "most", "angle", "is_turned"),
    [
        ("hand", 0.35, 0.34, False),
        ("hand", 0.35, 0.36, True),
        ("hand", 0.2, 0.21, True),
        ("hand", 0.0, 1.2, False),
        ("peg", 0.35, 1.0, False),
    ],
)
def test_a_peg_that_has_turned_far_is_held_anew_unless_it_is_never_to_be(sweeping, keeps, most, angle, is_turned):
    sweep, seen, ctx = sweeping(keeps=keeps, turned=most)
    assert sweep.is_turned(turned(seen, seen.peg.theta - angle, ctx.length)) is is_turned


@pytest.mark.parametrize(("fall", "is_found"), [(0.0, True), (6e-4, False)])
def test_evidence_is_the_hole_itself_where_no_fall_is_asked_for_however_high_the_tip_seems(
    sweeping, monkeypatch, fall, is_found
):
    sweep, seen, _ = sweeping(fall=fall, rest=0.01)
    monkeypatch.setattr(Evidence, "update", lambda *args: (-1e-3, True))
    sweep._phase = Sliding(sweep._phase.detour)
    assert sweep.finds(seen) is is_found


def test_a_peg_that_is_held_anew_comes_down_where_it_was_and_the_hand_turns_after_it(sweeping):
    sweep, seen, ctx = sweeping()
    sweep.finds(seen)
    course = sweep.begin_anew()
    assert course.first[:2] == pytest.approx(course.middle + course.path.at(0.0)[0])
    sweep.hold_anew()
    assert not sweep.is_turned(turned(seen, ctx.in_hand().theta, ctx.length))
    assert math.isclose(sweep.setpoint(seen).axis @ course.axis, 1.0, abs_tol=1e-9)


@pytest.mark.parametrize(("lag", "rests"), [(0.99e-2, 0), (1.01e-2, 1)])
def test_a_tip_that_a_wall_holds_back_stops_the_path(sweeping, lag, rests):
    sweep, seen, _ = sweeping(lag=1e-2, run_up=0.0, touch_down=0.2)
    for elapsed in (0.0, 0.3):
        sweep.finds(replace(seen, elapsed=elapsed))
    way = sweep.setpoint(replace(seen, elapsed=0.3))
    tip = seen.tip.copy()
    tip[1] = way.tip[1] - lag
    held = replace(seen, elapsed=0.31, step=0.0, tip=tip)
    sweep.setpoint(held)
    sweep.finds(held)
    assert sweep.rests == rests
