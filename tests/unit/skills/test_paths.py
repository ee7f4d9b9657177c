"""Paths of the tip and of the finger centre."""

import math

import numpy as np
import pytest

from skills.paths import TURN_TIME, Lanes, dither, lanes, spiral, spiral_at_speed

HALF = (0.03, 0.03)


def test_neighbouring_turns_are_evenly_spaced() -> None:
    growth, turn_rate = 0.001, 2 * math.pi
    one_turn, two_turns = (spiral(n, growth, turn_rate) for n in (1.0, 2.0))
    assert np.linalg.norm(two_turns - one_turn) == pytest.approx(growth)


def test_circles_swell_from_nothing_and_fade_to_nothing() -> None:
    sizes = [float(np.linalg.norm(dither(t, 0.007, 12.0, 1.0))) for t in np.linspace(0.0, 0.999, 200)]
    assert sizes[0] == 0.0
    assert max(sizes) == pytest.approx(0.007, rel=0.02)
    assert sizes[-1] < 1e-4


@pytest.mark.parametrize("fast", [0, 1])
def test_lanes_begin_before_the_nearest_corner_turn_at_the_border_and_leave_no_place_far_from_them(fast: int) -> None:
    pitch, speed, run_in = 0.005, 0.1, 0.004
    path = lanes(HALF, pitch, speed, fast, (-0.02, 0.01), run_in)
    first = np.array([-0.03, 0.03]) * (1.0 - 1.0 / path.lanes)
    first[fast] = (-0.034, 0.034)[fast]
    np.testing.assert_allclose(path.at(0.0)[0], first)
    swept = np.array([path.at(t)[0] for t in np.arange(0.0, path.cover, 0.002)])
    assert np.abs(swept[20:, fast]).max() == pytest.approx(0.03, abs=1e-5)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 25)] * 2), axis=-1).reshape(-1, 2)
    gaps = np.sqrt(((grid[:, None] - swept[None]) ** 2).sum(axis=2)).min(axis=1)
    inside = np.abs(grid[:, fast]) < 0.03 - speed * TURN_TIME / 4
    assert gaps[inside].max() <= pitch / 2 + 2e-4
    assert gaps.max() <= 0.8 * pitch


def middle_of(path: Lanes, lane: int) -> float:
    """Return the time at which a path whose first lane begins at the border is half-way along a lane, s."""
    return (lane + 0.5) * (path.cover - TURN_TIME / 4) / path.lanes - TURN_TIME / 4


def test_every_second_cover_runs_between_the_lanes_of_the_others_and_along_both_borders() -> None:
    path = lanes(HALF, 0.005, 0.1, 1, (0.0275, 0.03), 0.0)
    first = [path.at(middle_of(path, lane))[0][0] for lane in range(path.lanes)]
    second = [path.at(middle_of(path, path.lanes + lane))[0][0] for lane in range(path.lanes + 1)]
    third = [path.at(middle_of(path, 2 * path.lanes + 1 + lane))[0][0] for lane in range(path.lanes)]
    np.testing.assert_allclose(second, np.linspace(-0.03, 0.03, path.lanes + 1), atol=1e-12)
    np.testing.assert_allclose(sorted(first), (np.array(second[1:]) + second[:-1]) / 2, atol=1e-12)
    np.testing.assert_allclose(third, first)


def test_the_lanes_velocity_is_the_derivative_of_their_place() -> None:
    path = lanes(HALF, 0.005, 0.1, 0, (0.01, -0.01), 0.004)
    for time in (0.02, 0.1, 0.66, 0.72, 0.78, 1.3):
        before, after = path.at(time - 1e-6)[0], path.at(time + 1e-6)[0]
        np.testing.assert_allclose((after - before) / 2e-6, path.at(time)[1], atol=1e-5)


def test_a_probing_spiral_keeps_its_speed_and_pitch() -> None:
    points = np.array([spiral_at_speed(t, 0.03, 0.0015) for t in np.arange(0.2, 0.6, 1e-3)])
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / 1e-3
    np.testing.assert_allclose(speeds, 0.03, rtol=0.15)
