"""Contract of every estimator, whatever its method."""

from copy import copy
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import make_estimator
from drivers.skin.layout import LAYOUTS
from tests.pegs import LOAD, NONSENSE, TAXELS, folded, framed, readings

NAMES = ("image", "robust")


@lru_cache
def _estimator(name, layout):
    return make_estimator(load(sets=[f"skin.layout={layout}", f"insert.estimator={name}"]).cell)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", NONSENSE)
def test_nonsense_is_never_a_healthy_pose(name, layout, kind):
    rng = np.random.default_rng(6)
    estimator = _estimator(name, layout)
    poses = [estimator.estimate(framed(NONSENSE[kind](rng))) for _ in range(40)]
    assert not any(pose.healthy for pose in poses)
    assert np.isfinite([(p.theta, p.offset, p.sigma, p.residual) for p in poses]).all()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", NAMES)
def test_pose_of_a_plain_frame_is_whole(name, layout):
    load = replace(LOAD, theta=0.5, offset=0.5e-3)
    pose = _estimator(name, layout).estimate(framed(readings(layout, load, np.random.default_rng(3))))
    assert pose.healthy
    assert abs(folded(pose.theta - 0.5)) < min(0.2, 4.0 * pose.sigma)
    assert pose.offset == pytest.approx(0.5e-3, abs=2e-3)
    assert 0.0 < pose.sigma < 0.2
    assert 0.0 <= pose.residual < 0.5
    assert pose.stamp == 1.5


@pytest.mark.parametrize("trusted", [0, 10, 19])
@pytest.mark.parametrize("name", NAMES)
def test_too_few_trusted_taxels_show_no_pose(name, trusted):
    frame = framed(readings("parallelogram", LOAD), TAXELS + trusted >= 40)
    assert not _estimator(name, "parallelogram").estimate(frame).healthy


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", NAMES)
def test_mirrored_peg_has_the_opposite_pose(name, layout):
    load = replace(LOAD, theta=0.5, offset=1e-3, across=4.0, tilting=0.2)
    mirrored = replace(load, theta=-0.5, offset=-1e-3, across=-4.0, tilting=-0.2)
    one, other = (copy(_estimator(name, layout)).estimate(framed(readings(layout, each))) for each in (load, mirrored))
    # A copy need not have learnt symmetrically so far.
    assert other.theta == pytest.approx(-one.theta, abs=2e-3)
    assert other.offset == pytest.approx(-one.offset, abs=1e-4)
    assert one.offset > 1e-4
