"""The estimator by prints: accuracy over the whole range, faults of the skin, and what it learns."""

import math
from copy import copy
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from cell.lab.elastic_layer import LayerPads
from drivers.part.round import Round
from drivers.skin.layout import LAYOUTS, finger_positions, module_of, pad_size
from sim.config import PadConfig
from sim.hand.pads import Pads, contact_span
from skills.tactile.likelihood import UNKNOWN_LOAD, Found, RobustParams
from skills.tactile.robust import Load, RobustEstimator
from skills.tactile.template_fill import HALF_LINE
from skills.tactile.templates import TemplateParams, make_templates
from tests.pegs import ALL, LOAD, SKIN, folded, framed, pushed, readings, rms_degrees, shipped, swept, untaught

PARAMS = RobustParams()


def _estimator(layout):
    """Return one that has learnt nothing yet."""
    return copy(untaught(layout))


@pytest.mark.parametrize(
    ("layout", "shape", "rms", "worst", "least"),
    [
        ("parallelogram", "round", 0.8, 5.0, 0.92),
        ("base_to_base", "round", 1.6, 15.0, 0.87),
        ("parallelogram", "square", 0.8, 3.0, 0.9),
        ("base_to_base", "square", 1.2, 5.0, 0.9),
    ],
)
def test_theta_and_offset_follow_the_peg_over_the_whole_range(layout, shape, rms, worst, least):
    """The recorded noise of most taxels is lower than the noise that the estimator assumes, so sigma is rather too large."""
    is_square = shape == "square"
    square = shipped().peg.model_copy(update={"shape": "square", "diameter": None, "sides": (0.008, 0.008)})
    estimator = RobustEstimator(PARAMS, layout, square) if is_square else _estimator(layout)
    error, sigma, offset, healthy = swept(estimator, layout, peg=replace(LOAD, is_flat=is_square))
    assert healthy.all()
    assert rms_degrees(error) < rms
    assert np.degrees(np.abs(error).max()) < worst
    assert np.mean(np.abs(error) < 1.96 * sigma) > least
    assert offset.std() < 0.25e-3


@pytest.mark.parametrize("offset", [-3.5e-3, 2.5e-3])
@pytest.mark.parametrize("theta", [-1.0, 0.1, 0.6])
def test_peg_far_off_centre_is_found(theta, offset):
    load = replace(LOAD, theta=theta, offset=offset)
    pose = copy(_taught("parallelogram")).estimate(framed(readings("parallelogram", load, np.random.default_rng(2))))
    assert pose.healthy
    assert pose.theta == pytest.approx(theta, abs=0.04)
    assert pose.offset == pytest.approx(offset, abs=0.4e-3)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("theta", [-math.pi / 2, 1.565])
def test_a_peg_across_the_finger_is_at_an_end_of_the_range(layout, theta):
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


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_pad_bears_the_load_along_the_line_in_it(layout):
    peg, (length, width) = shipped().peg, pad_size(layout)
    templates = make_templates(layout, peg, TemplateParams())
    for i, j in ((0, 40), (37, 12), (180, 44), (250, 70)):
        load = replace(LOAD, theta=templates.theta[i], offset=templates.offset[j])
        low, high = contact_span(load, length, width)
        even, rising = templates.borne[0, i, j]
        assert even == pytest.approx(high - low, abs=1e-6)
        assert rising == pytest.approx((high**2 - low**2) / 2 / HALF_LINE, abs=1e-6)


@lru_cache
def _taught(layout):
    """Return one that has seen pegs over the whole range."""
    estimator = _estimator(layout)
    swept(estimator, layout, count=81)
    return estimator


def test_taxels_that_read_anything_are_left_out():
    def spoil(rng, values):
        values = values.copy()
        values.flat[rng.choice(40, 2, replace=False)] = rng.uniform(5000.0, 15000.0, 2)
        return values, ALL

    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", spoil)
    assert healthy.mean() > 0.97
    assert rms_degrees(error[healthy > 0]) < 0.75


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_peg_that_ends_between_the_pads_is_read_well(layout):
    """Prints of an endless peg err by 8 degrees and more."""
    rng, robust, rows = np.random.default_rng(8), _estimator(layout), []
    for theta in np.radians(np.linspace(-80.0, 80.0, 161)):
        load = replace(LOAD, theta=theta, reach_back=rng.uniform(0.0, 4e-3))
        pose = robust.estimate(framed(readings(layout, load, rng)))
        rows.append((folded(pose.theta - theta), pose.sigma))
    error, sigma = np.array(rows).T
    assert rms_degrees(error) < 2.3
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.94


@pytest.mark.parametrize("module", range(4))
def test_a_dead_module_and_the_pegs_end_are_found_together(module):
    """Either alone explains most of such a frame, at an angle that is off by up to 19 degrees."""
    for theta in np.radians(np.arange(-75.0, 76.0, 10.0)):
        values = readings("parallelogram", replace(LOAD, theta=theta, reach_back=4e-3))
        pose = _estimator("parallelogram").estimate(framed(np.where(module == module_of("parallelogram"), 0.0, values)))
        assert pose.healthy
        assert abs(folded(pose.theta - theta)) < min(np.radians(2.0), 1.96 * pose.sigma)


def _read(estimator, pressure):
    """Return the errors over 121 angles in no order, of pads that turn angle and offset into pressure."""
    rng, errors = np.random.default_rng(9), []
    for theta in rng.permutation(np.radians(np.linspace(-80.0, 80.0, 121))):
        values = SKIN.sensitivity * pressure(theta, rng.normal(0.0, 0.7e-3))
        values = values * rng.normal(1.0, 0.05, values.shape) + rng.normal(0.0, 300.0, values.shape)
        pose = estimator.estimate(framed(values))
        assert pose.healthy
        errors.append(folded(pose.theta - theta))
    return np.array(errors)


def _springs(blur, layout="parallelogram"):
    pads = Pads(PadConfig(blur=blur), layout)
    return lambda theta, offset: pads.pressure(replace(LOAD, theta=theta, offset=offset))


@pytest.mark.parametrize(("before", "blur"), [(None, 0.8e-3), (None, 1.6e-3), (1.6e-3, 0.8e-3)])
def test_the_point_spread_of_other_pads_is_learnt(before, blur):
    estimator = _estimator("parallelogram")
    for _ in range(2 if before else 0):
        _read(estimator, _springs(before))
    assert rms_degrees(_read(estimator, _springs(blur))[20:]) < (0.8 if before else 0.75)


def test_pads_of_another_kind_are_learnt():
    """A layer that can hardly be compressed, solved per wavenumber."""
    pads, depths = LayerPads("parallelogram", poisson=0.49), ((0.55e-3, 0.0), (0.55e-3, 0.0))

    def pressure(theta, offset):
        return pads.readings(theta, offset, depths, (LOAD.reach_tip, LOAD.reach_back), Round(LOAD.width).face)[0]

    assert rms_degrees(_read(_estimator("parallelogram"), pressure)[20:]) < 0.8


def test_peg_that_is_held_still_teaches_little():
    """Frames of one grasp err alike, by the same taxels' gains; breadth and angle are hardest to separate along the rows."""
    rng, errors = np.random.default_rng(3), []
    for theta in rng.uniform(0.02, 0.06, 30):
        gains, offset = rng.normal(1.0, 0.05, (2, 20)), rng.normal(0.0, 0.7e-3)
        estimator = _estimator("parallelogram")
        for _ in range(30):
            values = gains * readings("parallelogram", pushed(rng, theta, offset)) + rng.normal(0.0, 300.0, (2, 20))
            errors.append(folded(estimator.estimate(framed(values)).theta - theta))
    assert rms_degrees(errors) < 0.65


@pytest.mark.parametrize("dead", [(0, 2), (1, 3)])
def test_a_print_outside_the_live_taxels_is_uncertain(dead):
    estimator = _estimator("base_to_base")
    is_alive = ~np.isin(module_of("parallelogram"), dead)
    error, sigma, _, healthy = swept(
        estimator, "base_to_base", lambda _, values: (np.where(is_alive, values, 0.0), is_alive)
    )
    told = healthy > 0
    assert told.any()
    assert np.abs(error[told] / sigma[told]).max() < 6.0


def test_frame_that_is_not_believed_teaches_nothing():
    rng, spoilt, fresh = np.random.default_rng(5), _estimator("parallelogram"), _estimator("parallelogram")
    for _ in range(30):
        assert not spoilt.estimate(framed(rng.uniform(0.0, 9000.0, (2, 20)))).healthy
    frame = framed(readings("parallelogram", replace(LOAD, theta=0.4), rng))
    assert spoilt.estimate(frame) == fresh.estimate(frame)


def test_a_weak_print_is_believed_if_noise_explains_the_rest():
    """A grip of 7 N: a third and more of the frame's squares is noise."""
    weak = replace(LOAD, grip_force=7.0)
    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", peg=weak, count=81)
    assert healthy.mean() > 0.95
    assert rms_degrees(error[healthy > 0]) < 4.0


@pytest.mark.parametrize("reach", [-2e-3, 2e-3])
def test_a_peg_held_two_millimetres_elsewhere_is_read_as_well(reach):
    """Where it ends between the pads belongs to its print; a template that ends elsewhere turns to make up for it."""
    peg = replace(LOAD, reach_back=LOAD.reach_back + reach)
    assert rms_degrees(swept(_estimator("parallelogram"), "parallelogram", peg=peg)[0]) < 0.5


def test_a_copy_learns_for_itself():
    taught = _estimator("base_to_base")
    _read(taught, _springs(0.8e-3, "base_to_base"))
    frame = framed(readings("base_to_base", replace(LOAD, theta=0.6), np.random.default_rng(4)))
    assert taught.estimate(frame) != _estimator("base_to_base").estimate(frame)
    assert copy(taught).estimate(frame) == copy(taught).estimate(frame)


def _ambiguous(estimator, taught):
    """Return errors, rad, and sigmas on layout D at angles whose prints differ in little but their height; each frame is read by a copy."""
    rng, rows = np.random.default_rng(21), []
    if taught:
        swept(estimator, "base_to_base", count=81, seed=22)
    for theta in np.radians(rng.choice([-1.0, 1.0], 200) * rng.uniform(28.0, 44.0, 200)):
        values = readings("base_to_base", pushed(rng, theta, rng.normal(0.0, 0.7e-3)), rng)
        pose = copy(estimator).estimate(framed(values))
        rows.append((folded(pose.theta - theta), pose.sigma))
    return np.array(rows).T


def test_the_learnt_load_separates_angles_of_one_print():
    first, sigma = _ambiguous(_estimator("base_to_base"), taught=False)
    later, later_sigma = _ambiguous(_estimator("base_to_base"), taught=True)
    assert rms_degrees(later) < 0.8 * rms_degrees(first)
    assert np.mean(np.abs(first) < 1.96 * sigma) > 0.93
    assert np.mean(np.abs(later) < 1.96 * later_sigma) > 0.93


@pytest.mark.parametrize(("across", "bound"), [(0.0, 0.25), (7.0, 0.55)])
def test_a_push_that_tilts_the_peg_hardly_turns_theta(across, bound):
    """Noise-free: what is left are the errors of the templates."""
    estimator, errors = _estimator("parallelogram"), []
    for theta in np.radians(np.arange(-80.0, 81.0, 2.0)):
        load = replace(LOAD, theta=theta, across=across, tilting=0.045 * across)
        errors.append(folded(copy(estimator).estimate(framed(readings("parallelogram", load))).theta - theta))
    assert rms_degrees(errors) < bound


def test_nothing_is_learnt_from_a_frame_that_two_angles_explain():
    estimator, rng = _estimator("parallelogram"), np.random.default_rng(5)
    between_rows, clear = (replace(LOAD, theta=theta, offset=-3e-3) for theta in (0.05, 0.6))
    frame = framed(readings("parallelogram", clear, rng))
    untaught = copy(estimator).estimate(frame)
    poses = [estimator.estimate(framed(readings("parallelogram", between_rows, rng))) for _ in range(20)]
    assert all(pose.healthy and pose.sigma > PARAMS.sure for pose in poses)
    assert estimator.estimate(frame) == untaught


def _found(whole, theta):
    return Found(theta, 0.0, 0.01, 8000.0, 1.0, 0.0, 0.0, 3.0, 8.0, whole)


def test_the_load_is_learnt_once_from_one_angle():
    load = Load(PARAMS)
    assert load.expected == UNKNOWN_LOAD
    load.learn(_found(5.7, 0.1))
    once = load.expected
    load.learn(_found(6.7, 0.12))
    assert load.expected == once == (5.7, pytest.approx(1.0 / (2.0 * PARAMS.load_spread**2), rel=0.4))


def test_load_of_another_grip_is_learnt():
    load = Load(PARAMS)
    for number in range(6 * PARAMS.most_frames):
        load.learn(_found(5.7 if number < 2 * PARAMS.most_frames else 5.0, number % 2))
    mean, precision = load.expected
    assert mean == pytest.approx(5.0, abs=0.02)
    assert precision**-0.5 < PARAMS.load_spread
