"""Places of plate and rack from what pegs touched: a plane for each peg, and only what is sure is to be written."""

import re
from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from cell.calibrate.places import PegTouches, corners, implausible, mouth, places_of
from cell.config.load import load
from drivers.frames import peg_in_finger
from drivers.quantities import Pose
from tests.fakes import HAND_DOWN

CONFIG = load(sets=["reality.scale=0"]).cell
TODAY = date(2026, 11, 22)


def touches(longer=0.0, height=0.0, slopes=(0.0, 0.0), slot=(0.0, 0.0)):
    """Return the touched heights of a plate that is higher and leans, by a peg that is longer by `longer`, m."""
    middle = np.array(CONFIG.hole.centre)
    points = [
        np.add(place, [0.0, 0.0, height + longer + float(np.dot(slopes, (place - middle)[:2]))])
        for place in corners(CONFIG.hole)
    ]
    return PegTouches(np.array(slot), np.array(points))


def test_height_slopes_and_pegs_are_separated():
    found = places_of(
        [touches(longer, 2e-3, (0.01, -0.02), (1e-3, -2e-3)) for longer in (1e-4, -1e-4, 0.0)], CONFIG, TODAY
    )
    assert found.height == pytest.approx(CONFIG.hole.centre[2] + 2e-3)
    np.testing.assert_allclose(found.lean, [(0.01, -0.02)] * 3, atol=1e-9)
    assert found.pegs == pytest.approx((1e-4, -1e-4, 0.0))
    assert found.first == pytest.approx((0.451, -0.252, 0.1))
    assert (
        found.sections
        == "[hole]\ncentre = [0.50000, 0.00000, 0.10200]\n\n[rack]\nfirst = [0.45100, -0.25200, 0.10000]\n"
    )


def test_places_unknown_from_the_pegs_are_not_written():
    found = places_of([touches(longer, 5e-4) for longer in (1e-3, -1e-3, 0.0)], CONFIG, TODAY)
    assert found.height_interval > 2e-3
    assert found.sections == ""


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"height": 0.112}, r"plate: height off by 0\.0120 m; at most 0\.01 m allowed: see hole\.centre"),
        ({"lean": ((0.0, 0.06),)}, r"plate: tilt 0\.0600 rad; at most 0\.05 rad allowed"),
        ({"uneven": 0.0011}, r"plate: uneven by 0\.0011 m"),
        ({"rack": (0.0, -0.006)}, r"rack: off along y by -0\.0060 m; at most 0\.005 m allowed: see rack\.first"),
        ({"height": float("nan")}, r"plate: height off by nan m"),
    ],
)
def test_implausible_places_are_refused(changed, said):
    found = places_of([touches(), touches()], CONFIG, TODAY)
    assert implausible(found, CONFIG) is None
    assert re.match(said, implausible(replace(found, **changed), CONFIG))


def test_the_mouth_of_a_slot_is_on_the_pegs_axis():
    hand, theta = Pose(np.array([0.45, -0.25, 0.12]), HAND_DOWN), 0.05
    peg = peg_in_finger(theta, CONFIG.peg.length)
    axis = HAND_DOWN @ peg.rotation[:, 2]
    tip = hand.position + HAND_DOWN @ peg.position
    np.testing.assert_allclose(mouth(hand, theta, 0.0, CONFIG), (tip + CONFIG.rack.depth * axis)[:2])
