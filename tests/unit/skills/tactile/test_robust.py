from copy import copy
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from cell.lab.elastic_layer import LayerPads
from drivers.part.round import Round
from drivers.skin.layout import LAYOUTS, module_of
from sim.config import PadConfig
from sim.hand.pads import Pads
from skills.tactile.likelihood import UNKNOWN_LOAD, Bank, Found, RobustParams, pose_of, weights_of
from skills.tactile.posterior import NEVER
from skills.tactile.robust import LOAD_SPREAD, MOST_FRAMES, Load, RobustEstimator
from skills.tactile.templates import make_templates
from tests.pegs import ALL, LOAD, SKIN, folded, framed, pushed, readings, rms_degrees, shipped, swept

NOISE = LAYOUTS["parallelogram"].noise * LAYOUTS["parallelogram"].full_scale


@lru_cache
def _made(layout):
    return RobustEstimator(RobustParams(), layout, shipped().peg)


def _estimator(layout):
    """Return one that has learnt nothing yet."""
    return copy(_made(layout))


class Plain:
    """Prints of the stated peg on the configured pads alone: nothing is learnt and no fault considered."""

    def __init__(self, layout):
        self._params = RobustParams()
        self._bank = Bank(self._params, make_templates(layout, shipped().peg, self._params.templates))

    def estimate(self, frame):
        values, trusted = frame.values.ravel(), frame.trusted.ravel()
        weights = weights_of(self._params, NOISE, values, trusted)
        found = self._bank.compare(values, weights)
        if found.misfit > self._params.wide_misfit:
            found = self._bank.compare(values, weights, is_wide=True)
        return pose_of(self._params, NOISE, found, frame)


@lru_cache
def _plain(layout):
    return Plain(layout)


def test_whole_skin_is_read_as_well_as_without_second_thoughts():
    error, sigma, _, healthy = swept(_estimator("parallelogram"), "parallelogram")
    assert healthy.all()
    assert rms_degrees(error) < 0.8
    assert np.degrees(np.abs(error).max()) < 5.0
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.92


@pytest.mark.parametrize("module", range(4))
@pytest.mark.parametrize("reading", [0.0, -5000.0])
def test_module_that_died_unnoticed_costs_no_more_than_a_known_one(module, reading):
    def die(_, values):
        return np.where(module == module_of("parallelogram"), reading, values), ALL

    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", die)
    assert healthy.mean() > 0.99
    assert rms_degrees(error) < 1.2


def test_taxels_that_read_anything_are_left_out():
    def spoil(rng, values):
        values = values.copy()
        values.flat[rng.choice(40, 2, replace=False)] = rng.uniform(5000.0, 15000.0, 2)
        return values, ALL

    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", spoil)
    plain, _, _, _ = swept(_plain("parallelogram"), "parallelogram", spoil)
    assert healthy.mean() > 0.97
    assert rms_degrees(error[healthy > 0]) < min(1.2, 0.71 * rms_degrees(plain))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_peg_with_its_end_between_the_pads_is_read_better(layout):
    rng, robust, plain, rows = np.random.default_rng(8), _estimator(layout), _plain(layout), []
    for theta in np.radians(np.linspace(-80.0, 80.0, 161)):
        load = replace(LOAD, theta=theta, reach_back=rng.uniform(0.0, 4e-3))
        frame = framed(readings(layout, load, rng))
        poses = [each.estimate(frame) for each in (robust, plain)]
        rows.append([*(folded(pose.theta - theta) for pose in poses), poses[0].sigma])
    error, other, sigma = np.array(rows).T
    assert rms_degrees(error) < min(3.0, 0.3 * rms_degrees(other))
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.94


@pytest.mark.parametrize("module", range(4))
def test_a_dead_module_and_the_end_between_the_pads_are_found_at_once(module):
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


@pytest.mark.parametrize("blur", [0.8e-3, 1.6e-3])
def test_another_point_spread_is_learnt(blur):
    assert rms_degrees(_read(_estimator("parallelogram"), _springs(blur))[20:]) < 0.75


def test_pads_that_change_are_learnt_anew():
    estimator = _estimator("parallelogram")
    for _ in range(5):
        _read(estimator, _springs(1.6e-3))
    assert rms_degrees(_read(estimator, _springs(0.8e-3))[20:]) < 0.8


def test_pads_of_another_kind_are_learnt():
    """A layer that can hardly be compressed, solved per wavenumber."""
    pads, depths = LayerPads("parallelogram", poisson=0.49), ((0.55e-3, 0.0), (0.55e-3, 0.0))

    def pressure(theta, offset):
        return pads.readings(theta, offset, depths, (LOAD.reach_tip, LOAD.reach_back), Round(LOAD.width).face)[0]

    errors = _read(_estimator("parallelogram"), pressure)
    assert rms_degrees(errors[20:]) < min(0.8, 0.7 * rms_degrees(_read(_plain("parallelogram"), pressure)))


def test_peg_that_is_held_still_teaches_little():
    """Frames of one grasp err alike, by the same taxels' gains; breadth and angle are hardest to separate along the rows."""
    rng, rows = np.random.default_rng(3), []
    for theta in rng.uniform(0.02, 0.06, 30):
        gains, offset = rng.normal(1.0, 0.05, (2, 20)), rng.normal(0.0, 0.7e-3)
        estimators = (_estimator("parallelogram"), _plain("parallelogram"))
        for _ in range(30):
            values = gains * readings("parallelogram", pushed(rng, theta, offset)) + rng.normal(0.0, 300.0, (2, 20))
            rows.append([folded(each.estimate(framed(values)).theta - theta) for each in estimators])
    robust, plain = np.array(rows).T
    assert rms_degrees(robust) < 1.5 * rms_degrees(plain)


@pytest.mark.parametrize("dead", [(0, 2), (1, 3)])
def test_print_that_no_taxel_left_can_show_is_not_taken_for_a_certain_one(dead):
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


def test_a_weak_print_is_believed_where_its_noise_explains_the_rest_and_noise_alone_is_not():
    """A grip of 7 N: a third and more of the frame's squares is noise."""
    weak = replace(LOAD, grip_force=7.0)
    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", peg=weak, count=81)
    assert healthy.mean() > 0.95
    assert rms_degrees(error[healthy > 0]) < 4.0
    rng = np.random.default_rng(5)
    poses = [
        _estimator("parallelogram").estimate(framed(SKIN.noise * SKIN.full_scale * rng.standard_normal((2, 20))))
        for _ in range(50)
    ]
    assert not any(pose.healthy for pose in poses)


@pytest.mark.parametrize("reach", [-2e-3, 2e-3])
def test_a_peg_that_stands_two_millimetres_elsewhere_in_the_hand_is_read_as_well(reach):
    """Where it ends between the pads belongs to its print; a template that ends elsewhere turns to make up for it."""
    peg = replace(LOAD, reach_back=LOAD.reach_back + reach)
    robust, plain = (
        rms_degrees(swept(make("parallelogram"), "parallelogram", peg=peg)[0]) for make in (_estimator, _plain)
    )
    assert robust < 0.8
    assert robust < 0.9 * plain


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


def test_angles_of_one_print_are_told_by_the_load_that_was_learnt():
    first, _ = _ambiguous(_estimator("base_to_base"), taught=False)
    later, sigma = _ambiguous(_estimator("base_to_base"), taught=True)
    assert rms_degrees(later) < 0.8 * rms_degrees(first)
    assert np.mean(np.abs(later) < 1.96 * sigma) > 0.93


def test_sigma_of_a_first_frame_covers_the_other_angle_of_its_print():
    error, sigma = _ambiguous(_estimator("base_to_base"), taught=False)
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.93


@pytest.mark.parametrize(("across", "bound"), [(0.0, 0.25), (7.0, 0.55)])
def test_a_push_that_tilts_the_peg_in_its_pads_hardly_turns_what_is_read(across, bound):
    """Noise-free: what is left are the errors of the templates."""
    estimator, errors = _estimator("parallelogram"), []
    for theta in np.radians(np.arange(-80.0, 81.0, 2.0)):
        load = replace(LOAD, theta=theta, across=across, tilting=0.045 * across)
        errors.append(folded(copy(estimator).estimate(framed(readings("parallelogram", load))).theta - theta))
    assert rms_degrees(errors) < bound


def _found(whole, theta, sigma=0.01):
    return Found(theta, 0.0, sigma, 8000.0, 1.0, 0.0, 0.0, 3.0, 8.0, whole)


def test_no_load_is_expected_before_a_frame_is_sure_of_its_angle():
    load = Load()
    assert load.expected == UNKNOWN_LOAD
    load.learn(_found(5.7, 0.1, sigma=0.1))
    assert load.expected == UNKNOWN_LOAD


def test_load_of_a_peg_that_does_not_turn_is_learnt_once():
    load = Load()
    load.learn(_found(5.7, 0.1))
    once = load.expected
    load.learn(_found(6.7, 0.12))
    assert load.expected == once == (5.7, pytest.approx(1.0 / (2.0 * LOAD_SPREAD**2), rel=0.4))


def test_load_of_another_grip_is_learnt():
    load = Load()
    for number in range(6 * MOST_FRAMES):
        load.learn(_found(5.7 if number < 2 * MOST_FRAMES else 5.0, number % 2))
    mean, precision = load.expected
    assert mean == pytest.approx(5.0, abs=0.02)
    assert precision**-0.5 < LOAD_SPREAD


def test_prints_of_which_some_are_impossible_have_no_endless_chance():
    """A module is dead and the peg ends between the pads, so that few taxels are left and broad prints fit with no load at all."""
    values = readings("parallelogram", replace(LOAD, theta=np.radians(45.0), reach_back=4e-3)).ravel()
    weights = np.where(
        module_of("parallelogram").ravel() == 3, 0.0, weights_of(RobustParams(), NOISE, values, ALL.ravel())
    )
    bank = _made("parallelogram")._usual._breadths
    assert bank.compare(values, weights, believed=(3.0, 1.0)).chance < -1e-6 * NEVER
