import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from drivers.quantities import TaxelFrame
from drivers.skin.layout import LAYOUTS, finger_positions, module_of, triangles
from sim.config import SimSkinConfig
from sim.hand.pads import PadLoad, Pads
from skills.tactile.image import ImageEstimator, ImageParams
from skills.tactile.picture import Projector

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
    projector, taxels, whole = Projector(layout, 1e-3, 1e6), finger_positions(layout), np.ones((2, 20), dtype=bool)
    plane = 3000.0 + 5e4 * taxels[1, :, 0] - 2e4 * taxels[1, :, 1]
    image = projector.image(np.array([np.zeros(20), plane]), whole)
    inside = projector.image(np.array([np.zeros(20), np.ones(20)]), whole) > 0.5
    expected = 3000.0 + 5e4 * projector.centres[..., 0] - 2e4 * projector.centres[..., 1]
    assert inside.sum() > 400
    assert image[inside] == pytest.approx(expected[inside], rel=1e-5)
    assert not image[~inside].any()


def _weights(layout, pixel):
    """Return the pixels' centres, shape (n, 2), m, and how much each taxel counts in each of them, shape (n, 40)."""
    taxels = finger_positions(layout)
    columns, rows = np.ceil(np.abs(taxels).max(axis=(0, 1)) / pixel - 1e-9).astype(int)
    grid = np.meshgrid(np.arange(-columns, columns + 1), np.arange(-rows, rows + 1))
    centres = np.stack(grid, axis=-1).reshape(-1, 2) * pixel
    weights = np.zeros((len(centres), 2, 20))
    for finger in range(2):
        for corners in triangles(layout):
            a, b, c = taxels[finger, corners]
            v, w = ((centres - a) @ np.linalg.inv(np.array([b - a, c - a]))).T
            inside = np.minimum(np.minimum(v, w), 1.0 - v - w) >= -1e-9
            weights[inside, finger] = 0.0
            for corner, share in zip(corners, (1.0 - v - w, v, w), strict=True):
                weights[inside, finger, corner] = share[inside]
    weights = weights.reshape(-1, 40)
    covered = weights.any(axis=1)
    return centres[covered], weights[covered]


def _moments_theta(params, full_scale, centres, weights, frame):
    """Return theta by the image's moments in plain numpy, rad: the same method without OpenCV."""
    known = frame.trusted.ravel()
    share = weights @ known / weights.sum(axis=1)
    image = weights @ np.where(known, frame.values.ravel(), 0.0) * (share >= 0.25) / np.maximum(share, 0.25)
    image = np.clip(image, 0.0, full_scale)
    image[image < params.threshold * image.max()] = 0.0
    apart = centres - np.average(centres, axis=0, weights=image)
    (xx, xy), (_, yy) = np.einsum("n,ni,nj->ij", image, apart, apart)
    return 0.5 * math.atan2(2.0 * xy, xx - yy)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_theta_is_that_of_the_moments_in_plain_numpy_within_a_tenth_of_a_degree(layout):
    params, rng = ImageParams(threshold=0.3), np.random.default_rng(7)
    estimator, reference = ImageEstimator(params, layout), _weights(layout, params.pixel)
    errors = []
    for number, theta in enumerate(np.radians(np.linspace(-85.0, 85.0, 400))):
        across = rng.uniform(-6.0, 6.0)
        load = replace(LOAD, theta=theta, offset=rng.normal(0.0, 0.7e-3), across=across, tilting=0.05 * across)
        dead = None if number % 2 else rng.integers(4) == module_of("parallelogram")
        frame = _frame(layout, load, rng, dead)
        errors.append(
            _turned(
                estimator.estimate(frame).theta - _moments_theta(params, LAYOUTS[layout].full_scale, *reference, frame)
            )
        )
    assert len(errors) == 400
    assert np.degrees(np.abs(errors).max()) < 0.1


def test_a_threshold_at_the_brightest_pixel_keeps_it():
    pose = ImageEstimator(ImageParams(threshold=1.0), "parallelogram").estimate(_frame("parallelogram", LOAD))
    assert math.isfinite(pose.theta)


def test_sum_of_the_images_is_saturated():
    frame = _frame("parallelogram", replace(LOAD, grip_force=700.0))
    full_scale = LAYOUTS["parallelogram"].full_scale
    assert ImageEstimator(ImageParams(), "parallelogram").image(frame).max() == full_scale


@pytest.mark.parametrize("layout", LAYOUTS)
def test_dead_module_is_replaced_by_the_other_finger(layout):
    estimator, rng = ImageEstimator(ImageParams(), layout), np.random.default_rng(5)
    errors = []
    for theta in np.radians(np.linspace(-80.0, 80.0, 41)):
        for module in range(4):
            pose = estimator.estimate(
                _frame(layout, replace(LOAD, theta=theta), rng, module == module_of("parallelogram"))
            )
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
    dead = module_of("parallelogram") != 2
    assert not ImageEstimator(ImageParams(), "parallelogram").estimate(_frame("parallelogram", LOAD, dead=dead)).healthy


def test_pose_bears_the_time_of_its_frame():
    assert ImageEstimator(ImageParams(), "parallelogram").estimate(_frame("parallelogram", LOAD)).stamp == 1.5
