"""Exact contacts of square and rectangular pegs, compared with an oracle by polygon clipping."""

import math

import mujoco
import numpy as np
import pytest

from cell.lab.contact_rig import HOLE_DEPTH, attitude
from drivers.frames import UP, rotation_about
from drivers.part.rectangular import Rectangular
from sim.contact import table as contact
from tests.rigs import over, plate_with, pushed
from tests.sections import below_surface, deepest, penetration

GAP = 5e-5
SIDES = ((8, 8), (4, 4), (16, 16), (12, 8), (16, 10), (4, 20), (20, 12))
"""mm."""
PEGS = [Rectangular(1e-3 * a, 1e-3 * b) for a, b in SIDES]


LEANS = [(1, 0.0), (5, 0.0), (15, 0.0), (45, 0.0), (10, 0.02), (20, 0.05), (30, -0.17)]
"""Leans of the peg, degrees, and turns of the hole, rad."""


@pytest.mark.parametrize(
    ("peg", "degrees", "yaw", "azimuths"),
    [
        (*case, ((0.3, peg.azimuth(0.0)), (0.5, 2.2))[number % 2])
        for peg in (PEGS[0], PEGS[3], PEGS[5])
        for number, case in enumerate((peg, *lean) for lean in LEANS)
    ]
    + [(peg, 20, 0.05, (0.5, peg.azimuth(0.0))) for peg in PEGS],
    ids=str,
)
def test_a_tilted_peg_goes_as_deep_as_its_section_fits(
    peg: Rectangular, degrees: int, yaw: float, azimuths: tuple[float, float]
) -> None:
    """Its lowest corner starts over the hole."""
    hole = peg.grown(GAP)
    for azimuth in azimuths:
        axes = attitude(math.radians(degrees), azimuth)
        lead: np.ndarray = peg.lowest(np.zeros(3), axes[:, 2], axes[:, 0])
        start = (rotation_about(UP, yaw) @ (0.7 * lead) - lead)[:2]
        depth, lasted = pushed(plate_with(hole, yaw), peg, axes, start)
        assert depth == pytest.approx(deepest(peg, hole, axes, yaw), rel=0.01)
        assert lasted < 2e-6


@pytest.mark.parametrize("excess", [(2e-5, 2e-5), (2e-5, -1e-4), (-1e-4, 2e-5)])
@pytest.mark.parametrize("hole", [Rectangular(0.0081, 0.0081), Rectangular(0.0121, 0.0081)], ids=str)
@pytest.mark.parametrize("degrees", [0, 5])
def test_a_peg_too_thick_along_one_side_never_enters(
    hole: Rectangular, excess: tuple[float, float], degrees: int
) -> None:
    thick = Rectangular(hole.a + excess[0], hole.b + excess[1])
    for azimuth, yaw in ((0.0, 0.0), (math.pi / 2, 0.0), (thick.azimuth(0.0), 0.0), (0.3, 0.1)):
        axes = attitude(math.radians(degrees), azimuth)
        depth, _ = pushed(plate_with(hole, yaw), thick, axes, np.array([2e-4, -1e-4]), 0.2, 2000)
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
def test_an_edge_sliding_past_a_corner_does_not_dip_into_the_rim(
    side: float, hole: float, degrees: float, azimuth: float, yaw: float
) -> None:
    peg, mouth, axes = Rectangular(side, side), Rectangular(hole, hole), attitude(math.radians(degrees), azimuth)
    start = -0.15 * side * math.cos(math.radians(degrees)) * np.array([math.cos(azimuth), math.sin(azimuth)])
    depth, lasted = pushed(plate_with(mouth, yaw), peg, axes, start)
    assert depth == pytest.approx(deepest(peg, mouth, axes, yaw), rel=0.01)
    assert lasted < 2e-6


@pytest.mark.parametrize(
    ("peg", "yaw", "expected"),
    [
        (PEGS[0], 0.0, HOLE_DEPTH),
        (PEGS[0], 0.01, HOLE_DEPTH),
        (PEGS[0], 0.0135, 0.0),
        (PEGS[3], 0.0, HOLE_DEPTH),
        (PEGS[3], 0.0082, HOLE_DEPTH),
        (PEGS[3], 0.0085, 0.0),
        (PEGS[3], math.pi / 2, 0.0),
        (PEGS[3], math.pi, HOLE_DEPTH),
    ],
    ids=str,
)
def test_an_upright_peg_enters_only_if_turned_as_the_hole_is(peg: Rectangular, yaw: float, expected: float) -> None:
    """8 (cos y + sin y) = 8.1 at y = 0.0127, and 12 sin y + 8 cos y = 8.1 at y = 0.00837; a quarter turn fits nothing."""
    depth, lasted = pushed(plate_with(peg.grown(GAP), yaw), peg, np.eye(3), np.zeros(2), 0.0, 4000)
    assert depth == pytest.approx(expected, abs=2e-6)
    assert lasted < 10e-6


def nearly_touching(
    rng: np.random.Generator, peg: Rectangular, hole: Rectangular
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return axes and place of a nearly upright, nearly aligned peg with two walls within 15 um; None if it is wedged."""
    azimuth, turn = (
        rng.choice([rng.uniform(-3.2, 3.2), rng.integers(4) * math.pi / 2]),
        rng.choice([0.02, 1e-3]) * rng.normal(),
    )
    axes = attitude(rng.uniform(0.0, 0.1), azimuth) @ rotation_about(UP, turn)
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


def test_a_slightly_leaning_peg_penetrates_as_its_section_says() -> None:
    """An end's corner that stands on the surface beside the hole is behind no wall, and one in the bore hides no deeper edge above it."""
    peg, hole, rng = Rectangular(0.016, 0.010), Rectangular(0.0161, 0.0101), np.random.default_rng(5)
    model, data = over(plate_with(hole), peg, np.eye(3), 0.2, "<freejoint/>")
    errors: list[float] = []
    while len(errors) < 400:
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
