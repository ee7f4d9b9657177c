"""The stand-in's pads against an elastic layer that shares nothing with them, and against real recordings."""

import math

import numpy as np
import pytest

from cell.lab.elastic_layer import POISSON, LayerPads, layer, layer_pads
from drivers.part.round import Round
from drivers.skin.layout import LAYOUTS
from sim.config import PadConfig
from sim.hand.pads import PadLoad, Pads

DEPTH, REACH, DIAMETER = 0.5e-3, (0.05, 0.015), 0.008


def test_layer_answers_as_the_textbook_says():
    """Bonded below, frictionless above: (1-nu)/k·(κ sinh 2k - 2k)/(κ cosh 2k + 2k² + (κ²+1)/2), κ = 3 - 4 nu (Hannah, 1951)."""
    k, kappa = np.array([0.05, 0.3, 1.0, 3.0, 8.0]), 3.0 - 4.0 * POISSON
    expected = (1.0 - POISSON) / k * (kappa * np.sinh(2 * k) - 2 * k)
    expected /= kappa * np.cosh(2 * k) + 2 * k**2 + (kappa**2 + 1) / 2
    assert layer(k)[0] == pytest.approx(expected, rel=1e-9)


def test_wide_pressure_reaches_the_backing_undiminished_and_ripples_do_not():
    reaching = layer(np.array([0.02, 8.0]))[1]
    assert reaching[0] == pytest.approx(1.0, abs=1e-3)
    assert abs(reaching[1]) < 0.01


def test_half_the_cells_change_little():
    coarse, fine = (
        LayerPads("parallelogram", cell=cell).readings(
            0.4, 1e-3, ((DEPTH, 0.0), (DEPTH, 0.0)), REACH, Round(DIAMETER).face
        )[0]
        for cell in (0.5e-3, 0.25e-3)
    )
    assert np.abs(coarse - fine).max() < 0.06 * fine.max()


def _misses(layout, pad):
    """Return by how much the springs miss the layer, over the layer's largest reading: RMS and largest."""
    rms, worst = [], []
    for theta in np.radians(np.arange(-85.0, 90.0, 10.0)):
        felt, loads = layer_pads(layout).readings(theta, 0.0, ((DEPTH, 0.0), (DEPTH, 0.0)), REACH, Round(DIAMETER).face)
        load = PadLoad(theta, 0.0, float(loads[0]), 0.0, 0.0, *REACH, DIAMETER)
        springs = Pads(pad, layout).pressure(load)
        # Counts a pascal are calibrated, so that only the shape counts.
        away = (felt - springs * np.vdot(felt, springs) / np.vdot(springs, springs)) / felt.max()
        rms.append(math.sqrt(np.mean(away**2)))
        worst.append(np.abs(away).max())
    return float(np.mean(rms)), float(np.max(worst))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_springs_have_the_layer_s_shape_within_seven_percent(layout):
    rms, worst = _misses(layout, PadConfig())
    assert rms < 0.07
    assert worst < 0.25


def test_springs_of_twice_the_blur_do_not():
    assert _misses("parallelogram", PadConfig(blur=2.4e-3))[0] > 1.5 * 0.07
