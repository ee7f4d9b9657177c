"""The plate as the sliding tip feels it."""

import math

import numpy as np
import pytest

from drivers.parts import Hole
from skills.search.surface import SurfaceEstimate, nominal

NOISE = np.random.default_rng(5).normal(0.0, 3e-5, 4000)


def below(surface: SurfaceEstimate, point: np.ndarray) -> float:
    """Return the depth of a point below the plane minus one standard deviation, m."""
    dip, deviation = surface.below(point)
    return dip - deviation


def slid_over(slope: tuple[float, float], lag: float = 0.0, lanes: int = 6) -> tuple[SurfaceEstimate, np.ndarray]:
    """Return what is learnt on lanes of 60 mm, 5 mm apart, and the last tip; the hand sinks by `lag` with the sense."""
    surface, scan = SurfaceEstimate(), 0
    for lane in range(lanes):
        sense = 1 if lane % 2 == 0 else -1
        for share in np.linspace(-0.5, 0.5, 58):
            x, y = 0.005 * lane, 0.06 * share * sense
            tip = np.array([x, y, 0.1 + slope[0] * x + slope[1] * y - lag * sense + NOISE[scan]])
            surface.learn(tip)
            scan += 1
    return surface, tip


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.017, 0.0), (0.0, -0.017)])
def test_a_tilted_plate_is_no_edge_and_its_normal_is_known(slope: tuple[float, float]) -> None:
    surface, tip = slid_over(slope)
    for ahead in (-0.01, 0.01):
        there = tip + np.array([0.0, ahead, slope[1] * ahead])
        assert abs(below(surface, there)) < 1e-4
    expected = np.array([-slope[0], -slope[1], 1.0]) / math.hypot(1.0, *slope)
    np.testing.assert_allclose(surface.plane(tip).normal, expected, atol=3e-3)


@pytest.mark.parametrize(
    ("slid", "away", "dip", "within"),
    [
        ({"slope": (0.035, 0.01)}, (0.0, 0.0, -5e-4), 5e-4, 1.2e-4),
        ({"slope": (0.01, 0.0), "lanes": 1}, (0.0, -5e-3, -5e-4), 5e-4, 2e-4),
        ({"slope": (0.0, 0.0), "lag": 1e-4}, (0.0, 0.0, 0.0), 0.0, 2e-4),
    ],
    ids=["at once", "right after the first turn of the path", "height that follows the sense of the path"],
)
def test_a_dip_of_half_a_millimetre_is_seen(slid, away, dip, within) -> None:
    surface, tip = slid_over(**slid)
    assert below(surface, tip + np.array(away)) == pytest.approx(dip, abs=within)


def test_nothing_is_below_a_plate_that_was_never_touched() -> None:
    assert below(SurfaceEstimate(), np.array([0.0, 0.0, -1.0])) == 0.0


def test_a_first_scan_shows_little_of_its_surroundings() -> None:
    surface = SurfaceEstimate()
    surface.learn(np.array([0.0, 0.0, 0.1]))
    assert below(surface, np.array([0.02, 0.0, 0.0995])) < 0.25 * 5e-4


def test_depth_counts_along_the_normal_from_the_surface() -> None:
    hole = Hole(diameter=0.0081, centre=(0.5, 0.0, 0.1), area=(0.06, 0.06), depth=0.02)
    assert nominal(hole).depth(np.array([0.6, 0.1, 0.098])) == pytest.approx(0.002)


def test_a_long_rest_leaves_it_as_sure_as_its_noise() -> None:
    surface = SurfaceEstimate()
    for height in np.tile(NOISE, 2):
        surface.learn(np.array([0.01, 0.02, 0.1 + height]))
    assert below(surface, np.array([0.01, 0.02, 0.0995])) == pytest.approx(5e-4, abs=1.5e-4)


def test_errors_of_whole_frames_make_no_slope() -> None:
    slopes = []
    for seed in range(20):
        errors = np.repeat(np.random.default_rng(seed).normal(0.0, 1e-4, 12), 10)
        surface = SurfaceEstimate()
        for scan, error in enumerate(errors[:116]):
            sense = 1 if scan < 58 else -1
            tip = np.array([0.005 * (scan >= 58), 0.06 * (scan % 58 / 57 - 0.5) * sense, 0.1 + error])
            surface.learn(tip)
        slopes.append(math.hypot(*surface.plane(tip).normal[:2]))
    assert math.degrees(np.sqrt(np.mean(np.square(slopes)))) < 0.5
