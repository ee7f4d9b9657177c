"""The bounds of each phase, against shapes, motions and sums that are known otherwise."""

import math

import numpy as np
import pytest

from cell.lab.bounds import Dip, Down, Upright, critical_damping, half_width, mobility, turn_time, turning_force

TILT = math.pi / 4
THIN = Dip(hole=4.1e-3, peg=4e-3, tilt=TILT, depth=1e-4, push=7.5, mass=4.2)
USUAL = Dip(hole=8.1e-3, peg=8e-3, tilt=TILT, depth=3e-4, push=6.0, mass=4.2)


@pytest.mark.parametrize("depth", [1e-5, 1e-4, 1e-3, 2e-3])
def test_the_half_width_is_that_of_the_rim_at_the_surface(depth):
    radius = 4e-3
    angle = np.linspace(-math.pi / 2, math.pi / 2, 2_000_001)
    # The rim from its lowest point on, beside it and above it.
    beside, above = radius * np.sin(angle), radius * (1.0 - np.cos(angle)) * math.sin(TILT)
    assert half_width(depth, 2 * radius, TILT) == pytest.approx(beside[above <= depth].max(), rel=1e-4)


@pytest.mark.parametrize("dip", [THIN, USUAL])
@pytest.mark.parametrize("speed", [0.05, 0.115, 0.2])
def test_a_pass_at_the_border_just_falls(dip, speed):
    offset = dip.band(speed) / 2
    chord = 2 * math.sqrt((dip.hole / 2) ** 2 - offset**2)
    assert chord == pytest.approx(speed * dip.time + half_width(dip.depth, dip.peg, dip.tilt))


def test_a_pass_too_fast_to_fall_has_no_band():
    assert USUAL.band(0.5) == 0.0


def test_the_shortest_cover_turns_within_the_area():
    best = THIN.shortest((0.06, 0.06))
    assert best.speed == pytest.approx(0.2, abs=0.01)
    assert best.lanes == 21
    assert best.time == pytest.approx(best.lanes * (0.06 / best.speed + 0.05))


def test_a_hole_whose_dip_nobody_can_notice_has_no_cover():
    with pytest.raises(ValueError, match="not detected at any speed"):
        Dip(hole=1e-3, peg=9.9e-4, tilt=TILT, depth=3e-4, push=0.1, mass=4.0).shortest((0.06, 0.06))


def inertia_of(mass, moment, lever):
    """Return the inertia of a free body at a point `lever` below its centre of mass, shape (6, 6)."""
    cross = np.array([[0.0, -lever[2], lever[1]], [lever[2], 0.0, -lever[0]], [-lever[1], lever[0], 0.0]])
    # The centre moves with v + w x lever, so that T = 1/2 m (v - [lever] w)² + 1/2 w I w.
    J = np.hstack([np.eye(3), -cross])
    found = mass * J.T @ J
    found[3:, 3:] += moment * np.eye(3)
    return found


LEVER = np.array([0.05, 0.0, 0.15])
BODY = inertia_of(3.0, 0.02, LEVER)


def test_the_force_of_a_turn_is_mass_times_acceleration():
    axis = np.array([0.0, 1.0, 0.0])
    assert turning_force(BODY, axis) == pytest.approx(3.0 * np.cross(axis, LEVER))


def test_the_mobility_of_a_body_is_exact_beside_its_centre():
    along = LEVER / np.linalg.norm(LEVER)
    assert mobility(BODY, along) == pytest.approx(3.0)
    square = np.array([0.15, 0.0, -0.05]) / math.hypot(0.15, 0.05)
    assert mobility(BODY, square) == pytest.approx(1.0 / (1.0 / 3.0 + float(LEVER @ LEVER) / 0.02))


def test_a_turn_from_rest_has_at_least_twice_the_mean_acceleration():
    angle, coupling, push = 0.66, 4.6, 4.0
    time = turn_time(20.0, angle, coupling, push)
    assert math.hypot(push, coupling * 2.0 * angle / time**2) == pytest.approx(20.0)


def test_a_peg_that_nothing_damps_falls_evenly_accelerated():
    times, depths = Down(push=11.0, mass=6.4, damping=0.0).descent(1e-3, 0.02)
    assert times[-1] == pytest.approx(math.sqrt(2 * 0.019 * 6.4 / 11.0), rel=0.01)
    assert depths[-1] == pytest.approx(0.02, rel=0.01)


def test_a_damped_peg_descends_at_push_over_damping():
    damping = 1.5 * critical_damping(1000.0, 6.4)
    times, depths = Down(11.0, 6.4, damping, arrival=5e-3, factor=3.0).descent(0.0, 0.02)
    speed = np.gradient(depths, times)
    assert speed[np.searchsorted(depths, 0.014)] == pytest.approx(11.0 / damping, rel=0.01)
    assert speed[-10] == pytest.approx(11.0 / damping / 3.0, rel=0.01)


def test_walls_take_the_speed_that_is_too_much():
    times, depths = Down(11.0, 6.4, 0.0).descent(1e-3, 0.02, lambda time: 1e-3 + 0.02 * time)
    assert depths[5000] == pytest.approx(1e-3 + 0.02 * times[5000], rel=1e-2)


def test_a_hand_comes_upright_as_its_stiffness_and_inertia_say():
    hand = Upright(lean=0.1, rate=-0.5, stiffness=40.0, moment=0.8)
    lean, rate, step = 0.1, -0.5, 1e-5
    natural = math.sqrt(40.0 / 0.8)
    for _ in range(30_000):
        rate += step * (-(natural**2) * lean - 2.0 * natural * rate)
        lean += step * rate
    assert hand.at(0.3) == pytest.approx(lean, rel=1e-3)
    assert hand.at(0.0) == 0.1
