"""Permitted push on a peg from the model of the grip, and the play of a leaning peg in its hole."""

import math

import numpy as np
import pytest

from cell.config.load import load
from cell.lab.section import round_depth
from drivers.part.round import Round
from skills.catalogue import ADJUST, GRASP, INSERT, SEARCH
from skills.insert.grip import CONTACT, Grip, grip_of
from skills.insert.play import STEEPEST, allowed_depth, allowed_tilt
from skills.search.feel import SLIP

LENGTH = 0.05


def cell(*sets, preset=None):
    return load(None, preset, sets).cell


def down(search):
    return search.push_stiffness * search.push_offset


@pytest.mark.parametrize("preset", [None, "careful"])
def test_the_shipped_grip_bears_every_push_as_it_is(preset):
    config = cell(preset=preset)
    grip, search, adjust = grip_of(config.params(GRASP)), config.params(SEARCH), config.params(ADJUST)
    assert (down(grip.searching(search)), grip.searching(search).speed) == (down(search), search.speed)
    assert grip.inserting(config.params(INSERT)) is config.params(INSERT)
    assert grip.adjusting(adjust, LENGTH) is adjust
    corner, firm = config.corner, Grip(1e3, 0.3, 1.4)
    assert firm.raising(corner.insert, corner.tilt, config.peg) is corner.insert
    assert firm.entering(corner.adjust, corner.insert.tilt, config.peg) is corner.adjust


def slip_of_turn(share):
    """Return the slip along the fingers, m, per radian of rotation, for an axial load of this share of its friction limit."""
    return CONTACT / 4.0 * share / math.sqrt(1.0 - share * share)


def test_a_slip_by_turning_makes_no_dip():
    """The push along the tilted peg, as a share of what the pads bear, and the turn after which the push is taken back."""
    grip, search = Grip(10.0, 0.3, 1.4), cell().params(SEARCH)
    softened = grip.searching(search)
    share = down(softened) * math.cos(search.tilt) / grip.bears
    assert math.cos(search.tilt) * SLIP * slip_of_turn(share) == pytest.approx(search.dip_threshold)
    assert softened.speed / search.speed == pytest.approx(down(softened) / down(search)) != 1.0


def test_the_slip_of_a_dithered_peg_is_no_progress():
    grip, adjust = Grip(10.0, 0.3, 1.4), cell("adjust.dither_period=0.8").params(ADJUST)
    softened = grip.adjusting(adjust, LENGTH)
    push = softened.push_stiffness * softened.push_offset
    turned = 2 / math.pi * adjust.dither_radius / 2 / LENGTH * adjust.dither_rate * adjust.dither_period
    assert turned * slip_of_turn(push / grip.bears) == pytest.approx(adjust.jammed)


def test_an_insertion_pushes_no_harder_than_the_pads_bear():
    grip, insert = Grip(5.0, 0.3, 1.4), cell().params(INSERT)
    low, high = grip.inserting(insert).push_stiffness
    assert high * insert.push_offset == pytest.approx(grip.bears)
    assert low / high == pytest.approx(insert.push_stiffness[0] / insert.push_stiffness[1])


SQUARE = ("peg.shape=square", "peg.sides=[0.008,0.008]", "hole.sides=[0.0081,0.0081]")


def test_pads_bear_force_and_moment_together():
    grip = Grip(force=15.0, friction=0.3, margin=1.5)
    assert grip.bears == pytest.approx(6.0)
    assert grip.load(6.0, 0.0) == grip.load(0.0, 6.0 * CONTACT / 4) == pytest.approx(1.0)
    assert grip.load(0.6 * 6.0, 0.8 * 6.0 * CONTACT / 4) == pytest.approx(1.0)
    grasp = cell().params(GRASP)
    assert grip_of(grasp, 0.5).bears == pytest.approx(0.5 * grip_of(grasp).bears)  # after a slip


@pytest.mark.parametrize("force", [5.0, 15.0, 30.0])
def test_a_push_over_a_corner_is_within_the_grip(force):
    config = cell(*SQUARE)
    grip, peg, corner = Grip(force, 0.3, 1.4), config.peg, config.corner
    insert = grip.raising(corner.insert, corner.tilt, peg)
    across, push = insert.gains.translation * insert.lead[1], insert.push_stiffness * insert.push_offset
    assert grip.load_over_corner(insert.push_back * push, across, corner.tilt, peg) <= 1.0 + 1e-9
    assert grip.load_over_corner(push, across, insert.tilt, peg) <= 1.0 + 1e-9
    enter = grip.entering(corner.adjust, insert.tilt, peg)
    across, push = enter.gains.translation * enter.lead[1], enter.push_stiffness * enter.push_offset
    assert grip.load_over_corner(push, across, insert.tilt, peg) <= 1.0 + 1e-9
    # It is led over the plate against the friction of its push.
    assert enter.gains.translation * math.hypot(*enter.lead) > config.contact.friction[1] * push


@pytest.mark.parametrize("force", [5.0, 15.0, 30.0, 1e3])
def test_no_push_ahead_lifts_the_corner_over_the_edge(force):
    """The edge bears on the peg's side, which leans by the tilt: without friction it climbs from a ratio of cot(tilt) on."""
    config = cell(*SQUARE)
    corner = config.corner
    insert = Grip(force, 0.3, 1.4).raising(corner.insert, corner.tilt, config.peg)
    ahead = insert.gains.translation * math.hypot(*insert.lead)
    down = insert.push_back * insert.push_stiffness * insert.push_offset
    assert ahead / down < 0.5 / math.tan(corner.tilt)


@pytest.mark.parametrize(("peg", "hole"), [(0.008, 0.00802), (0.008, 0.0081), (0.004, 0.0041), (0.016, 0.0162)])
@pytest.mark.parametrize("degrees", [4.0, 5.7, 7.5])
def test_the_depth_that_a_tilt_allows_is_exact(peg: float, hole: float, degrees: float) -> None:
    phi = math.radians(degrees)
    assert allowed_depth(phi, peg, hole) == pytest.approx(round_depth(Round(peg), Round(hole), phi, 1001), abs=1e-6)


@pytest.mark.parametrize("depth", [2e-3, 5e-3, 0.01, 0.02])
def test_the_most_lean_of_a_peg_makes_it_touch_both_walls(depth):
    lean = allowed_tilt(depth, 8e-3, 8.1e-3)
    turn = np.array([[math.cos(lean), math.sin(lean)], [-math.sin(lean), math.cos(lean)]])
    # The section of the peg in the plane of its lean: the side above the lowest corner touches the mouth, the other corner the other wall.
    lowest, other, along = turn @ [4e-3, 0.0], turn @ [-4e-3, 0.0], turn @ [0.0, 1.0]
    mouth = lowest + along * depth / along[1]
    assert mouth[0] - other[0] == pytest.approx(8.1e-3, rel=1e-6)


def test_the_lean_of_a_shallow_peg_is_at_most_the_steepest():
    assert allowed_tilt(1e-3, 8e-3, 8.1e-3) == pytest.approx(STEEPEST)
