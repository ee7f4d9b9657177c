"""Guards of a scan, at the limit and one beyond it; a late scan slows the path of a skill."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import ScanOverrunError, SkinUntrustedError
from drivers.frames import UP
from drivers.quantities import ArmState, ImpedanceSetpoint, InHandTip, Pose, Twist, Wrench
from drivers.skin.layout import LAYOUTS
from skills.guards.scan_guards import (
    LONGEST_STEP,
    OVERRUN_WINDOW,
    RESUME_TIME,
    ScanLimits,
    ScanSchedule,
    ScanTiming,
    require_level_skin,
    way_back,
)
from skills.motion import Goal, Transfer, move
from tests.fakes import HAND_DOWN, PERIOD, FakeArm, FakeClock, FakeGripper, context_of
from tests.pegs import framed, pushed, readings

SKIN = LAYOUTS["parallelogram"]
MOST_LEVEL = SKIN.beside * SKIN.full_scale


def timed(*waits):
    """Return the timing after scans that begin so long after each other, s."""
    timing, now = ScanTiming(ScanSchedule(PERIOD, ScanLimits(late=0.3, longest=0.1))), 5.0
    timing.take(now)
    for wait in waits:
        now += wait
        timing.take(now)
    return timing


def test_a_path_goes_on_by_the_passed_time_within_bounds():
    assert timed().step == PERIOD
    for late, step in ((1.7, 1.7), (9.0, LONGEST_STEP)):
        timing = timed(late * PERIOD)
        assert (timing.step, timing.passed) == pytest.approx((step * PERIOD, late * PERIOD))
        assert timing.due == pytest.approx(5.0 + (late + 1.0) * PERIOD)


@pytest.mark.parametrize(
    ("at", "beyond", "words"),
    [
        ([0.1], [0.101], r"101 ms after the one before; scan.longest = 0.1 s allowed: stop other programs$"),
        ([2.1 * PERIOD] * 30, [2.1 * PERIOD] * 31, r"31 of the last 100 .* 20 ms; 30 allowed by scan\.late"),
    ],
    ids=["one scan", "many scans"],
)
def test_scans_may_be_as_late_as_the_limits_say_and_no_later(at, beyond, words):
    timed(*at)
    with pytest.raises(ScanOverrunError, match=words):
        timed(*beyond)


def test_two_periods_are_not_late_and_old_scans_do_not_count():
    late = [2.1 * PERIOD] * 30
    timed(*late, *[2.0 * PERIOD] * OVERRUN_WINDOW, *late)


# The path back from a hold.


PAUSED = ArmState(
    4.0, np.zeros(7), np.zeros(7), Pose(np.array([0.5, 0.0, 0.3]), HAND_DOWN), Wrench(np.zeros(3), np.zeros(3)), 2, 0.0
)
HELD = ImpedanceSetpoint(
    *(7, np.array([0.5, 0.02, 0.25]), np.array([math.sin(0.4), 0.0, math.cos(0.4)]), np.ones(6), np.ones(6), 1.0),
    twist=Twist(np.ones(3), np.zeros(3)),
    posture=np.full(7, 0.3),
)


def back(share, **held):
    """Return the setpoint after this share of the time of the path back."""
    now = replace(PAUSED, stamp=4.0 + share * RESUME_TIME, q=np.full(7, 0.1))
    return way_back(PAUSED, replace(HELD, **held), now, PERIOD)


def test_half_way_back_the_setpoint_stands_still_with_the_axis_half_turned():
    half = back(0.5)
    np.testing.assert_allclose(half.tip, [0.5, 0.01, 0.275])
    np.testing.assert_allclose(half.axis, [math.sin(0.2), 0.0, math.cos(0.2)], atol=1e-12)
    assert (half.twist, half.id, half.valid_until) == (None, 7, pytest.approx(4.0 + 0.5 * RESUME_TIME + 10 * PERIOD))
    np.testing.assert_allclose(half.posture, [0.1, 0.1, 0.3, 0.1, 0.1, 0.1, 0.1])  # only the elbow goes back


def test_the_path_back_of_a_held_peg_is_that_of_its_end():
    in_hand = InHandTip(0.0, 0.05)
    np.testing.assert_allclose(back(0.0, in_hand=in_hand).tip, [0.5, 0.0, 0.25], atol=1e-12)
    np.testing.assert_allclose(back(3.0, in_hand=in_hand).tip, HELD.tip)


# A finger that reads an offset.


@pytest.mark.parametrize("layout", ["parallelogram", "base_to_base"])
@pytest.mark.parametrize(
    ("width", "is_flat", "force"), [(0.008, False, 30.0), (0.008, False, 70.0), (0.012, True, 70.0)]
)
def test_a_peg_leaves_a_fifth_of_each_finger_free(layout, width, is_flat, force):
    rng = np.random.default_rng(5)
    for theta in np.radians(np.linspace(-80.0, 80.0, 17)):
        load = replace(pushed(rng, theta, 0.0), grip_force=force, width=width, is_flat=is_flat)
        require_level_skin(framed(readings(layout, load, rng)), layout)


@pytest.mark.parametrize(("finger", "name"), [(0, "left"), (1, "right")])
@pytest.mark.parametrize("offset", [4000.0, 2500.0, -2500.0])
def test_an_offset_names_its_finger_at_any_angle(finger, name, offset):
    rng = np.random.default_rng(6)
    for theta in np.radians(np.linspace(-80.0, 80.0, 9)):
        values = readings("parallelogram", pushed(rng, theta, 0.0), rng)
        values[finger] += offset
        with pytest.raises(
            SkinUntrustedError,
            match=rf"skin: {name} finger: offset of -?\d+ counts on all taxels; 1500 allowed .*: check its plug, then",
        ):
            require_level_skin(framed(values), "parallelogram")


def finger(side=1, first=0, last=20, value=MOST_LEVEL, untrusted=()):
    """Return a frame of which some taxels of a finger read this, counts, and some are not trusted."""
    values, trusted = np.zeros((2, 20)), np.ones((2, 20), dtype=bool)
    values[side, first:last] = value
    trusted[side, list(untrusted)] = False
    return framed(values, trusted)


OFFSETS = {
    "limit": (finger(), finger(value=MOST_LEVEL + 1.0), "right finger"),
    "below the baseline": (finger(value=-MOST_LEVEL), finger(value=-MOST_LEVEL - 1.0), "right finger"),
    "a fifth free": (finger(first=4, value=2e3), finger(first=3, value=2e3), "right finger: offset of 2000 counts"),
    "a fifth of the trusted free": (
        *(finger(first=first, value=2e3, untrusted=range(16, 20)) for first in (4, 3)),
        "right finger: offset of 2000 counts",
    ),
    "half below": (*(finger(0, last=last, value=-2e3) for last in (10, 11)), "left finger: offset of -2000 counts"),
    "beside": (finger(value=4e3, untrusted=range(20)), finger(value=np.linspace(2e3, 3.9e3, 20)), "of 2300 counts"),
    "by the middle": (finger(value=0.0), finger(value=-np.linspace(2e3, 3.9e3, 20)), "offset of -2900 counts"),
}
"""Frames at the limit and one beyond it, and the words of the fault."""


@pytest.mark.parametrize(("at", "beyond", "words"), OFFSETS.values(), ids=OFFSETS)
def test_an_offset_of_a_finger_is_borne_up_to_its_limit(at, beyond, words):
    require_level_skin(at, "parallelogram")
    with pytest.raises(SkinUntrustedError, match=words):
        require_level_skin(beyond, "parallelogram")


def test_an_untrusted_finger_hides_no_offset_of_the_other():
    frame = finger(value=4000.0)
    frame.trusted[0] = False
    with pytest.raises(SkinUntrustedError, match="right finger"):
        require_level_skin(frame, "parallelogram")


def late_cell(lateness):
    """Return the context of a fake cell in which the wait of the n-th scan ends `lateness(n)` seconds late."""
    clock, scans = FakeClock(), iter(range(10**6))
    clock.every.append(lambda: setattr(clock, "lag", lateness(next(scans))))
    return context_of(load().cell, FakeArm(clock), FakeGripper(0.008))


def moved(ctx):
    """Move the hand by 60 mm; return the time that it took on the path, s, and the distance of the last setpoint from the goal, m."""
    goal = Goal(ctx.devices.arm.tcp.position + np.array([0.0, 0.06, 0.0]), UP, np.array([0.0, -1.0, 0.0]))
    *_, last = move(goal, Transfer(), ctx, None)
    return last.running, math.dist(ctx.lead.held.tip, goal.tip)


@pytest.mark.parametrize("mean", [0.003, 0.01])
def test_a_path_on_a_busy_computer_ends_at_its_goal(mean):
    rng = np.random.default_rng(3)
    punctual, _ = moved(late_cell(lambda n: 0.0))
    time, missed = moved(late_cell(lambda n: rng.exponential(mean)))
    assert missed < 1e-4
    assert time == pytest.approx(punctual, rel=0.12)


def test_a_timeout_is_counted_on_the_cells_clock():
    ctx = late_cell(lambda n: 0.04)
    seen = list(ctx.scan(1.0))
    assert ctx.devices.clock.now() == pytest.approx(1.0, abs=0.05)
    assert seen[-1].elapsed == pytest.approx(seen[-1].running * LONGEST_STEP / 5.0, rel=0.05)
    with pytest.raises(ScanOverrunError):
        list(ctx.scan(5.0))
