"""Gains of taxels are found from a sweep with a rod."""

import math
from functools import lru_cache

import numpy as np
import pytest

from drivers.parts import Peg
from drivers.skin.layout import LAYOUTS
from sim.config import PadConfig
from sim.hand.pads import PadLoad, Pads
from skills.tactile.skin_gains import fit_gains, rod_angles

ROD = Peg(diameter=0.008, length=0.05, overhang=0.05, mass=0.02)
ANGLES = rod_angles(math.radians(10.0))
ALL = np.ones((2, 20), dtype=bool)
FEW = np.array([0.9e-3, 1.2e-3, 1.5e-3])


@lru_cache
def swept(layout, blur=1.2e-3):
    """Return the readings of perfect taxels in a sweep, counts, from the simulated pads instead of the templates."""
    pads = Pads(PadConfig(blur=blur), layout)
    return np.array([0.05 * pads.pressure(PadLoad(theta, 0.0, 30.0, 0.0, 0.0, 0.05, 0.05, 0.008)) for theta in ANGLES])


def fitted(readings, layout="parallelogram", trusted=ALL):
    return fit_gains(ANGLES.tolist(), readings, trusted, ROD, layout, FEW)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_gains_are_found_to_a_part_of_their_spread(layout):
    rng = np.random.default_rng(1)
    gains = rng.normal(1.0, 0.05, (2, 20))
    found = fitted(gains * swept(layout) + rng.normal(0.0, 67.0, swept(layout).shape), layout).gains
    assert (found / (gains / gains.mean(axis=1, keepdims=True))).std() < 0.03


@pytest.mark.parametrize("blur", [1.0e-3, 1.4e-3])
def test_point_spread_is_found(blur):
    assert fitted(swept("parallelogram", blur)).point_spread == pytest.approx(blur, abs=0.12e-3)


def test_gains_do_not_depend_on_how_hard_the_rod_was_held():
    force = np.linspace(0.5, 1.5, len(ANGLES))[:, None, None]
    assert np.allclose(fitted(force * swept("parallelogram")).gains, fitted(swept("parallelogram")).gains, atol=0.02)


def test_an_untrusted_taxel_spoils_no_other():
    trusted, readings = ALL.copy(), swept("parallelogram").copy()
    trusted[1, 7] = False
    readings[:, 1, 7] = 0.0
    found = fitted(readings, trusted=trusted)
    assert (found.gains[1, 7], found.measured[1, 7]) == (1.0, False)
    assert np.abs(found.gains - fitted(swept("parallelogram")).gains)[trusted].max() < 0.02


def test_angles_cover_half_a_turn_evenly():
    angles = rod_angles(math.radians(5.0))
    assert len(angles) == 36
    assert np.diff(angles) == pytest.approx(np.full(35, math.radians(5.0)))


@pytest.mark.parametrize("count", [0, 3])
def test_sweep_of_too_few_angles_is_refused(count):
    with pytest.raises(ValueError, match="no sweep"):
        fit_gains(ANGLES[:count].tolist(), np.ones((count, 2, 20)), ALL, ROD, "parallelogram")


def test_sweep_without_a_touch_is_refused():
    with pytest.raises(ValueError, match="no sweep"):
        fitted(np.zeros((len(ANGLES), 2, 20)))
