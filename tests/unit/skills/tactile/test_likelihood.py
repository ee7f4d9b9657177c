import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from drivers.skin.layout import LAYOUTS, finger_positions, pad_size
from sim.hand.pads import contact_span
from skills.tactile.likelihood import RobustParams
from skills.tactile.robust import RobustEstimator
from skills.tactile.template_fill import HALF_LINE
from skills.tactile.templates import TemplateParams, make_templates
from tests.pegs import LOAD, folded, framed, readings, rms_degrees, shipped, swept


@lru_cache
def _estimator(layout):
    return RobustEstimator(RobustParams(), layout, shipped().peg)


@pytest.mark.parametrize(
    ("layout", "rms", "worst", "least"), [("parallelogram", 0.8, 5.0, 0.92), ("base_to_base", 1.6, 15.0, 0.87)]
)
def test_theta_and_offset_follow_the_peg_over_the_whole_range(layout, rms, worst, least):
    """The recorded noise of most taxels is lower than the noise that the estimator assumes, so sigma is rather too large."""
    error, sigma, offset, healthy = swept(_estimator(layout), layout)
    assert healthy.all()
    assert rms_degrees(error) < rms
    assert np.degrees(np.abs(error).max()) < worst
    assert np.mean(np.abs(error) < 1.96 * sigma) > least
    assert offset.std() < 0.25e-3


@pytest.mark.parametrize("offset", [-3.5e-3, 2.5e-3])
@pytest.mark.parametrize("theta", [-1.0, 0.1, 0.6])
def test_peg_far_off_centre_is_found(theta, offset):
    load = replace(LOAD, theta=theta, offset=offset)
    pose = _estimator("parallelogram").estimate(framed(readings("parallelogram", load, np.random.default_rng(2))))
    assert pose.healthy
    assert pose.theta == pytest.approx(theta, abs=0.04)
    assert pose.offset == pytest.approx(offset, abs=0.4e-3)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("theta", [-math.pi / 2, 1.565])
def test_peg_across_the_finger_has_one_of_the_two_ends_of_the_range(layout, theta):
    frame = framed(readings(layout, replace(LOAD, theta=theta), np.random.default_rng(1)))
    pose = _estimator(layout).estimate(frame)
    assert abs(folded(pose.theta - theta)) < 0.03
    assert -math.pi / 2 <= pose.theta < math.pi / 2


def test_stronger_noise_means_a_larger_sigma():
    rng = np.random.default_rng(4)
    quiet = readings("parallelogram", replace(LOAD, theta=0.3), rng)
    loud = quiet + 900.0 * rng.standard_normal(quiet.shape)
    estimator = _estimator("parallelogram")
    assert estimator.estimate(framed(loud)).sigma > 1.5 * estimator.estimate(framed(quiet)).sigma


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("rises", [False, True])
def test_templates_are_what_the_blurred_groove_adds_up_to(layout, rises):
    """Piece by piece: the groove under the line in slivers, each blurred on its way to points all over the taxel."""
    params = TemplateParams().model_copy(update={"theta_step": 0.1, "offset_step": 1e-3})
    templates = make_templates(layout, shipped().peg, params)
    i, j = 9, 5
    theta, offset = templates.theta[i], templates.offset[j]
    along, beside = np.array([math.cos(theta), math.sin(theta)]), np.array([-math.sin(theta), math.cos(theta)])
    low, high = contact_span(replace(LOAD, theta=theta, offset=offset), *pad_size(layout))
    s = np.linspace(low, high, 120, endpoint=False) + (high - low) / 240
    half = math.sqrt(shipped().peg.diameter * params.indentation)
    across = np.linspace(-half, half, 15, endpoint=False) + half / 15
    points = (s[:, None, None] * along + (offset + across)[None, :, None] * beside).reshape(-1, 2)
    share = np.outer(s / HALF_LINE if rises else np.ones_like(s), 1.0 - (across / half) ** 2).ravel()
    number = np.arange(40) + 0.5
    radius, turn = params.taxel_diameter / 2 * np.sqrt(number / 40), np.pi * (1 + 5**0.5) * number
    disc = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    read = np.array(
        [
            sum(share @ np.exp(-((points - taxel - p) ** 2).sum(axis=1) / (2 * params.blur**2)) for p in disc)
            for taxel in finger_positions(layout).reshape(-1, 2)
        ]
    )
    made = (templates.rising if rises else templates.even)[0, i, j]
    scale = float(made @ read / (read @ read))
    assert np.abs(scale * read - made).max() < 0.02 * np.abs(made).max()


@pytest.mark.parametrize(("layout", "rms", "worst"), [("parallelogram", 0.8, 3.0), ("base_to_base", 1.2, 5.0)])
def test_theta_follows_a_square_peg_by_the_print_of_its_faces(layout, rms, worst):
    peg = shipped().peg.model_copy(update={"shape": "square", "diameter": None, "sides": (0.008, 0.008)})
    error, sigma, offset, healthy = swept(
        RobustEstimator(RobustParams(), layout, peg), layout, peg=replace(LOAD, is_flat=True)
    )
    assert healthy.all()
    assert rms_degrees(error) < rms
    assert np.degrees(np.abs(error).max()) < worst
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.9
    assert offset.std() < 0.25e-3


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_a_pad_bears_is_the_load_along_the_line_that_lies_in_it(layout):
    peg, (length, width) = shipped().peg, pad_size(layout)
    templates = make_templates(layout, peg, TemplateParams())
    for i, j in ((0, 40), (37, 12), (180, 44), (250, 70)):
        load = replace(LOAD, theta=templates.theta[i], offset=templates.offset[j])
        low, high = contact_span(load, length, width)
        even, rising = templates.borne[0, i, j]
        assert even == pytest.approx(high - low, abs=1e-6)
        assert rising == pytest.approx((high**2 - low**2) / 2 / HALF_LINE, abs=1e-6)
