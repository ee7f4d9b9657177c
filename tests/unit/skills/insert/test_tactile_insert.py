"""Setpoints of the insertion, scan by scan, and its endings; the test sets the pose of the hand and of the peg."""

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, rotation_about
from drivers.quantities import Pose, Vector
from skills.catalogue import INSERT
from skills.contract import Outcome, Reason
from skills.insert.tactile_insert import run, turned
from skills.motion import STRAY
from skills.search.surface import Plane
from tests import scripted
from tests.fakes import PERIOD, Rig
from tests.scripted import CELL, HOLE, LIGHT, SIDE
from tests.unit.skills.benches import SkillBench

PARAMS = CELL.params(INSERT)
TILT = 0.5
"""Lean of a peg that the search has left in the hole's mouth, rad."""
DIP = 1e-3
"""Depth of its tip, m."""
FELT = rotation_about(np.array([0.0, 1.0, 0.0]), 0.04) @ UP
"""Normal of a plate that is not level."""


def hand(tilt: float = TILT, tip: Vector = HOLE - DIP * UP, about: Vector = SIDE) -> Pose:
    """Return the hand whose peg leans by `tilt`, rad, about an axis, with its tip at `tip`, m."""
    return scripted.hand(tip, tilt, about)


@pytest.fixture
def make(tmp_path):
    """Return what makes the bench of a first attempt in a cell with some settings."""

    def made(*sets):
        rig = Rig(load(sets=[LIGHT, *sets]), tmp_path)
        return SkillBench(rig, run, rig.cell.config.plan(0).insert, lambda time: hand())

    return made


@pytest.fixture
def bench(make):
    return make()


def strayed(step):
    """Return a way whose tip is off by a step, m, from the second scan on."""
    return lambda time: hand(tip=HOLE - DIP * UP + (step if time > 1e-9 else 0.0))


@pytest.mark.parametrize("normal", [None, FELT])
def test_the_axis_goes_to_the_normal_at_the_turn_rate(bench, normal):
    rate, run_up, goal = 2.0, 0.1, UP if normal is None else normal
    ended = bench.run(None if normal is None else Plane(HOLE, normal), turn_rate=rate, turn_run_up=run_up)
    start = bench.seen[0].axis
    whole, about = angle_between(start, goal), np.cross(start, goal)
    about /= np.linalg.norm(about)
    for scan, setpoint in enumerate(bench.commanded):
        angle, spin = turned(scan * PERIOD, rate, run_up)
        np.testing.assert_allclose(setpoint.axis, rotation_about(about, angle) @ start, atol=1e-12)
        np.testing.assert_allclose(setpoint.twist.angular, spin * about, atol=1e-12)
        np.testing.assert_array_equal(setpoint.twist.linear, np.zeros(3))
        np.testing.assert_array_equal(setpoint.roll, bench.seen[0].arm.tcp.rotation[:, 2])
    assert (ended.outcome, ended.phi) == (Outcome.SUCCESS, pytest.approx(whole))
    assert ended.elapsed == pytest.approx(whole / rate + run_up / 2, abs=PERIOD)
    assert angle_between(bench.commanded[-1].axis, goal) <= rate * PERIOD


@pytest.mark.parametrize(
    ("time", "run_up", "angle", "rate"),
    [(0.35, 0.7, 0.6 * 0.35 / 4, 0.3), (0.7, 0.7, 0.6 * 0.35, 0.6), (2.0, 0.7, 0.6 * 1.65, 0.6), (2.0, 0.0, 1.2, 0.6)],
)
def test_the_turn_gathers_speed_evenly_and_lags_by_half_its_run_up(time, run_up, angle, rate):
    assert turned(time, 0.6, run_up) == pytest.approx((angle, rate))


def test_the_push_is_that_of_equation_7_below_the_surface(bench):
    low, high, below = 300.0, 1200.0, 0.012
    bench.way = lambda time: hand(0.6 - 0.6 * time)
    bench.run(push_stiffness=(low, high), push_offset=below)
    for seen, setpoint in bench.scans():
        share = angle_between(seen.axis, UP) / angle_between(bench.seen[0].axis, UP)
        assert setpoint.stiffness[2] == pytest.approx(high * (low / high) ** share)
        assert setpoint.tip[2] == pytest.approx(HOLE[2] - below)
    assert bench.commanded[-1].stiffness[2] > 1.5 * low  # and each setpoint keeps its own
    assert bench.commanded[0].stiffness[2] == pytest.approx(low)


@pytest.mark.parametrize(("tilt", "about"), [(TILT, SIDE), (TILT, np.array([0.6, -0.8, 0.0])), (0.0, SIDE)])
def test_the_setpoint_stands_ahead_towards_the_side_that_the_peg_leans_to(bench, tilt, about):
    bench.way = lambda time: hand(tilt, about=about)
    bench.run(Plane(HOLE, rotation_about(SIDE, 0.2) @ UP), forward=2e-3)
    ahead = 2e-3 * np.cross(about, UP)[:2] if tilt else np.zeros(2)
    np.testing.assert_allclose(bench.commanded[0].tip[:2] - HOLE[:2], ahead, atol=1e-9)


@pytest.mark.parametrize("rate", [0.0, 10.0, 1e3])
def test_the_setpoint_follows_the_tip_at_the_compliance_rate(bench, rate):
    step = np.array([1e-3, -2e-3, 0.0])
    bench.way = strayed(step)
    bench.run(compliance_rate=rate, forward=0.0)
    for scan, setpoint in enumerate(bench.commanded):
        left = max(1.0 - rate * PERIOD, 0.0) ** scan
        np.testing.assert_allclose(setpoint.tip[:2], (HOLE + (1.0 - left) * step)[:2], atol=1e-9)


@pytest.mark.parametrize(("diameter", "furthest"), [(0.004, STRAY), (0.012, 0.006)])
def test_a_stray_tip_is_followed_as_far_as_a_hole_can_be(make, diameter, furthest):
    """Or half the peg's breadth, if that is more."""
    bench = make(f"peg.diameter={diameter}", f"hole.diameter={diameter + 1e-4}")
    bench.way = strayed(0.01 * SIDE)
    bench.run(compliance_rate=1e3, forward=0.0)
    assert bench.commanded[-1].tip[0] - HOLE[0] == pytest.approx(furthest)


def test_progress_is_the_share_of_the_tilt_that_is_gone(bench):
    bench.way = lambda time: hand(TILT + 0.1 if 0.0 < time < 0.1 else TILT - 0.5 * time)
    bench.run()
    expected = [1.0 - min(angle_between(seen.axis, UP) / TILT, 1.0) for seen in bench.seen]
    assert bench.progress == pytest.approx(expected)
    assert min(bench.progress) == 0.0 < max(bench.progress)


NEARLY = 0.09
"""Lean of an aligned peg, rad."""


@pytest.mark.parametrize("depth", [-0.002, 0.0, 0.002])
def test_an_aligned_peg_is_handed_on_at_any_depth(bench, depth):
    bench.way = lambda time: hand(TILT if time < 0.1 else NEARLY, HOLE - depth * UP)
    ended = bench.run()
    assert ended.outcome is Outcome.SUCCESS
    assert (ended.elapsed, ended.first_phi, ended.phi) == pytest.approx((0.1, TILT, NEARLY), abs=PERIOD + 1e-9)


def test_a_peg_is_aligned_below_the_recipes_tilt_and_not_above(bench):
    bench.way = lambda time: hand(PARAMS.aligned + 1e-6 - (2e-6 if time > 0.2 else 0.0), HOLE - 2e-3 * UP)
    assert bench.run().elapsed == pytest.approx(0.2, abs=PERIOD + 1e-9)


def test_an_insertion_that_takes_too_long_reports_its_last_tilt(bench):
    bench.way = lambda time: hand(TILT - 0.2 * time)
    ended = bench.run(timeout=0.3)
    assert (ended.outcome, ended.reason, ended.elapsed) == (Outcome.FAILURE, Reason.NOT_ALIGNED, 0.3)
    assert (ended.first_phi, ended.phi) == pytest.approx((TILT, TILT - 0.2 * 0.29), abs=3e-3)
