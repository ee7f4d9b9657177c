"""Exact contacts of a square peg: how deep, how smooth, how stiff."""

import math

import mujoco
import numpy as np
import pytest

from skills.search.surface import SurfaceEstimate
from tests.rigs import (
    HOLE_DEPTH,
    leaning,
    left_after_a_drop,
    pushed_square_depth,
    square_peg,
    square_section_depth,
    worked_in,
)

PAIRS = ((0.008, 0.0081), (0.004, 0.0041), (0.016, 0.0162))
EDGE, CORNER = 0.0, math.pi / 4
DT = 0.0005


def depth_against_exact(
    side: float, hole: float, degrees: float, azimuth: float, yaw: float
) -> tuple[float, float, float]:
    tilt = math.radians(degrees)
    axes = leaning(tilt, azimuth)
    beside = -0.15 * side * math.cos(tilt) * np.array([math.cos(azimuth), math.sin(azimuth)])
    model = square_peg(side, hole, axes, yaw, 0.0, DT)
    depth, penetration = pushed_square_depth(model, side, axes, beside, 10.0, 2500)
    return depth, square_section_depth(side, hole, axes, yaw), penetration


@pytest.mark.parametrize(("side", "hole"), PAIRS)
@pytest.mark.parametrize("degrees", [1, 5, 15, 45])
def test_a_tilted_square_peg_goes_as_deep_as_its_section_fits(side: float, hole: float, degrees: int) -> None:
    for azimuth in (EDGE, 0.5, CORNER, 2.2):
        depth, exact, penetration = depth_against_exact(side, hole, degrees, azimuth, 0.0)
        assert depth == pytest.approx(exact, rel=0.01)
        assert penetration < 2e-6


@pytest.mark.parametrize("yaw", [0.01, 0.05, -0.17])
@pytest.mark.parametrize("degrees", [2, 10, 20, 45])
def test_a_hole_that_is_turned_lets_it_in_as_far_as_its_section_fits(degrees: int, yaw: float) -> None:
    for azimuth in (0.5, CORNER, 2.2):
        depth, exact, penetration = depth_against_exact(0.008, 0.0081, degrees, azimuth, yaw)
        assert depth == pytest.approx(exact, rel=0.01)
        assert penetration < 2e-6


@pytest.mark.parametrize(("side", "hole"), PAIRS)
@pytest.mark.parametrize("degrees", [0, 1, 5])
def test_a_square_peg_too_thick_by_a_fiftieth_of_a_millimetre_never_enters(
    side: float, hole: float, degrees: int
) -> None:
    for azimuth, yaw in ((EDGE, 0.0), (CORNER, 0.0), (0.3, 0.1)):
        axes, thick = leaning(math.radians(degrees), azimuth), hole + 2e-5
        model = square_peg(thick, hole, axes, yaw, 0.2, DT)
        depth, _ = pushed_square_depth(model, thick, axes, np.array([2e-4, -1e-4]), 10.0, 2000)
        # Leaning, its edge dips into the mouth without entering: no deeper than the section allows.
        assert depth <= 1.01 * square_section_depth(thick, hole, axes, yaw) + 2e-6


def test_an_upright_square_peg_enters_only_when_it_is_turned_as_the_hole_is() -> None:
    """8 (cos y + sin y) = 8.1 at y = 0.0127."""
    for yaw, expected in ((0.0, HOLE_DEPTH), (0.01, HOLE_DEPTH), (0.0135, 0.0)):
        model = square_peg(0.008, 0.0081, np.eye(3), yaw, 0.2, DT)
        depth, penetration = pushed_square_depth(model, 0.008, np.eye(3), np.zeros(2), 10.0, 4000)
        assert depth == pytest.approx(expected, abs=2e-6)
        assert penetration < 10e-6


@pytest.mark.parametrize("degrees", [0, 90, 200, 315])
def test_a_corner_that_slides_beside_the_square_hole_feels_no_seam(degrees: int) -> None:
    axes, push, speed = leaning(math.pi / 4, CORNER), 5.0, 0.05
    way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    across = np.array([-way[1], way[0]])
    model = square_peg(0.008, 0.0081, axes, 0.1, 0.2, DT)
    data = mujoco.MjData(model)
    lowest = 0.004 * (axes[:, 0] + axes[:, 1])
    # The corner that leads the lean is the lowest; the bore's own reach to 5.7 mm from its axis.
    start = 0.0065 * across - 0.015 * way - lowest[:2]
    data.qpos[:] = [*start, -lowest[2]]
    surface, forces, dip = SurfaceEstimate(), [], 0.0
    for step in range(int(0.030 / speed / DT)):
        servo = 5e4 * (start + way * speed * step * DT - data.qpos[:2]) + 300.0 * (way * speed - data.qvel[:2])
        data.qfrc_applied[:] = [*servo, -push]
        mujoco.mj_step(model, data)
        if step * DT > 0.05:
            forces.append(servo.copy())
        if step % 20 == 0:
            dip = max(dip, surface.below(data.qpos[:3], 1))
            surface.learn(data.qpos[:3].copy(), 1)
    assert np.ptp(np.array(forces), axis=0).max() <= 3.0
    assert dip < 5e-5


@pytest.mark.parametrize(("yaw", "friction"), [(0.03, 0.0), (-0.05, 0.0), (0.08, 0.1), (0.0, 0.4)])
def test_a_square_peg_that_is_worked_in_by_an_arm_stays_out_of_the_walls(yaw: float, friction: float) -> None:
    depth, penetration = worked_in(yaw, friction, 2.0, DT)
    assert penetration < 2e-6
    if friction == 0.0:
        assert depth > 0.005


def test_a_square_peg_dropped_into_the_bore_comes_to_rest_and_stays_there() -> None:
    axes = leaning(math.radians(0.3), 0.4)
    model = square_peg(0.008, 0.0081, axes, 0.004, 0.2, DT)
    moved, speed = left_after_a_drop(model, 20_000)
    assert moved < 2e-6
    assert speed < 1e-5
