import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from cell.config import load
from drivers.quantities import TaxelFrame
from drivers.skin_layout import LAYOUTS, MODULE_OF, finger_positions, pad_size
from sim.config import SimSkinConfig
from sim.pads import PadLoad, Pads, contact_span
from skills.tactile.likelihood import LikelihoodEstimator, LikelihoodParams
from skills.tactile.templates import HALF_LINE, TemplateParams, make_templates

LOAD = PadLoad(0.0, 0.0, 30.0, 0.0, 0.0, 0.05, 0.015, 0.008)
SKIN = SimSkinConfig(kind="sim")
ALL = np.ones((2, 20), dtype=bool)


@lru_cache
def _peg():
    return load().cell.peg


@lru_cache
def _estimator(layout):
    return LikelihoodEstimator(LikelihoodParams(), layout, _peg())


@lru_cache
def _pads(layout):
    return Pads(SKIN.pad, layout)


def _frame(layout, load, rng=None, trusted=ALL):
    values = SKIN.sensitivity * _pads(layout).pressure(load)
    if rng is not None:
        values = values * rng.normal(1.0, SKIN.gain_spread, values.shape)
        values = values + SKIN.noise * SKIN.full_scale * rng.standard_normal(values.shape)
    return TaxelFrame(np.where(trusted, values, 0.0), trusted, 1.5, 7)


def _folded(angle):
    return (angle + math.pi / 2) % math.pi - math.pi / 2


def _pushed(rng, theta, offset):
    across = rng.uniform(-7.0, 7.0)
    return replace(LOAD, theta=theta, offset=offset, across=across, tilting=0.045 * across)


@lru_cache
def _sweep(layout, module=None):
    """Return error of theta, sigma, error of the offset and health over pegs held and pushed anyhow."""
    rng, rows = np.random.default_rng(11), []
    for theta in np.radians(np.linspace(-80.0, 80.0, 321)):
        load = _pushed(rng, theta, rng.normal(0.0, 0.7e-3))
        pose = _estimator(layout).estimate(_frame(layout, load, rng, ALL if module is None else module != MODULE_OF))
        rows.append((_folded(pose.theta - theta), pose.sigma, pose.offset - load.offset, pose.healthy))
    return np.array(rows).T


@pytest.mark.parametrize(("layout", "rms", "worst"), [("parallelogram", 0.8, 5.0), ("base_to_base", 1.6, 15.0)])
def test_theta_follows_the_peg_over_the_whole_range(layout, rms, worst):
    error, _, _, healthy = _sweep(layout)
    assert healthy.mean() > 0.99
    assert np.degrees(np.sqrt(np.mean(error**2))) < rms
    assert np.degrees(np.abs(error).max()) < worst


def test_ninety_five_percent_of_the_errors_lie_within_two_sigma():
    error, sigma, _, _ = _sweep("parallelogram")
    assert 0.90 < np.mean(np.abs(error) < 1.96 * sigma) < 0.99


@pytest.mark.parametrize("layout", LAYOUTS)
def test_offset_is_known_to_a_quarter_of_a_millimetre(layout):
    assert _sweep(layout)[2].std() < 0.25e-3


@pytest.mark.parametrize("module", range(4))
def test_known_dead_module_costs_little(module):
    error, _, _, healthy = _sweep("parallelogram", module)
    assert np.degrees(np.sqrt(np.mean(error[healthy > 0] ** 2))) < 1.2


@pytest.mark.parametrize("offset", [-3.5e-3, 2.5e-3])
@pytest.mark.parametrize("theta", [-1.0, 0.1, 0.6])
def test_peg_far_off_centre_is_found(theta, offset):
    pose = _estimator("parallelogram").estimate(
        _frame("parallelogram", replace(LOAD, theta=theta, offset=offset), np.random.default_rng(2))
    )
    assert pose.healthy
    assert pose.theta == pytest.approx(theta, abs=0.04)
    assert pose.offset == pytest.approx(offset, abs=0.4e-3)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("theta", [-math.pi / 2, 1.565])
def test_peg_across_the_finger_has_one_of_the_two_ends_of_the_range(layout, theta):
    pose = _estimator(layout).estimate(_frame(layout, replace(LOAD, theta=theta), np.random.default_rng(1)))
    assert abs(_folded(pose.theta - theta)) < 0.03
    assert -math.pi / 2 <= pose.theta < math.pi / 2


@pytest.mark.parametrize("layout", LAYOUTS)
def test_mirrored_frame_has_the_opposite_pose(layout):
    load = replace(LOAD, theta=0.5, offset=1e-3, across=4.0, tilting=0.2)
    mirrored = replace(load, theta=-0.5, offset=-1e-3, across=-4.0, tilting=-0.2)
    one, other = (_estimator(layout).estimate(_frame(layout, each)) for each in (load, mirrored))
    assert (other.theta, other.offset) == pytest.approx((-one.theta, -one.offset), abs=1e-6)


def test_stronger_noise_means_a_larger_sigma():
    rng = np.random.default_rng(4)
    quiet = _frame("parallelogram", replace(LOAD, theta=0.3), rng)
    loud = replace(quiet, values=quiet.values + 900.0 * rng.standard_normal((2, 20)))
    estimator = _estimator("parallelogram")
    assert estimator.estimate(loud).sigma > 1.5 * estimator.estimate(quiet).sigma


NONSENSE = {
    "all zero": lambda rng: np.zeros((2, 20)),
    "noise alone": lambda rng: rng.normal(0.0, 300.0, (2, 20)),
    "loud noise": lambda rng: rng.normal(0.0, 3000.0, (2, 20)),
    "all at the rail": lambda rng: np.full((2, 20), 38000.0),
    "pressed all over": lambda rng: 8000.0 + rng.normal(0.0, 300.0, (2, 20)),
    "drawn at random": lambda rng: rng.uniform(0.0, 20000.0, (2, 20)),
    "below the baseline": lambda rng: np.full((2, 20), -5000.0),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", NONSENSE)
def test_nonsense_is_never_a_healthy_pose(layout, kind):
    rng = np.random.default_rng(6)
    poses = [_estimator(layout).estimate(TaxelFrame(NONSENSE[kind](rng), ALL, 0.0, k)) for k in range(200)]
    assert not any(pose.healthy for pose in poses)
    assert np.isfinite([(p.theta, p.offset, p.sigma, p.residual) for p in poses]).all()


def test_too_few_trusted_taxels_tell_nothing():
    trusted = ALL.copy()
    trusted.flat[:21] = False
    assert not _estimator("parallelogram").estimate(_frame("parallelogram", LOAD, trusted=trusted)).healthy


def test_pose_bears_the_time_of_its_frame():
    assert _estimator("parallelogram").estimate(_frame("parallelogram", LOAD)).stamp == 1.5


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("rises", [False, True])
def test_templates_are_what_the_blurred_groove_adds_up_to(layout, rises):
    """Piece by piece: the groove under the line in slivers, each blurred on its way to points all over the taxel."""
    params = TemplateParams(theta_step=0.1, offset_step=1e-3)
    templates = make_templates(layout, _peg(), params)
    i, j = 9, 5
    theta, offset = templates.theta[i], templates.offset[j]
    along, beside = np.array([math.cos(theta), math.sin(theta)]), np.array([-math.sin(theta), math.cos(theta)])
    low, high = contact_span(replace(LOAD, theta=theta, offset=offset), *pad_size(layout))
    s = np.linspace(low, high, 120, endpoint=False) + (high - low) / 240
    half = math.sqrt(_peg().diameter * params.indentation)
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
    made = (templates.rising if rises else templates.even)[i, j]
    scale = float(made @ read / (read @ read))
    assert np.abs(scale * read - made).max() < 0.02 * np.abs(made).max()
