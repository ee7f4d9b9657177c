"""Exact contacts: how deep, how smooth, how stiff."""

import math

import mujoco
import numpy as np
import pytest

from skills.search.surface import SurfaceEstimate
from tests.rigs import HOLE_DEPTH, left_after_a_drop, pushed_depth, section_depth, tilted_peg

PAIRS = ((0.008, 0.0081), (0.004, 0.0041), (0.016, 0.0162))
AZIMUTHS = (0.0, 0.5, 1.7, 3.0)
DT = 0.0005


@pytest.mark.parametrize(("diameter", "hole"), PAIRS)
@pytest.mark.parametrize("degrees", [1, 2, 5, 15, 45])
def test_a_tilted_peg_goes_as_deep_as_its_section_fits(diameter: float, hole: float, degrees: int) -> None:
    tilt = math.radians(degrees)
    exact = section_depth(diameter, hole, tilt)
    for azimuth in AZIMUTHS:
        depth, penetration = pushed_depth(
            tilted_peg(diameter, hole, tilt, azimuth, 0.0, DT), diameter / 2, tilt, azimuth, 10.0, 6000
        )
        assert depth == pytest.approx(exact, rel=0.01)
        assert penetration < 2e-6


@pytest.mark.parametrize(("diameter", "hole"), PAIRS)
@pytest.mark.parametrize("degrees", [0, 1, 5])
def test_a_peg_too_thick_by_a_fiftieth_of_a_millimetre_never_enters(diameter: float, hole: float, degrees: int) -> None:
    tilt = math.radians(degrees)
    thick = hole + 2e-5
    depth, _ = pushed_depth(tilted_peg(thick, hole, tilt, 0.3, 0.2, DT), thick / 2, tilt, 0.3, 10.0, 4000)
    # Leaning, its edge dips into the mouth without entering: no deeper than the section allows.
    assert depth <= 1.01 * section_depth(thick, hole, tilt) + 2e-6


def test_an_upright_peg_that_fits_falls_to_the_floor() -> None:
    depth, penetration = pushed_depth(tilted_peg(0.008, 0.0081, 0.0, 0.0, 0.2, DT), 0.0, 0.0, 0.0, 10.0, 6000)
    assert depth == pytest.approx(HOLE_DEPTH, abs=2e-6)
    assert penetration < 10e-6


@pytest.mark.parametrize("degrees", range(0, 360, 45))
@pytest.mark.parametrize("beside", [0.0065, 0.010])
def test_solid_plate_near_the_hole_is_smooth(degrees: int, beside: float) -> None:
    """A ghost seam would show as a peak of lateral force, and as a fall that never was."""
    tilt, push, speed = math.pi / 4, 5.0, 0.05
    way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    across = np.array([-way[1], way[0]])
    model = tilted_peg(0.008, 0.0081, tilt, 0.0, 0.2, DT)
    data = mujoco.MjData(model)
    # The edge that slides is ahead of the end's middle by r cos t.
    start = beside * across - 0.015 * way - np.array([0.004 * math.cos(tilt), 0.0])
    data.qpos[:] = [*start, 0.004 * math.sin(tilt)]
    surface = SurfaceEstimate()
    forces, dip = [], 0.0
    for step in range(int(0.030 / speed / DT)):
        target = start + way * speed * step * DT
        servo = 5e4 * (target - data.qpos[:2]) + 300.0 * (way * speed - data.qvel[:2])
        data.qfrc_applied[:] = [*servo, -push]
        mujoco.mj_step(model, data)
        if step * DT > 0.05:
            forces.append(servo.copy())
        if step % 20 == 0:
            dip = max(dip, surface.below(data.qpos[:3], 1))
            surface.learn(data.qpos[:3].copy(), 1)
    assert np.ptp(np.array(forces), axis=0).max() <= 3.0
    assert dip < 5e-5


def test_a_pushed_peg_brings_no_energy_back() -> None:
    """Dropped into the bore at 0.3 m/s it comes to rest and stays there."""
    model = tilted_peg(0.008, 0.0081, math.radians(0.3), 0.4, 0.2, DT)
    moved, speed = left_after_a_drop(model, 120_000)
    assert moved < 2e-6
    assert speed < 1e-5
