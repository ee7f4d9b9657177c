import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from drivers.quantities import TaxelFrame
from drivers.skin.layout import LAYOUTS, MODULE_OF, finger_positions
from sim.config import SimSkinConfig
from sim.pads import PadLoad, Pads
from skills.tactile.image import ImageEstimator, ImageParams, interpolation

LOAD = PadLoad(0.0, 0.0, 30.0, 0.0, 0.0, 0.05, 0.012, 0.008)
SKIN = SimSkinConfig(kind="sim")


def _frame(layout, load, rng=None, dead=None):
    values = SKIN.sensitivity * Pads(SKIN.pad, layout).pressure(load)
    if rng is not None:
        values = values * rng.normal(1.0, SKIN.gain_spread, values.shape)
        values = values + SKIN.noise * SKIN.full_scale * rng.standard_normal(values.shape)
    trusted = np.ones(values.shape, dtype=bool) if dead is None else ~dead
    return TaxelFrame(np.where(trusted, values, 0.0), trusted, 1.5, 7)


def _turned(angle):
    """Return an angle folded to what a peg without a direction can differ by."""
    return (angle + math.pi / 2) % math.pi - math.pi / 2


@lru_cache
def _sweep(layout):
    """Return error of theta, sigma and error of the offset over pegs held anyhow, noise and imbalance included."""
    rng, estimator = np.random.default_rng(3), ImageEstimator(ImageParams(), layout)
    rows = []
    for theta in np.radians(np.linspace(-80.0, 80.0, 161)):
        across = rng.uniform(-6.0, 6.0)
        load = replace(LOAD, theta=theta, offset=rng.normal(0.0, 0.7e-3), across=across, tilting=0.05 * across)
        pose = estimator.estimate(_frame(layout, load, rng))
        if pose.healthy:
            rows.append((_turned(pose.theta - theta), pose.sigma, pose.offset - load.offset))
    return np.array(rows).T


@pytest.mark.parametrize(("layout", "most"), [("parallelogram", 6.0), ("base_to_base", 8.0)])
def test_theta_follows_the_peg_over_the_whole_range(layout, most):
    error, _, _ = _sweep(layout)
    assert error.size > 0.95 * 161
    assert np.degrees(np.sqrt(np.mean(error**2))) < most


@pytest.mark.parametrize("layout", LAYOUTS)
def test_sigma_is_the_size_of_the_errors(layout):
    error, sigma, _ = _sweep(layout)
    assert 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.4


@pytest.mark.parametrize("layout", LAYOUTS)
def test_offset_follows_the_peg(layout):
    assert _sweep(layout)[2].std() < 1.5e-3


@pytest.mark.parametrize("layout", LAYOUTS)
def test_offset_is_positive_to_the_left_of_the_axis(layout):
    poses = [
        ImageEstimator(ImageParams(), layout).estimate(_frame(layout, replace(LOAD, offset=o))) for o in (-3e-3, 3e-3)
    ]
    assert poses[0].offset < -1e-3 < 1e-3 < poses[1].offset


@pytest.mark.parametrize("layout", LAYOUTS)
def test_mirrored_peg_has_the_opposite_angle(layout):
    estimator = ImageEstimator(ImageParams(), layout)
    theta, mirrored = (estimator.estimate(_frame(layout, replace(LOAD, theta=t))).theta for t in (0.7, -0.7))
    assert mirrored == pytest.approx(-theta, abs=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_plane_over_the_taxels_is_a_plane_in_the_image(layout):
    pixels, weights = interpolation(layout, 1e-3)
    plane = 3.0 + 50.0 * finger_positions(layout)[1, :, 0] - 20.0 * finger_positions(layout)[1, :, 1]
    inside = weights[:, :, 1].any(axis=-1)
    expected = 3.0 + 50.0 * pixels[inside][:, 0] - 20.0 * pixels[inside][:, 1]
    assert weights[inside][:, 1] @ plane == pytest.approx(expected)


def test_sum_of_the_images_is_saturated():
    frame = _frame("parallelogram", replace(LOAD, grip_force=70.0))
    assert ImageEstimator(ImageParams(full_scale=9000.0), "parallelogram").image(frame).max() == 9000.0


@pytest.mark.parametrize("layout", LAYOUTS)
def test_dead_module_is_replaced_by_the_other_finger(layout):
    estimator, rng = ImageEstimator(ImageParams(), layout), np.random.default_rng(5)
    errors = []
    for theta in np.radians(np.linspace(-80.0, 80.0, 41)):
        for module in range(4):
            pose = estimator.estimate(_frame(layout, replace(LOAD, theta=theta), rng, module == MODULE_OF))
            if pose.healthy:
                errors.append(_turned(pose.theta - theta))
    assert len(errors) > 0.9 * 41 * 4
    assert np.degrees(np.sqrt(np.mean(np.square(errors)))) < 10.0


@pytest.mark.parametrize("layout", LAYOUTS)
def test_untouched_skin_shows_no_peg(layout):
    rng = np.random.default_rng(1)
    noise = [TaxelFrame(rng.normal(0.0, 300.0, (2, 20)), np.ones((2, 20), dtype=bool), 0.0, k) for k in range(50)]
    assert not any(ImageEstimator(ImageParams(), layout).estimate(frame).healthy for frame in noise)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pressure_all_over_is_no_peg(layout):
    frame = TaxelFrame(np.full((2, 20), 8000.0), np.ones((2, 20), dtype=bool), 0.0, 0)
    assert not ImageEstimator(ImageParams(), layout).estimate(frame).healthy


def test_too_few_trusted_taxels_tell_nothing():
    dead = MODULE_OF != 2
    assert not ImageEstimator(ImageParams(), "parallelogram").estimate(_frame("parallelogram", LOAD, dead=dead)).healthy


def test_pose_bears_the_time_of_its_frame():
    assert ImageEstimator(ImageParams(), "parallelogram").estimate(_frame("parallelogram", LOAD)).stamp == 1.5
