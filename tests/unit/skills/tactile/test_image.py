import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from drivers.skin.layout import LAYOUTS, finger_positions, module_of, triangles
from skills.tactile.image import ImageEstimator, ImageParams
from skills.tactile.picture import Projector
from tests.pegs import ALL, LOAD, folded, framed, pushed, readings, rms_degrees, swept

PEG = replace(LOAD, reach_back=0.012)


@lru_cache
def estimator(layout):
    return ImageEstimator(ImageParams(), layout)


@lru_cache
def _sweep(layout):
    """Return error of theta, sigma, error of the offset and health over pegs held anyhow, noise and imbalance included."""
    return swept(estimator(layout), layout, count=161, seed=3, peg=PEG)


@pytest.mark.parametrize(("layout", "most"), [("parallelogram", 6.0), ("base_to_base", 8.0)])
def test_theta_follows_the_peg_over_the_whole_range(layout, most):
    error, _, _, healthy = _sweep(layout)
    assert healthy.mean() > 0.95
    assert rms_degrees(error[healthy > 0]) < most


@pytest.mark.parametrize("layout", LAYOUTS)
def test_sigma_is_the_size_of_the_errors_and_the_offset_follows_the_peg(layout):
    error, sigma, offset, healthy = _sweep(layout)
    assert 0.7 < np.sqrt(np.mean((error / sigma)[healthy > 0] ** 2)) < 1.4
    assert offset[healthy > 0].std() < 1.5e-3


def quiet(layout, **changes):
    """Return the frame that a peg shows on a skin without noise."""
    return framed(readings(layout, replace(PEG, **changes)))


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
    made, errors = ImageEstimator(params, layout), []
    reference = LAYOUTS[layout].full_scale, *_weights(layout, params.pixel)
    for number, theta in enumerate(np.radians(np.linspace(-85.0, 85.0, 400))):
        load = pushed(rng, theta, rng.normal(0.0, 0.7e-3), PEG)
        trusted = ALL if number % 2 else rng.integers(4) != module_of("parallelogram")
        frame = framed(readings(layout, load, rng), trusted)
        errors.append(folded(made.estimate(frame).theta - _moments_theta(params, *reference, frame)))
    assert np.degrees(np.abs(errors).max()) < 0.1


def test_a_threshold_at_the_brightest_pixel_keeps_it_and_the_image_is_saturated():
    sharp = ImageEstimator(ImageParams(threshold=1.0), "parallelogram")
    assert math.isfinite(sharp.estimate(quiet("parallelogram")).theta)
    loud = quiet("parallelogram", grip_force=700.0)
    full_scale = LAYOUTS["parallelogram"].full_scale
    projector = Projector("parallelogram", ImageParams().pixel, full_scale)
    assert projector.image(loud.values, loud.trusted).max() == full_scale


@pytest.mark.parametrize("layout", LAYOUTS)
def test_dead_module_is_replaced_by_the_other_finger(layout):
    rng, errors = np.random.default_rng(5), []
    for theta in np.radians(np.linspace(-80.0, 80.0, 41)):
        for module in range(4):
            values = readings(layout, replace(PEG, theta=theta), rng)
            pose = estimator(layout).estimate(framed(values, module != module_of("parallelogram")))
            errors += [folded(pose.theta - theta)] if pose.healthy else []
    assert len(errors) > 0.9 * 41 * 4
    assert rms_degrees(errors) < 10.0
