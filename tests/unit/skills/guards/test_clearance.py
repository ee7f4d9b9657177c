"""A way through free space is refused before it begins where hand or peg would come too near to plate or rack."""

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import SetpointError
from drivers.quantities import InHandTip
from skills.guards.clearance import Attitude, Box, boxes_of, nearest, require_clear
from skills.motion import Goal, TransferPath

JOB = load().cell.job()
UP, ALONG, SIDE = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
HELD = InHandTip(0.0, JOB.peg.length)
PLATE, RACK = np.array(JOB.hole.centre), np.array(JOB.rack.first)
CLEARANCE = 0.002


def between(start, goal):
    """Return places on the way between two goals."""
    laid = TransferPath(start, goal)
    return [Attitude(at.tip, at.axis, at.roll) for at in (laid.at(share)[0] for share in np.linspace(0.0, 1.0, 25))]


def way(start, goal, axes=(UP, UP)):
    """Return places on the straight way between two tips, m."""
    return between(Goal(np.array(start), axes[0], ALONG), Goal(np.array(goal), axes[1], ALONG))


def test_distances_from_a_box_are_exact():
    box = Box("plate", np.zeros(3), np.ones(3))
    points = np.array([[0.5, 0.5, 1.2], [1.3, 1.4, 0.5], [0.5, 0.9, 0.5]])
    np.testing.assert_allclose(box.gaps(points), [0.2, 0.5, -0.1])


@pytest.mark.parametrize("azimuth", [0.0, 0.5 * np.pi, np.pi])
@pytest.mark.parametrize("x", np.linspace(-0.035, 0.035, 8))
def test_closed_fingers_are_farther_from_the_plate_than_the_peg(x, azimuth):
    """The closing axis leans with the peg, as in a search; the fingers of a hand that is wide open would reach the plate."""
    side = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    axis, closing = (UP + side) / np.sqrt(2.0), (side - UP) / np.sqrt(2.0)
    gap, what, _ = nearest(Attitude(PLATE + np.array([x, 0.0, 0.005]), axis, closing), JOB, HELD, boxes_of(JOB))
    assert what == "peg"
    assert gap == pytest.approx(0.005 - JOB.peg.part.reach * np.sin(0.7854), abs=2e-4)


@pytest.mark.parametrize("x", np.linspace(-0.02, 0.02, 9))
def test_the_way_from_the_rack_to_any_likely_place_is_clear(x):
    axis, closing = (UP + SIDE) / np.sqrt(2.0), (SIDE - UP) / np.sqrt(2.0)
    goal = Goal(PLATE + np.array([x, -0.01, 0.005]), axis, closing)
    require_clear(between(Goal(RACK + 0.05 * UP, UP, SIDE), goal), JOB, HELD, CLEARANCE)


def test_no_way_leads_through_the_edge_of_the_plate():
    low = JOB.model_copy(update={"rack": JOB.rack.model_copy(update={"first": (0.5, -0.12, 0.0)})})
    with pytest.raises(SetpointError, match=r"(hand|peg) would come to -\d+\.\d mm from the plate with the tip at"):
        require_clear(way((0.5, -0.12, 0.02), PLATE + 0.01 * UP), low, HELD, CLEARANCE)


def test_a_peg_that_swings_down_on_its_way_is_refused():
    """Both ends are clear; between them the peg's back end, which turns past the horizontal, would strike the plate."""
    down = np.array([0.95, 0.0, -np.sqrt(1 - 0.95**2)])
    places = way(PLATE + 0.03 * UP, PLATE + 0.03 * UP + 0.007 * (UP + SIDE), (UP, down))
    with pytest.raises(SetpointError, match=r"transfer: (peg|hand) would come to"):
        require_clear([*places, *way(PLATE + 0.2 * UP, PLATE + 0.2 * UP)], JOB, HELD, CLEARANCE)


def test_a_way_between_clear_ends_keeps_the_clearance_and_no_more():
    ends = PLATE + 0.02 * UP
    at, beyond = (way(ends, lowest) + way(lowest, ends) for lowest in (PLATE + 2.5e-3 * UP, PLATE + 1.5e-3 * UP))
    require_clear(at, JOB, HELD, CLEARANCE)
    with pytest.raises(SetpointError, match=r"2\.\d mm needed|1\.9 mm needed"):
        require_clear(beyond, JOB, HELD, CLEARANCE)


def test_a_way_that_begins_near_may_leave_but_come_no_nearer():
    near = PLATE + 0.001 * UP
    require_clear(way(near, PLATE + 0.05 * UP), JOB, HELD, CLEARANCE)
    with pytest.raises(SetpointError):
        require_clear([*way(near, PLATE - 0.002 * UP), *way(PLATE, near)], JOB, HELD, CLEARANCE)


def test_the_empty_hand_has_no_peg():
    require_clear(way(PLATE + 0.03 * UP, PLATE + 0.08 * UP), JOB, None, CLEARANCE)
    gap, what, _ = nearest(Attitude(PLATE + 0.03 * UP, UP, ALONG), JOB, None, boxes_of(JOB))
    assert what == "hand"
    assert gap == pytest.approx(0.03 - 0.0034 - 0.02 + 2 * 0.0034, abs=0.004)


def test_own_fingers_have_their_own_room():
    at = Attitude(PLATE + 0.03 * UP, UP, ALONG)
    thicker = JOB.hand.model_copy(update={"finger_radius": JOB.hand.finger_radius + 0.004})
    gaps = [nearest(at, job, None, boxes_of(job))[0] for job in (JOB, JOB.model_copy(update={"hand": thicker}))]
    assert gaps[0] - gaps[1] == pytest.approx(0.004)
