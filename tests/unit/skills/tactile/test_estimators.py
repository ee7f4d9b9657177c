"""Contract of every estimator, whatever its method."""

from copy import copy
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from cell.devices.assembly import make_estimator
from drivers.skin.layout import LAYOUTS
from tests.pegs import LOAD, NONSENSE, folded, framed, nonsense, readings, shipped

NAMES = ("image", "robust")


@lru_cache
def _estimator(name, layout):
    config = shipped()
    skin, insert = (
        part.model_copy(update=change)
        for part, change in ((config.skin, {"layout": layout}), (config.insert, {"estimator": name}))
    )
    return make_estimator(config.model_copy(update={"skin": skin, "insert": insert}))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", NONSENSE)
def test_nonsense_is_never_a_healthy_pose(name, layout, kind):
    rng = np.random.default_rng(6)
    poses = [_estimator(name, layout).estimate(framed(nonsense(kind, rng))) for _ in range(40)]
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
    frame = framed(readings("parallelogram", LOAD), np.arange(40).reshape(2, 20) >= 40 - trusted)
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
