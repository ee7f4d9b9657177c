"""The study of estimators with a peg whose flat faces lie in the pads."""

import math

import numpy as np
import pytest

from cell.config.load import load
from cell.lab.elastic_layer import layer_pads
from cell.lab.tactile import CONDITIONS, DEPTHS, GRIP, depths_of, made
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round

LAYOUT = "parallelogram"
OBLONG = ("peg.shape=rectangular", "peg.sides=[0.008, 0.004]", "hole.sides=[0.0081, 0.0041]")


def _loads(peg, depth):
    reach = (peg.length, peg.overhang)
    return layer_pads(LAYOUT).readings(0.0, 0.0, ((depth, 0.0), (depth, 0.0)), reach, peg.part.face)[1]


def test_the_depth_of_a_flat_face_balances_the_grip():
    peg = load(sets=OBLONG).cell.peg
    low, high = depths_of(peg, LAYOUT)
    np.testing.assert_allclose(_loads(peg, (low + high) / 2), GRIP, rtol=0.01)
    assert high / low == pytest.approx(DEPTHS[1] / DEPTHS[0])


def test_a_round_peg_is_pressed_in_as_ever():
    assert depths_of(load().cell.peg, LAYOUT) == DEPTHS


@pytest.mark.parametrize("model", ["springs", "layer"])
def test_the_print_is_as_broad_as_the_face(model):
    breadths = []
    for sides in (0.004, 0.012):
        cell = load(
            sets=("peg.shape=rectangular", f"peg.sides=[0.008, {sides}]", f"hole.sides=[0.0081, {sides + 1e-4}]")
        ).cell
        frames = list(made(cell, model, CONDITIONS[0], 12))
        breadths.append(
            np.mean([(np.maximum(frame.values, 0.0) > 0.3 * frame.values.max()).sum() for _, frame in frames])
        )
    assert breadths[1] > 1.3 * breadths[0]


def test_a_profile_is_the_flat_face_or_the_circle():
    beside = np.array([0.0, 0.0019, -0.002, 0.0021])
    np.testing.assert_array_equal(Rectangular(0.008, 0.004).face.profile(beside), [0.0, 0.0, 0.0, math.inf])
    profile = Round(0.008).face.profile(np.array([0.0, 0.002, 0.0037, 0.004]))
    np.testing.assert_allclose(profile, [0.0, 0.004 - math.sqrt(1.2e-5), math.inf, math.inf], atol=1e-15)
