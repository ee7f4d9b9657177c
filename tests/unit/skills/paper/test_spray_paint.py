"""The spray-paint path of the printed search."""

import math

import numpy as np
import pytest

from skills.paper.spray_paint import spray_paint

HALF = (0.03, 0.03)


def test_the_path_begins_at_its_start() -> None:
    path = spray_paint(HALF, 0.005, 0.1, 1, (-0.012, 0.02))
    np.testing.assert_allclose(path.at(0.0)[0], [-0.012, 0.02], atol=1e-12)


def test_no_place_of_the_area_is_further_from_the_path_than_half_the_pitch() -> None:
    pitch = 0.005
    path = spray_paint(HALF, pitch, 0.1, 1, (0.01, 0.0))
    points = np.array([path.at(t)[0] for t in np.arange(0.0, path.period(), 0.005)])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 25)] * 2), axis=-1).reshape(-1, 2)
    gaps = np.sqrt(((grid[:, None] - points[None]) ** 2).sum(axis=2)).min(axis=1)
    assert gaps.max() <= pitch / 2 + 2e-4


def test_the_slow_axis_first_goes_to_the_nearer_edge() -> None:
    for start in (-0.01, 0.01):
        _, velocity = spray_paint(HALF, 0.005, 0.1, 1, (start, 0.0)).at(0.0)
        assert math.copysign(1.0, velocity[0]) == math.copysign(1.0, start)


def test_the_velocity_is_the_derivative_of_the_point() -> None:
    path = spray_paint(HALF, 0.005, 0.1, 0, (0.01, -0.02))
    h = 1e-6
    np.testing.assert_allclose(path.at(1.3)[1], (path.at(1.3 + h)[0] - path.at(1.3 - h)[0]) / (2 * h), atol=1e-6)


def test_the_fast_axis_peaks_at_the_stated_speed() -> None:
    path = spray_paint(HALF, 0.005, 0.4, 1, (0.01, -0.02))
    speeds = [abs(path.at(time)[1][1]) for time in np.arange(0.0, 2.0, 0.005)]
    assert max(speeds) == pytest.approx(0.4, rel=1e-2)
