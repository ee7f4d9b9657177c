"""What round and rectangular cross-sections answer."""

import math

import numpy as np
import pytest

from drivers.frames import UP, rotation_about
from drivers.part.contract import Part
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round

PARTS: tuple[Part, ...] = (Round(0.008), Rectangular(0.008, 0.008), Rectangular(0.012, 0.007), Rectangular(0.004, 0.02))


def outline(part: Part) -> np.ndarray:
    """Return the outline by rays at many angles, those of corners among them, shape (n, 2): the oracle of what the part answers."""
    corner = math.atan2(part.half[1], part.half[0])
    corners = [corner, math.pi - corner, math.pi + corner, -corner]
    angle = np.concatenate([np.linspace(0.0, 2.0 * math.pi, 3600, endpoint=False), corners])
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    if isinstance(part, Round):
        return part.diameter / 2 * ray
    return ray * (np.array(part.half) / np.maximum(np.abs(ray), 1e-12)).min(axis=1)[:, None]


@pytest.mark.parametrize("part", PARTS)
def test_sizes_of_a_part_are_those_of_its_outline(part: Part) -> None:
    radius, extents = np.linalg.norm(outline(part), axis=1), np.ptp(outline(part), axis=0)
    assert (part.reach, part.inscribed / 2) == pytest.approx((radius.max(), radius.min()), rel=1e-4)
    assert (part.thickness, part.widest) == pytest.approx((extents[0], extents.max()), rel=1e-4)


@pytest.mark.parametrize("part", [part for part in PARTS if part.symmetry])
def test_a_part_looks_the_same_after_its_symmetry_and_not_after_half_of_it(part: Part) -> None:
    def turned(angle: float) -> float:
        c, s = math.cos(angle), math.sin(angle)
        way = np.abs(outline(part) @ np.array([[c, s], [-s, c]])) - np.array(part.half)
        return float(way.max())

    assert turned(part.symmetry) < 1e-9
    assert turned(part.symmetry / 2) > 1e-4


@pytest.mark.parametrize("part", PARTS)
def test_no_point_of_the_end_is_lower_than_the_lowest(part: Part) -> None:
    rng = np.random.default_rng(5)
    tip = np.array([0.1, -0.2, 0.3])
    for _ in range(20):
        axes = rotation_about(UP, rng.uniform(-3, 3)) @ rotation_about(np.array([1.0, 0.0, 0.0]), rng.uniform(0.1, 1))
        axes = axes @ rotation_about(UP, rng.uniform(-3, 3))
        edge = tip + outline(part) @ axes[:, :2].T
        lowest = part.lowest(tip, axes[:, 2], axes[:, 0])
        assert lowest[2] == pytest.approx(edge[:, 2].min(), abs=2e-6)
        assert np.linalg.norm(edge - lowest, axis=1).min() < 5e-5


@pytest.mark.parametrize("degrees", [1, 30, 44.9, 45.1, 60, 89])
def test_the_lowest_point_of_a_chamfered_peg_is_that_of_the_lower_rim(degrees: float) -> None:
    part, tip = Round(0.008, 7e-4), np.array([0.1, -0.2, 0.3])
    axes = rotation_about(np.array([math.sin(0.4), math.cos(0.4), 0.0]), math.radians(degrees))
    angle = np.linspace(0.0, 2.0 * math.pi, 3601)
    circle = np.array([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    rims = [
        tip[:, None] + axes @ (np.array([[r], [r], [height]]) * circle) for r, height in ((3.3e-3, 0.0), (4e-3, 7e-4))
    ]
    points = np.concatenate(rims, axis=1).T
    lowest = part.lowest(tip, axes[:, 2], axes[:, 0])
    assert lowest[2] == pytest.approx(points[:, 2].min(), abs=1e-8)
    assert np.linalg.norm(points - lowest, axis=1).min() < 5e-6


def test_an_upright_chamfered_peg_is_lowest_in_its_middle() -> None:
    np.testing.assert_array_equal(Round(0.008, 7e-4).lowest(np.ones(3), UP, np.array([1.0, 0.0, 0.0])), np.ones(3))
    assert Round(0.008, 7e-4).grown(1e-4) == Round(0.0082)


@pytest.mark.parametrize("part", PARTS)
def test_the_point_that_leads_is_the_furthest_one_and_lies_ahead(part: Part) -> None:
    axis, closing = part.leaning(0.3, 0.5)
    assert float(axis @ closing) == pytest.approx(0.0, abs=1e-15)
    azimuth = part.azimuth(0.3)
    ahead = part.reach * math.cos(0.5) * np.array([math.cos(azimuth), math.sin(azimuth)])
    expected = [*ahead, -part.reach * math.sin(0.5)]
    np.testing.assert_allclose(part.lowest(np.zeros(3), axis, closing), expected, atol=1e-15)


@pytest.mark.parametrize(
    ("part", "hole"),
    [*((part, part.grown(5e-5)) for part in PARTS), (Rectangular(0.012, 0.008), Rectangular(0.0122, 0.0081))],
)
def test_the_clearance_is_the_narrower_one(part: Part, hole: Part) -> None:
    assert part.clearance(hole) == pytest.approx(5e-5)


@pytest.mark.parametrize("part", PARTS)
def test_the_load_of_a_face_is_shared_wholly_and_evenly(part: Part) -> None:
    places, shares = part.face.groove(8.5e-4)
    strips = part.face.strips(2.5e-4)
    assert (shares.sum(), strips.sum()) == (pytest.approx(1.0), pytest.approx(1.0))
    assert float(places @ shares) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(strips, strips[::-1])


def test_the_groove_of_a_cylinder_has_the_spread_of_a_parabola() -> None:
    places, shares = Round(0.008).face.groove(8.5e-4)
    # A parabola of half width b has the variance b²/5, and b² is diameter times depth.
    assert float(places**2 @ shares) == pytest.approx(0.008 * 8.5e-4 / 5)


def test_a_rectangle_presses_the_pads_with_its_second_side() -> None:
    face = Rectangular(0.012, 0.007).face
    assert (face.width, face.is_flat, face.flat_width) == (0.007, True, 0.007)
    assert Round(0.008).face.flat_width == 0.0
