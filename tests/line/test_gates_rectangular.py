"""Exact contacts of a rectangular peg, held against an oracle by polygon clipping: how deep, and that no side gives way."""

import math

import mujoco
import numpy as np
import pytest

from drivers.frames import UP, rotation_about
from drivers.part.rectangular import Rectangular
from sim.contact import table as contact
from tests.rigs import HOLE_DEPTH, leaning, pushed_rectangle_depth, rectangular_peg, square_section_depth
from tests.sections import below_surface, deepest, penetration

DT = 0.0005
GAP = 5e-5
PEGS = tuple(Rectangular(*sides) for sides in ((0.012, 0.008), (0.016, 0.010), (0.004, 0.020), (0.020, 0.012)))


def beside(peg: Rectangular, axes: np.ndarray, yaw: float) -> np.ndarray:
    """Return where the peg's end starts so that its lowest corner stands over the hole, however the hole is turned."""
    lead: np.ndarray = peg.lowest(np.zeros(3), axes[:, 2], axes[:, 0])
    return (rotation_about(UP, yaw) @ (0.7 * lead) - lead)[:2]


def depth_against_oracle(peg: Rectangular, degrees: float, azimuth: float, yaw: float) -> tuple[float, float, float]:
    axes, hole = leaning(math.radians(degrees), azimuth), peg.grown(GAP)
    model = rectangular_peg(peg, hole, axes, yaw, 0.0, DT)
    depth, penetration = pushed_rectangle_depth(model, peg, axes, beside(peg, axes, yaw), 10.0, 2500)
    return depth, deepest(peg, hole, axes, yaw), penetration


def test_the_oracle_agrees_with_walls_that_are_parallel_to_its_sides() -> None:
    for degrees in (1, 15, 60):
        for azimuth, yaw in ((0.0, 0.0), (0.5, 0.05), (2.2, -0.17)):
            axes = leaning(math.radians(degrees), azimuth)
            clipped = deepest(Rectangular(0.008, 0.008), Rectangular(0.0081, 0.0081), axes, yaw)
            assert clipped == pytest.approx(square_section_depth(0.008, 0.0081, axes, yaw), abs=1e-9)


@pytest.mark.parametrize("peg", PEGS)
@pytest.mark.parametrize("degrees", [1, 5, 15, 45])
def test_a_tilted_rectangular_peg_goes_as_deep_as_its_section_fits(peg: Rectangular, degrees: int) -> None:
    for azimuth in (0.3, 0.5, peg.azimuth(0.0), 1.2, 2.2):
        depth, exact, penetration = depth_against_oracle(peg, degrees, azimuth, 0.0)
        assert depth == pytest.approx(exact, rel=0.01)
        assert penetration < 2e-6


@pytest.mark.parametrize("peg", PEGS)
@pytest.mark.parametrize("yaw", [0.02, -0.17])
def test_a_hole_that_is_turned_lets_it_in_as_far_as_its_section_fits(peg: Rectangular, yaw: float) -> None:
    for degrees in (10, 30):
        for azimuth in (0.5, peg.azimuth(0.0), 2.2):
            depth, exact, penetration = depth_against_oracle(peg, degrees, azimuth, yaw)
            assert depth == pytest.approx(exact, rel=0.01)
            assert penetration < 2e-6


@pytest.mark.parametrize("excess", [(2e-5, -1e-4), (-1e-4, 2e-5)])
@pytest.mark.parametrize("degrees", [0, 1, 5])
def test_a_peg_that_is_too_thick_along_one_side_never_enters(excess: tuple[float, float], degrees: int) -> None:
    hole = Rectangular(0.0121, 0.0081)
    thick = Rectangular(hole.a + excess[0], hole.b + excess[1])
    for azimuth, yaw in ((0.0, 0.0), (math.pi / 2, 0.0), (thick.azimuth(0.0), 0.0), (0.3, 0.1)):
        axes = leaning(math.radians(degrees), azimuth)
        model = rectangular_peg(thick, hole, axes, yaw, 0.2, DT)
        depth, _ = pushed_rectangle_depth(model, thick, axes, np.array([2e-4, -1e-4]), 10.0, 2000)
        # Leaning, its edge dips into the mouth without entering: no deeper than the section allows.
        assert depth <= 1.01 * deepest(thick, hole, axes, yaw) + 2e-6


@pytest.mark.parametrize(
    ("side", "hole", "degrees", "azimuth", "yaw"),
    [
        (0.020, 0.0202, 60, math.pi / 4, -0.17),
        (0.020, 0.0202, 75, 0.3, -0.17),
        (0.020, 0.0202, 75, math.pi / 4, 0.05),
        (0.008, 0.0081, 75, math.pi / 4, -0.17),
    ],
)
def test_an_edge_that_slides_past_a_corner_of_the_hole_does_not_dip_into_the_rim(
    side: float, hole: float, degrees: float, azimuth: float, yaw: float
) -> None:
    peg, mouth, axes = Rectangular(side, side), Rectangular(hole, hole), leaning(math.radians(degrees), azimuth)
    model = rectangular_peg(peg, mouth, axes, yaw, 0.0, DT)
    start = -0.15 * side * math.cos(math.radians(degrees)) * np.array([math.cos(azimuth), math.sin(azimuth)])
    depth, penetration = pushed_rectangle_depth(model, peg, axes, start, 10.0, 2500)
    assert depth == pytest.approx(deepest(peg, mouth, axes, yaw), rel=0.01)
    assert penetration < 2e-6


def test_an_upright_rectangular_peg_enters_only_when_it_is_turned_as_the_hole_is() -> None:
    """12 cos y + 8 sin y = 12.1 at y = 0.0126, 12 sin y + 8 cos y = 8.1 at y = 0.00837; a quarter turn fits nothing."""
    peg, hole = Rectangular(0.012, 0.008), Rectangular(0.0121, 0.0081)
    for yaw, expected in (
        (0.0, HOLE_DEPTH),
        (0.0082, HOLE_DEPTH),
        (0.0085, 0.0),
        (math.pi / 2, 0.0),
        (math.pi, HOLE_DEPTH),
    ):
        model = rectangular_peg(peg, hole, np.eye(3), yaw, 0.0, DT)
        depth, penetration = pushed_rectangle_depth(model, peg, np.eye(3), np.zeros(2), 10.0, 4000)
        assert depth == pytest.approx(expected, abs=2e-6)
        assert penetration < 10e-6


def nearly_touching(
    rng: np.random.Generator, peg: Rectangular, hole: Rectangular
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return axes and place of a peg that leans little, is turned nearly as the hole is, and has two walls within 15 um; None where it is wedged."""
    azimuth, turn = (
        rng.choice([rng.uniform(-3.2, 3.2), rng.integers(4) * math.pi / 2]),
        rng.choice([0.02, 1e-3]) * rng.normal(),
    )
    axes = leaning(rng.uniform(0.0, 0.1), azimuth) @ rotation_about(UP, turn)
    place = np.array([0.0, 0.0, -rng.choice([0.0, 3e-3]) * rng.uniform() - rng.uniform(0.0, 5e-6)])
    end = peg.outline() @ axes[:, :2].T
    place[2] -= end[:, 2].min()
    below = below_surface(end + place, axes[:, 2], 0.0)
    low, high = -np.array(hole.half) - below.min(axis=0), np.array(hole.half) - below.max(axis=0)
    if (high < low - 2e-5).any():
        return None
    slack = rng.uniform(-15e-6, 5e-6, size=2)
    place[:2] = np.where(rng.integers(2, size=2), low + slack, high - slack)
    return axes, place


def test_a_peg_that_leans_little_is_as_deep_in_rim_and_walls_as_its_section_says() -> None:
    """An end's corner that stands on the surface beside the hole is behind no wall, and one in the bore hides no deeper edge above it."""
    peg, hole, rng = Rectangular(0.016, 0.010), Rectangular(0.0161, 0.0101), np.random.default_rng(5)
    model = rectangular_peg(peg, hole, np.eye(3), 0.0, 0.2, DT, "<freejoint/>")
    data, errors = mujoco.MjData(model), []
    while len(errors) < 800:
        posed = nearly_touching(rng, peg, hole)
        if posed is None:
            continue
        data.qpos[:3] = posed[1]
        mujoco.mju_mat2Quat(data.qpos[3:], posed[0].flatten())
        data.userdata[:] = 0.0
        mujoco.mj_forward(model, data)
        told = max(data.userdata[contact.PENETRATION], data.userdata[contact.SURFACE])
        errors.append(told - penetration(peg, hole, *posed))
    assert max(np.abs(errors)) < 3e-6
