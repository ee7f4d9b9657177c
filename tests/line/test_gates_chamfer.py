"""Exact contacts where peg or hole are chamfered: how deep, how smooth, and that a chamfer leads a peg in."""

import math

import mujoco
import numpy as np
import pytest

from drivers.part.round import Round
from sim.contact import rig
from sim.contact import table as contact
from sim.contact.section import chamfered_depth, section_depth
from sim.world import metering
from sim.world.truth import VOID_PENETRATION
from tests.chamfers import penetration

DT = 0.0005
PAIRS = ((0.008, 0.0081), (0.004, 0.0041), (0.016, 0.0162))
CHAMFERS = ((0.0, 5e-4), (5e-4, 0.0), (5e-4, 5e-4), (2e-4, 1e-3))
"""Chamfers of peg and hole, m."""
BOTH = Round(0.008, 5e-4), Round(0.0081, 5e-4)


def pushed(peg: Round, hole: Round, beside: float, friction: float, steps: int = 4000) -> tuple[float, float]:
    """Push an upright peg down beside the hole's axis; return the depth of its end and the penetration that lasted, m."""
    model = rig.tilted_peg(peg, hole, 0.0, 0.0, friction, DT)
    data, meters = mujoco.MjData(model), metering.new_meters()
    data.qpos[:] = [beside * math.cos(0.7), beside * math.sin(0.7), 1e-4]
    for _ in range(steps):
        data.qfrc_applied[:] = np.array([0.0, 0.0, -10.0]) - 5.0 * data.qvel
        data.userdata[contact.PENETRATION] = 0.0
        mujoco.mj_step(model, data)
        metering.judge(meters, data.userdata, metering.window(DT))
    return -float(data.qpos[2]), float(meters[metering.SUSTAINED])


@pytest.mark.parametrize(("diameter", "bore"), PAIRS)
@pytest.mark.parametrize(("ends", "mouths"), CHAMFERS)
@pytest.mark.parametrize("degrees", [1, 2, 5, 15, 30, 45, 60])
def test_a_tilted_peg_goes_as_deep_as_its_lines_fit(
    diameter: float, bore: float, ends: float, mouths: float, degrees: int
) -> None:
    peg, hole, tilt = Round(diameter, ends), Round(bore, mouths), math.radians(degrees)
    found = rig.push(rig.tilted_peg(peg, hole, tilt, 0.3, 0.0, DT), peg, tilt, 0.3, 10.0, 2.0)
    assert found.depth == pytest.approx(chamfered_depth(peg, hole, tilt, 801), rel=0.01)
    assert found.penetration < 2e-6


@pytest.mark.parametrize("degrees", [0.0, 1.0, 5.0])
def test_a_chamfered_peg_too_thick_by_a_fiftieth_of_a_millimetre_never_enters(degrees: float) -> None:
    """Its end alone goes into the mouth as far as the two chamfers let it."""
    tilt, peg, hole = math.radians(degrees), Round(0.00812, 5e-4), BOTH[1]
    found = rig.push(rig.tilted_peg(peg, hole, tilt, 0.3, 0.2, DT), peg, tilt, 0.3, 10.0, 2.0)
    exact = chamfered_depth(peg, hole, tilt, 801)
    assert 9e-4 < exact < 2e-3
    assert found.depth <= 1.01 * exact + 2e-6


@pytest.mark.parametrize(
    ("peg", "hole", "beside", "enters"),
    [
        (Round(0.008), Round(0.0081), 3e-4, False),
        (Round(0.008), Round(0.0081, 5e-4), 3e-4, True),
        (Round(0.008, 5e-4), Round(0.0081), 3e-4, True),
        (Round(0.008), Round(0.0081, 5e-4), 5.3e-4, True),
        (Round(0.008), Round(0.0081, 5e-4), 5.7e-4, False),
        (Round(0.008, 5e-4), Round(0.0081), 5.3e-4, True),
        (Round(0.008, 5e-4), Round(0.0081), 5.7e-4, False),
        (*BOTH, 1e-3, True),
        (*BOTH, 1.1e-3, False),
    ],
)
def test_a_peg_slides_in_from_beside_as_far_as_clearance_and_chamfers_are_wide(
    peg: Round, hole: Round, beside: float, enters: bool
) -> None:
    depth, lasted = pushed(peg, hole, beside, 0.2)
    assert depth == pytest.approx(rig.HOLE_DEPTH if enters else 0.0, abs=5e-6)
    assert lasted < VOID_PENETRATION


def test_friction_above_the_slope_of_a_chamfer_holds_the_peg_on_it() -> None:
    """At 45 degrees a peg slides for a coefficient below 1."""
    depth, lasted = pushed(Round(0.008), BOTH[1], 3e-4, 1.2)
    assert 0.0 < depth < 5e-4
    assert lasted < VOID_PENETRATION


@pytest.mark.parametrize(("ends", "mouths"), CHAMFERS)
@pytest.mark.parametrize("degrees", [0, 3, 20, 45, 55])
def test_a_peg_that_is_dragged_over_the_rim_stays_out_of_the_plate(ends: float, mouths: float, degrees: int) -> None:
    """A spring of at most 15 N leads it across the hole until the far rim stops it, and back."""
    peg, hole, tilt = Round(0.008, ends), Round(0.0081, mouths), math.radians(degrees)
    for azimuth in (0.0, 1.3, 3.1):
        model = rig.tilted_peg(peg, hole, tilt, azimuth, 0.2, DT)
        data, meters = mujoco.MjData(model), metering.new_meters()
        lowest = rig.lowest(peg, tilt, azimuth)
        data.qpos[:] = [-0.010 - lowest[0], 4e-4 - lowest[1], -lowest[2]]
        for step in range(1600):
            ahead = 0.012 * math.sin(2.0 * math.pi * step / 1600 - math.pi / 2)
            goal = np.array([ahead, 4e-4]) - lowest[:2]
            spring = np.clip(5e3 * (goal - data.qpos[:2]), -15.0, 15.0)
            data.qfrc_applied[:] = np.array([*spring, -8.0]) - 60.0 * data.qvel
            data.userdata[[contact.PENETRATION, contact.SURFACE]] = 0.0
            mujoco.mj_step(model, data)
            metering.judge(meters, data.userdata, metering.window(DT))
        assert meters[metering.SUSTAINED] < VOID_PENETRATION


@pytest.mark.parametrize(("ends", "mouths"), CHAMFERS)
@pytest.mark.parametrize("diameter", [0.008, 0.004])
def test_a_peg_in_any_pose_is_as_deep_in_the_plate_as_dense_samples_say(
    ends: float, mouths: float, diameter: float
) -> None:
    """Where two edges cross, the distance between them along their common normal is up to 1.42 of what a sample of either has."""
    peg, hole, rng, tried = Round(diameter, ends), Round(diameter + 1e-4, mouths), np.random.default_rng(7), 0
    while tried < 20:
        tilt, azimuth = rng.choice([0.1, 1.0]) * rng.uniform(0.0, 1.0), rng.uniform(-3.2, 3.2)
        axes, goal = rig.attitude(tilt, azimuth), rng.uniform(1e-6, 8e-6)
        place = np.array([*(rng.choice([0.1, 1.0]) * peg.reach * rng.uniform(-1.2, 1.2, size=2)), 0.0])
        low, high = -0.012, 0.008
        for _ in range(24):
            place[2] = (low + high) / 2.0
            low, high = (low, place[2]) if penetration(peg, hole, axes, place) < goal else (place[2], high)
        sampled = penetration(peg, hole, axes, place)
        if sampled > 1e-5:
            continue
        tried += 1
        model = rig.tilted_peg(peg, hole, tilt, azimuth, 0.2, DT)
        data = mujoco.MjData(model)
        data.qpos[:] = place
        mujoco.mj_forward(model, data)
        told = max(data.userdata[contact.PENETRATION], data.userdata[contact.SURFACE])
        assert sampled - 3e-7 <= told <= 1.42 * sampled + 3e-7


def test_without_chamfers_the_lines_fit_as_deep_as_the_section() -> None:
    for degrees in (1, 15, 45, 60):
        tilt = math.radians(degrees)
        lines = chamfered_depth(Round(0.008), Round(0.0081), tilt, 2001)
        assert lines == pytest.approx(section_depth(0.008, 0.0081, tilt, 4001), rel=1e-4)
