"""Setpoints of the adjustment of a peg with corners, scan by scan, and its endings; the hand is where the test puts it."""

import math
from itertools import pairwise

import numpy as np
import pytest

from drivers.frames import UP, angle_between, end_point, rotation_about
from skills.contract import Outcome, Reason
from skills.corner.adjust import STRAYED_FOR, Entry, EntryWatch, run
from skills.corner.insert import to_and_fro, turned_by
from skills.insert.guided_peg import Stall
from skills.paths import dither
from skills.search.surface import Plane
from tests.fakes import PERIOD, Rig
from tests.scripted import HOLE, SQUARE, corner_hand
from tests.unit.skills.benches import SkillBench, corner_axes

CELL, PARAMS = SQUARE.cell, SQUARE.cell.corner.adjust
LENGTH = CELL.peg.length
TILT, DIRECTION = 0.12, 0.3
"""Lean of a peg that the insertion hands on, and azimuth of the hand's closing axis, rad."""
CORNER = np.array([math.cos(DIRECTION + math.pi / 4), math.sin(DIRECTION + math.pi / 4), 0.0])
"""Direction in the plate towards the corner over which it leans."""


def hand(tip=HOLE, tilt=TILT, **turns):
    """Return the hand whose peg leans over its corner."""
    return corner_hand(tip, tilt, DIRECTION, **turns)


@pytest.fixture
def bench(tmp_path):
    return SkillBench(Rig(SQUARE, tmp_path), run, PARAMS, lambda time: hand())


def sinks(depth, since=0.1):
    """Return a way that is deeper by `depth`, m, from a time on, s."""
    return lambda time: hand(HOLE - (depth if time > since - 1e-9 else 0.0) * UP)


@pytest.mark.parametrize("is_turned_round", [False, True])
def test_the_tip_leads_its_corner_into_the_corner_of_the_hole(bench, is_turned_round):
    lead, offset, way = (3e-3, 1e-3), 7e-3, np.array([1e-3, -1e-3, 2e-4])
    bench.way = lambda time: hand(HOLE + time * way, yaw=0.4 * time, is_turned_round=is_turned_round)
    bench.run(lead=lead, push_offset=offset)
    along, across = corner_axes(bench.seen[0].arm.tcp.rotation[:, 2], CORNER)
    for seen, setpoint in bench.scans():
        led = rotation_about(UP, 0.4 * seen.running) @ (lead[0] * along + lead[1] * across)
        np.testing.assert_allclose(setpoint.tip, seen.tip + led - offset * UP, atol=1e-9)


def test_the_axis_goes_upright_at_its_rate_to_the_kept_tilt(bench):
    rate, kept = 0.4, 0.05
    bench.run(raise_rate=rate, tilt=kept, dither_radius=0.0)
    down = np.cross(CORNER, UP)
    for scan, (_, setpoint) in enumerate(bench.scans()):
        left, spin = TILT - rate * scan * PERIOD, rate
        if left <= kept + 1e-9:
            left, spin = kept, 0.0
        np.testing.assert_allclose(setpoint.axis, math.cos(left) * UP + math.sin(left) * CORNER, atol=1e-6)
        if abs(left - kept - rate * PERIOD) > 0.9 * rate * PERIOD or not spin:
            np.testing.assert_allclose(setpoint.twist.angular, spin * down, atol=1e-4)
        np.testing.assert_array_equal(setpoint.twist.linear, np.zeros(3))
    assert (left, spin) == (kept, 0.0)


@pytest.mark.parametrize("normal", [None, rotation_about(np.array([1.0, 0.0, 0.0]), 0.03) @ UP])
def test_a_caught_peg_goes_upright_with_the_plate(bench, normal):
    bench.way = sinks(1.05 * PARAMS.caught)
    bench.run(None if normal is None else Plane(HOLE, normal), raise_rate=0.6, dither_radius=0.0)
    np.testing.assert_allclose(bench.commanded[-1].axis, UP if normal is None else normal, atol=1e-4)
    assert angle_between(bench.commanded[0].axis, bench.seen[0].axis) < 2e-3


def test_the_dither_of_the_finger_centre_is_fed_forward(bench):
    bench.run(raise_rate=1e-9, dither_radius=2e-3, dither_rate=20.0, dither_period=0.3)
    for seen, setpoint in bench.scans():
        offset = dither(seen.running, 2e-3, 20.0, 0.3)
        np.testing.assert_allclose(LENGTH * (setpoint.axis - bench.seen[0].axis)[:2], offset, atol=1e-9)
    for before, after in pairwise(bench.commanded):
        turn = np.cross(before.axis, after.axis) / PERIOD
        np.testing.assert_allclose(before.twist.angular, turn, atol=1e-6)


@pytest.mark.parametrize(("turn", "yaw_rate"), [(9.0, 0.0), (9.0, 0.2), (9.0, -0.3), (0.02, 0.0), (0.02, 0.3)])
def test_the_yaw_sweeps_with_a_bounded_lead_over_the_hand(bench, turn, yaw_rate):
    sweep = {"turn_rate": 0.5, "growth": 0.04, "reach": 0.1}
    bench.way = lambda time: hand(yaw=yaw_rate * time)
    bench.run(turn=turn, **sweep)
    leads = []
    for seen, setpoint in bench.scans():
        lead = to_and_fro(seen.running, *sweep.values()) - yaw_rate * seen.running
        leads.append(min(max(lead, -turn), turn))
        closing = seen.arm.tcp.rotation[:, 2]
        assert turned_by(setpoint.roll, closing, seen.axis) == pytest.approx(leads[-1], abs=1e-9)
        assert setpoint.roll @ seen.axis == pytest.approx(0.0, abs=1e-9)
    assert min(leads) < 0.0 < max(leads) or yaw_rate


@pytest.mark.parametrize("tilt", [0.0, 0.1])
@pytest.mark.parametrize(("more", "is_between"), [(1e-6, True), (-1e-6, False)])
def test_a_peg_that_sinks_is_between_the_walls_at_its_depth(bench, tilt, more, is_between):
    normal = rotation_about(np.array([1.0, 0.0, 0.0]), tilt) @ UP
    depth = PARAMS.entered + more
    bench.way = lambda time: hand(HOLE - (depth if time > 0.1 - 1e-9 else 0.0) * normal)
    # The plate lies where the peg has sunk already, so that its depth alone would count as entered.
    ended = bench.run(Plane(HOLE + 3e-3 * UP, normal))
    expected = (Outcome.SUCCESS, Reason.NONE) if is_between else (Outcome.FAILURE, Reason.NOT_SEATED)
    assert (ended.outcome, ended.reason) == expected
    assert ended.elapsed == pytest.approx(0.1 if is_between else 0.49, abs=1e-9)
    assert ended.depth == pytest.approx(depth + 3e-3 * normal[2], abs=1e-9)  # below the felt surface


@pytest.mark.parametrize(("share", "is_caught"), [(1.3, True), (0.95, False)])
def test_a_caught_peg_is_handed_on_once_it_stands(bench, share, is_caught):
    bench.way = sinks(share * PARAMS.caught)
    ended = bench.run(timeout=1.5)
    assert ended.outcome is (Outcome.SUCCESS if is_caught else Outcome.FAILURE)
    assert ended.elapsed == pytest.approx(0.1 + PARAMS.stands_for if is_caught else 1.49, abs=1.1 * PERIOD)


@pytest.mark.parametrize(
    ("way", "has_strayed"),
    [
        (1.01 * CORNER, True),
        (0.99 * CORNER, False),
        (np.array([0.0, -1.01, 0.0]), True),
        (np.array([0.0, -0.99, 0.0]), False),
        (3.0 * UP, False),
    ],
)
def test_a_tip_that_strays_for_a_while_has_left_the_hole(bench, way, has_strayed):
    bench.way = lambda time: hand(HOLE + (PARAMS.strayed if time > 0.1 - 1e-9 else 0.0) * way)
    ended = bench.run()
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert ended.elapsed == pytest.approx(0.1 + STRAYED_FOR if has_strayed else 0.49, abs=1.1 * PERIOD)


@pytest.mark.parametrize("turns_with_hand", [False, True])
def test_a_peg_that_turns_in_the_hand_has_not_strayed(bench, turns_with_hand):
    """A turn of 0.15 rad moves the tip by 7 mm, by the skin, or by the hand that turned while the tip stayed."""
    bench.turn(0.05, 0.15)
    bench.way = lambda time: hand(theta=0.15 if turns_with_hand and time > 0.1 - 1e-9 else 0.0)
    assert bench.run().elapsed > 0.48
    tip, _ = end_point(bench.seen[-1].arm.tcp, 0.0, LENGTH)
    furthest = tip if turns_with_hand else bench.seen[-1].tip
    assert math.dist(furthest[:2], HOLE[:2]) > 2.0 * PARAMS.strayed


@pytest.mark.parametrize("sense", [-1.0, 1.0])
@pytest.mark.parametrize(("share", "ends"), [(1.01, True), (0.99, False)])
def test_a_peg_turned_too_far_in_the_hand_is_given_up(bench, sense, share, ends):
    bench.skin.theta, bench.way = 0.1, lambda time: hand(theta=0.1)
    bench.turn(0.1, 0.1 + sense * share * PARAMS.turned)
    ended = bench.run()
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert ended.elapsed == pytest.approx(0.1 if ends else 0.49, abs=1.1 * PERIOD)


def test_an_upright_peg_has_no_side_that_it_leans_to(bench):
    entry = Entry(PARAMS, bench.ctx.in_hand(), UP, UP, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_array_equal(entry.lean, np.zeros(3))
    assert np.abs(entry.lead[:2]) == pytest.approx(PARAMS.lead)


def test_a_small_share_of_the_caught_depth_is_no_sinking():
    step = PARAMS.sinks * PARAMS.caught
    first = EntryWatch().after(1.0, 1.01 * step, 0.0, PARAMS)
    assert (first.stall, first.inside) == (Stall(1.01 * step, 1.0), 1.0)
    creeping = first.after(2.0, 2.0 * step, 0.0, PARAMS)
    assert (creeping.stall, creeping.inside) == (Stall(1.01 * step, 1.0), 2.0)
    sinking = creeping.after(3.0, 2.02 * step, 0.0, PARAMS)
    assert sinking.stall == Stall(2.02 * step, 3.0)


def test_a_tip_may_stray_up_to_its_limit_and_anywhere_once_caught():
    away = 2.0 * PARAMS.strayed
    assert EntryWatch().after(1.0, 0.0, PARAMS.strayed, PARAMS).inside == 1.0
    assert EntryWatch().after(1.0, PARAMS.caught, away, PARAMS).inside == 0.0
    assert EntryWatch().after(1.0, 1.01 * PARAMS.caught, away, PARAMS).inside == 1.0
