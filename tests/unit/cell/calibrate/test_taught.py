"""Places shown with the end of a peg become lines of the cell's file, if they can be those of a cell."""

import numpy as np
import pytest

from cell.calibrate.taught import Shown, implausible, key_taken, lines
from cell.config.load import load
from drivers.frames import UP

CELL = load().cell
HOLE, RACK = CELL.hole, CELL.rack
CORNERS = [("h", (0.47, -0.03, 0.101)), ("h", (0.55, 0.05, 0.099))]
PLATE = [("p", (0.4, -0.1, 0.1)), ("p", (0.6, -0.1, 0.1)), ("p", (0.6, 0.1, 0.1))]


def shown(*places):
    return Shown([(key, np.array(place)) for key, place in places])


def slot(number, x=0.45, y=-0.25, z=0.1):
    return str(number), (x, y + RACK.pitch * (number - 1), z)


def judged(*places):
    return implausible(shown(*places), RACK, CELL.peg.length, CELL.limits)


@pytest.mark.parametrize(
    ("places", "found"),
    [
        (CORNERS, [("hole", "centre", "[0.51000, 0.01000, 0.10000]"), ("hole", "area", "[0.08000, 0.08000]")]),
        (
            [("p", (0.4, 0.1, 0.12))],
            [("hole", "centre", f"[{HOLE.centre[0]:.5f}, {HOLE.centre[1]:.5f}, 0.12000]")],
        ),
        ([slot(1), slot(3, x=0.452)], [("rack", "first", "[0.45100, -0.25000, 0.10000]")]),
        ([("b", (0.3, 0.3, 0.2)), ("b", (0.3, 0.2, 0.2))], [("recover", "bin", "[0.30000, 0.20000, 0.20000]")]),
    ],
)
def test_corners_plate_slots_and_bin_become_their_lines(places, found):
    assert lines(shown(*places), HOLE, RACK) == found


def test_two_opposite_corners_of_plate_and_area_in_one_line_suffice():
    line = [
        ("p", (0.449, -0.048, 0.099)),
        ("h", (0.468, -0.028, 0.1)),
        ("h", (0.529, 0.033, 0.101)),
        ("p", (0.549, 0.052, 0.098)),
    ]
    assert judged(*line) is None


@pytest.mark.parametrize(
    ("places", "why"),
    [
        ([CORNERS[0]], "hole area: 1 corner; 2 or more allowed"),
        ([*PLATE[:2], ("p", (0.6, 0.1, 0.112))], "plate: tilt 0.06"),
        ([*PLATE, ("p", (0.4, 0.1, 0.116))], r"plate: uneven by 0.0040 m; at most 0.003 m allowed|plate: tilt"),
        ([*PLATE, *CORNERS, ("h", (0.62, 0.0, 0.1))], "hole area: a corner lies beside the plate"),
        ([("b", (0.3, 0.3, 0.9))], "b: hand at z = 0.9"),
        ([slot(1), slot(2, y=-0.238)], "rack: the shown slots give places up to 0.0060 m"),
    ],
)
def test_places_of_no_cell_are_refused(places, why):
    assert judged(*PLATE, *CORNERS, slot(1), slot(2)) is None
    found = judged(*places)
    assert found is not None
    assert any(part in found for part in why.split("|"))


@pytest.mark.parametrize(
    ("key", "axis", "speed", "told"),
    [
        ("9", UP, 0.0, f"slot 9: 1 to {RACK.slots} of rack.slots allowed; not taken"),
        ("p", UP, 0.06, "a joint moves at 0.06 rad/s"),
        ("p", np.array([0.6, 0.0, 0.8]), 0.0, "the hand leans by 0.64 rad"),
        ("k", UP, 0.0, "k: no such key; 1-9: mouth of that slot"),
        ("u", UP, 0.0, "nothing to take back"),
    ],
)
def test_a_key_that_takes_no_place_is_answered(key, axis, speed, told):
    said, places = [], Shown()
    key_taken(places, RACK, said.append, key, np.zeros(3), axis, speed)
    assert told in said[0]
    assert places.places == []


def test_the_last_place_can_be_taken_back():
    said, places = [], shown(*PLATE)
    key_taken(places, RACK, said.append, "u", np.zeros(3), UP, 0.0)
    assert (len(places.places), said) == (2, ["taken back: p"])
