"""The skills' decisions, as formulas."""

import math

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.part.round import Round
from drivers.quantities import SwitchState
from skills.insert.tactile_insert import turned
from skills.motion import minimum_jerk, tilted_by
from skills.seating.decision import is_seated, require_short_of_bottom
from skills.tactile.blend import Smoothing
from skills.tactile.pose import NO_PEG, PegPose

JOB = load().cell.job()
HOLE = JOB.hole
PEG = Round(0.008)


def pose(theta: float) -> PegPose:
    return PegPose(theta, 0.0, 0.01, 0.0, True, 0.0)


def tip_at(depth: float) -> np.ndarray:
    return np.array([0.0, 0.0, HOLE.centre[2] - depth])


def test_the_closing_axis_lies_in_the_plane_of_the_tilt_and_across_the_peg() -> None:
    axis, closing = PEG.leaning(0.7, 0.6)
    assert float(axis @ closing) == pytest.approx(0.0, abs=1e-15)
    assert float(np.cross(axis, closing)[2]) == pytest.approx(0.0, abs=1e-15)


def test_the_lowest_point_of_a_leaning_peg_lies_ahead_of_its_end_and_below_it() -> None:
    axis, closing = PEG.leaning(0.0, math.pi / 4)
    np.testing.assert_allclose(
        PEG.lowest(np.zeros(3), axis, closing), [0.004 / math.sqrt(2), 0.0, -0.004 / math.sqrt(2)]
    )
    np.testing.assert_allclose(PEG.lowest(np.ones(3), np.array([0.0, 0.0, 1.0]), closing), np.ones(3))


def test_the_finger_centre_of_the_spiral_stands_where_it_was_drawn() -> None:
    np.testing.assert_allclose(0.05 * tilted_by(np.array([0.006, -0.008]), 0.05)[:2], [0.006, -0.008], atol=1e-15)


def test_a_minimum_jerk_move_starts_and_ends_at_rest() -> None:
    assert minimum_jerk(0.0) == (0.0, 0.0)
    assert minimum_jerk(1.0) == (1.0, 0.0)
    assert minimum_jerk(0.5) == (0.5, 1.875)


def test_theta_is_blended_but_a_slip_is_taken_at_once() -> None:
    smooth = Smoothing(blend=0.3, jump=0.15)
    assert smooth.take(pose(0.0), pose(0.1)).theta == pytest.approx(0.03)
    assert smooth.take(pose(0.0), pose(0.4)).theta == pytest.approx(0.4)
    assert smooth.take(NO_PEG, pose(0.4)).theta == 0.4


def test_a_peg_that_turns_past_90_degrees_is_followed() -> None:
    assert Smoothing().take(pose(1.55), pose(-1.55)).theta == pytest.approx(math.pi - 1.55)


def test_the_switch_must_agree_with_the_tips_depth() -> None:
    assert is_seated(SwitchState.CLOSED, tip_at(HOLE.depth + 0.003), HOLE)
    assert not is_seated(SwitchState.OPEN, tip_at(HOLE.depth), HOLE)
    with pytest.raises(SwitchDisagreesError, match=r"tip 1\.0 mm deep"):
        is_seated(SwitchState.CLOSED, tip_at(0.001), HOLE)
    with pytest.raises(SwitchUnknownError):
        is_seated(SwitchState.UNKNOWN, tip_at(0.0), HOLE)


def test_a_tip_at_the_bottom_with_the_switch_open_is_a_fault_once_time_is_up() -> None:
    require_short_of_bottom(tip_at(HOLE.depth - 0.002), HOLE)
    with pytest.raises(SwitchDisagreesError, match="switch open"):
        require_short_of_bottom(tip_at(HOLE.depth - 0.001), HOLE)


def test_the_turn_gathers_speed_evenly_and_lags_by_half_its_run_up() -> None:
    assert turned(0.35, 0.6, 0.7) == pytest.approx((0.6 * 0.35 / 4, 0.3))
    assert turned(0.7, 0.6, 0.7) == pytest.approx((0.6 * 0.35, 0.6))
    assert turned(2.0, 0.6, 0.7) == pytest.approx((0.6 * 1.65, 0.6))
    assert turned(2.0, 0.6, 0.0) == pytest.approx((1.2, 0.6))
