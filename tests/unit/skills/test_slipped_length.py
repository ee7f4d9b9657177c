"""Slip of a peg along the fingers on the plate, from the apparent sinking of the plate."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP
from skills.catalogue import SEARCH
from skills.held_peg import HeldPeg
from skills.search.course import make_course
from skills.search.feel import EXPLAINED
from skills.search.spray_search import _referenced
from skills.search.surface import Plane

CONFIG = load().cell
PARAMS = CONFIG.params(SEARCH)


def referenced(slip, *, tilt=0.0, is_known=True):
    """Return the excess of length, m, and how far the plane seems to have moved at the touch-down, m, after a slip into the hand by `slip`, m.

    The peg came down 30 mm beside the hole, on a plate that is tilted by `tilt`, rad.
    """
    ctx = SimpleNamespace(job=CONFIG.job(), peg=HeldPeg(measured=0.0 if is_known else None), note_slip=lambda: None)
    course = make_course(PARAMS, ctx.job, np.random.default_rng(1))
    stated = np.array(ctx.job.hole.centre)
    touched = stated + np.array([0.03, 0.0, 0.03 * math.tan(tilt)])
    normal = np.array([-math.sin(tilt), 0.0, math.cos(tilt)])
    sweep = SimpleNamespace(touched=touched, axis=course.axis)
    plane = _referenced(Plane(stated - slip * math.cos(PARAMS.tilt) * UP, normal), PARAMS, ctx, sweep)
    return ctx.peg.excess, plane.point[2] - stated[2]


def test_a_peg_that_slipped_into_the_hand_is_shorter_and_the_plate_where_it_was():
    assert referenced(0.003) == (pytest.approx(-0.003), pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize("tilt", [-0.1, 0.1])
def test_a_tilted_plate_is_no_slip(tilt):
    assert referenced(0.0, tilt=tilt) == (0.0, 0.0)
    assert referenced(0.003, tilt=tilt)[0] == pytest.approx(-0.003)


def test_what_other_errors_explain_is_no_slip():
    excess, height = referenced(0.99 * EXPLAINED)
    assert (excess, height) == (0.0, pytest.approx(-0.99 * EXPLAINED * math.cos(PARAMS.tilt)))


def test_a_peg_that_has_not_touched_the_plate_has_not_slipped_on_it():
    assert referenced(0.003, is_known=False)[0] == 0.0
