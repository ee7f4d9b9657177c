"""Guards of a scan, at the limit and one beyond it."""

import math
from dataclasses import replace

import numpy as np
import pytest

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
from tests.fakes import HAND_DOWN
from tests.pegs import framed, pushed, readings

SKIN = LAYOUTS["parallelogram"]
MOST_LEVEL = SKIN.beside * SKIN.full_scale

PERIOD = 0.01
LIMITS = ScanLimits(late=0.3, longest=0.1)


def timed(*waits):
    """Return the timing after scans that begin so long after each other, s."""
    timing, now = ScanTiming(ScanSchedule(PERIOD, LIMITS)), 5.0
    timing.take(now)
    for wait in waits:
        now += wait
        timing.take(now)
    return timing


def test_the_next_scan_is_due_one_period_after_this_one():
    assert timed(0.023).due == pytest.approx(5.023 + PERIOD)


def test_a_path_goes_on_by_the_time_that_has_passed_as_far_as_it_may_step():
    assert timed().step == PERIOD
    assert timed(1.7 * PERIOD).step == pytest.approx(1.7 * PERIOD)
    assert timed(9.0 * PERIOD).step == pytest.approx(LONGEST_STEP * PERIOD)
    assert timed(9.0 * PERIOD).passed == pytest.approx(9.0 * PERIOD)


def test_one_scan_may_be_as_late_as_the_limit_says_and_no_later():
    timed(LIMITS.longest).require_kept()
    with pytest.raises(ScanOverrunError, match=r"101 ms after the one before; scan.longest = 0.1 s allowed"):
        timed(LIMITS.longest + 1e-3).require_kept()


def test_as_many_scans_may_be_late_as_the_limit_says_and_no_more():
    timed(*[2.1 * PERIOD] * 30).require_kept()
    with pytest.raises(ScanOverrunError, match=r"31 of the last 100 took longer than 20 ms; 30 allowed by scan\.late"):
        timed(*[2.1 * PERIOD] * 31).require_kept()


def test_a_scan_that_comes_long_after_the_one_before_is_told_with_how_long_and_what_to_do():
    with pytest.raises(ScanOverrunError, match=r"scan: 900 ms after .* s allowed: stop other programs$"):
        timed(0.9).require_kept()


def test_a_scan_after_exactly_two_periods_is_not_late():
    timed(*[2.0 * PERIOD] * OVERRUN_WINDOW).require_kept()


def test_what_is_older_than_the_window_is_forgiven():
    late = [2.1 * PERIOD] * 30
    timed(*late, *[PERIOD] * OVERRUN_WINDOW, *late).require_kept()


# The way back from a hold, and what an arm and its setpoint have to agree in.

HAND = Pose(np.array([0.5, 0.0, 0.3]), HAND_DOWN)
GAINS = np.array([800.0, 800.0, 800.0, 40.0, 40.0, 40.0])


def state_at(position, stamp=0.0):
    """Return the state of an arm whose hand points down at a place."""
    tcp = Pose(np.asarray(position, dtype=float), HAND_DOWN)
    return ArmState(stamp, np.zeros(7), np.zeros(7), tcp, Wrench(np.zeros(3), np.zeros(3)), 2, 0.0)


def held_at(tip, axis=UP, in_hand=None):
    """Return a setpoint that was held."""
    still = Twist(np.ones(3), np.zeros(3))
    return ImpedanceSetpoint(7, np.asarray(tip, dtype=float), axis, GAINS, np.ones(6), 1.0, in_hand, None, still)


def test_the_way_back_begins_where_the_arm_paused_and_ends_at_its_setpoint():
    paused, held = state_at([0.5, 0.0, 0.3], 4.0), held_at([0.5, 0.02, 0.28])
    way = [way_back(paused, held, 4.0 + passed, PERIOD) for passed in (0.0, 0.25 * RESUME_TIME, RESUME_TIME, 3.0)]
    np.testing.assert_allclose(
        [setpoint.tip for setpoint in way],
        [[0.5, 0.0, 0.3], [0.5, 0.005, 0.295], [0.5, 0.02, 0.28], [0.5, 0.02, 0.28]],
    )


def test_the_way_back_turns_by_unit_axes_stands_still_and_is_valid_for_ten_scans():
    tilted = np.array([math.sin(0.4), 0.0, math.cos(0.4)])
    half = way_back(state_at([0.5, 0.0, 0.3]), held_at([0.5, 0.0, 0.3], tilted), 0.5 * RESUME_TIME, PERIOD)
    np.testing.assert_allclose(half.axis, [math.sin(0.2), 0.0, math.cos(0.2)], atol=1e-12)
    assert (half.twist, half.id, half.valid_until) == (None, 7, pytest.approx(0.5 * RESUME_TIME + 10 * PERIOD))


def test_the_way_back_of_a_held_peg_is_that_of_its_end():
    in_hand = InHandTip(0.0, 0.05, 0.0)
    first = way_back(state_at([0.5, 0.0, 0.3]), held_at([0.5, 0.02, 0.25], in_hand=in_hand), 0.0, PERIOD)
    np.testing.assert_allclose(first.tip, [0.5, 0.0, 0.25], atol=1e-12)


# A finger that reads an offset.


@pytest.mark.parametrize("layout", ["parallelogram", "base_to_base"])
@pytest.mark.parametrize(
    ("width", "is_flat", "force"), [(0.008, False, 30.0), (0.008, False, 70.0), (0.012, True, 70.0)]
)
def test_a_peg_leaves_a_fifth_of_each_finger_free_however_it_is_held(layout, width, is_flat, force):
    rng = np.random.default_rng(5)
    for theta in np.radians(np.linspace(-80.0, 80.0, 17)):
        load = replace(pushed(rng, theta, 0.0), grip_force=force, width=width, is_flat=is_flat)
        require_level_skin(framed(readings(layout, load, rng)), layout)


@pytest.mark.parametrize(("finger", "name"), [(0, "left"), (1, "right")])
@pytest.mark.parametrize("offset", [4000.0, 2500.0, -2500.0, -4000.0])
def test_an_offset_of_one_finger_is_told_by_its_name_whatever_the_angle(finger, name, offset):
    rng = np.random.default_rng(6)
    for theta in np.radians(np.linspace(-80.0, 80.0, 9)):
        values = readings("parallelogram", pushed(rng, theta, 0.0), rng)
        values[finger] += offset
        with pytest.raises(
            SkinUntrustedError,
            match=rf"skin: {name} finger: offset of -?\d+ counts all over; 1500 allowed .*: see its plug, then",
        ):
            require_level_skin(framed(values), "parallelogram")


def test_an_offset_is_borne_up_to_its_limit_and_taxels_that_are_not_trusted_say_nothing():
    values, trusted = np.zeros((2, 20)), np.ones((2, 20), dtype=bool)
    for sign in (1.0, -1.0):
        values[1] = sign * MOST_LEVEL
        require_level_skin(framed(values), "parallelogram")
        values[1] = sign * (MOST_LEVEL + 1.0)
        with pytest.raises(SkinUntrustedError):
            require_level_skin(framed(values), "parallelogram")
    trusted[1] = False
    require_level_skin(framed(values, trusted), "parallelogram")


@pytest.mark.parametrize("taxels", [20, 16])
def test_a_finger_on_which_less_than_a_fifth_is_free_reads_an_offset(taxels):
    values, trusted = np.zeros((2, 20)), np.ones((2, 20), dtype=bool)
    trusted[1, taxels:] = False
    values[1, 4:] = 2000.0
    require_level_skin(framed(values, trusted), "parallelogram")
    values[1, 3:] = 2000.0
    with pytest.raises(SkinUntrustedError, match=r"right finger: offset of 2000 counts"):
        require_level_skin(framed(values, trusted), "parallelogram")


def test_a_finger_that_reads_below_its_baseline_on_more_than_half_of_it_reads_an_offset():
    values = np.zeros((2, 20))
    values[0, :10] = -2000.0
    require_level_skin(framed(values), "parallelogram")
    values[0, :11] = -2000.0
    with pytest.raises(SkinUntrustedError, match=r"left finger: offset of -2000 counts"):
        require_level_skin(framed(values), "parallelogram")


def test_an_offset_is_told_by_the_taxels_beside_the_peg_and_one_below_the_baseline_by_the_middle():
    values = np.zeros((2, 20))
    values[0] = np.linspace(2000.0, 3900.0, 20)
    with pytest.raises(SkinUntrustedError, match=r"offset of 2300 counts"):
        require_level_skin(framed(values), "parallelogram")
    values[0] = np.linspace(-2000.0, -3900.0, 20)
    with pytest.raises(SkinUntrustedError, match=r"offset of -2900 counts"):
        require_level_skin(framed(values), "parallelogram")


def test_a_finger_that_nobody_trusts_hides_no_offset_of_the_other():
    values, trusted = np.zeros((2, 20)), np.ones((2, 20), dtype=bool)
    trusted[0], values[1] = False, 4000.0
    with pytest.raises(SkinUntrustedError, match="right finger"):
        require_level_skin(framed(values, trusted), "parallelogram")
