"""The printed image pipeline returns theta with its error."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from matplotlib.tri import LinearTriInterpolator, Triangulation

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
def test_sigma_is_the_error_and_the_offset_follows_the_peg(layout):
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


@lru_cache
def _mesh(layout, finger):
    return Triangulation(*finger_positions(layout)[finger].T, triangles(layout))


def _moments_theta(params, layout, frame):
    """Return theta by the image's moments in plain numpy, rad: the same method without OpenCV."""
    taxels = finger_positions(layout)
    columns, rows = np.ceil(np.abs(taxels).max(axis=(0, 1)) / params.pixel - 1e-9)
    x, y = np.meshgrid(np.arange(-columns, columns + 1) * params.pixel, np.arange(-rows, rows + 1) * params.pixel)

    def over(values):
        """Return the values between the taxels, of both fingers together."""
        return sum(LinearTriInterpolator(_mesh(layout, n), values[n])(x, y).filled(0.0) for n in range(2))

    covered = over(np.ones((2, 20)))
    share = over(frame.trusted.astype(float)) / np.maximum(covered, 1.0)
    image = over(np.where(frame.trusted, frame.values, 0.0)) * (share >= 0.25) / np.maximum(share, 0.25)
    image = np.clip(image, 0.0, LAYOUTS[layout].full_scale)
    image[image < params.threshold * image.max()] = 0.0
    apart = np.stack([x - np.average(x, weights=image), y - np.average(y, weights=image)])
    (xx, xy), (_, yy) = np.einsum("nm,inm,jnm->ij", image, apart, apart)
    return 0.5 * math.atan2(2.0 * xy, xx - yy)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_theta_is_that_of_the_moments_in_plain_numpy(layout):
    params, rng = ImageParams(threshold=0.3), np.random.default_rng(7)
    made, errors = ImageEstimator(params, layout), []
    for number, theta in enumerate(np.radians(np.linspace(-85.0, 85.0, 60))):
        load = pushed(rng, theta, rng.normal(0.0, 0.7e-3), PEG)
        trusted = ALL if number % 2 else rng.integers(4) != module_of("parallelogram")
        frame = framed(readings(layout, load, rng), trusted)
        errors.append(folded(made.estimate(frame).theta - _moments_theta(params, layout, frame)))
    assert np.degrees(np.abs(errors).max()) < 0.1


def test_the_brightest_pixel_is_kept_and_saturated():
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
