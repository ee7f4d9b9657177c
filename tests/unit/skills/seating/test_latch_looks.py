"""Ways down through a latch: one that shows it is enough, one that shows none is followed by another, and a rest is judged once."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP
from skills.seating.decision import DOUBTED
from skills.seating.latch_likelihood import BEFORE, DOUBT, FORCE_SHARE, SHEAR, Signature, resistance
from skills.seating.latch_looks import LEAST_LOOKS, MOST_LOOKS, TURNING_BACK, Looks, is_enough
from tests.fakes import Rig
from tests.unit.skills.seating.test_signature import LATCH, PERIOD, SPEED, pushing, scan

PUSH = 0.008
REST = 8.0
"""Force at which the bottom bears the push, N."""


@pytest.fixture
def seen(tmp_path):
    return Rig(load(), tmp_path).cell.context(0).observe()


def lowered(looks, seen, stamp, *, wear=0.0, above=0.006, beyond=0.0, rest=50, held_back=0.0, shallow=0.0):
    """Return the looks after a way down at an even speed and a rest, and the time after it, s."""
    for height in np.concatenate([np.arange(above, 0.0, -SPEED * PERIOD), np.zeros(rest)]):
        if looks.is_shown or looks.is_lifting:
            break
        # Walls that a leaning peg rubs at hold it back behind the latch.
        rub = held_back if height < LATCH.height / 2 else 0.0
        force = (1.0 - wear) * float(resistance(np.array(height + shallow), LATCH)) + rub if height > 0.0 else REST
        now = scan(seen, height - SHEAR * force, force, stamp)
        looks = looks.after(now, pushing(now), LATCH, beyond).pulling(PUSH, PERIOD)
        stamp += PERIOD
    return looks, stamp


def lifted(looks, seen, stamp):
    """Return the looks after the hand has been drawn up as they ask for."""
    height = 0.0
    while looks.is_lifting:
        height += SPEED * PERIOD
        now = scan(seen, height, -5.0, stamp)
        looks = looks.after(now, replace(pushing(now), tip=now.tip + PUSH * UP), LATCH, 0.0).pulling(PUSH, PERIOD)
        stamp += PERIOD
    return looks, stamp, height


def test_a_way_down_that_shows_the_latch_is_enough(seen):
    looks, _ = lowered(Looks(), seen, 0.0)
    assert looks.is_shown
    assert looks.missed == 0


def test_a_peg_whose_latch_was_hidden_is_drawn_up_through_it_and_looked_at_again(seen):
    looks, stamp = lowered(Looks(), seen, 0.0, held_back=5.0)
    assert (looks.is_shown, looks.is_lifting, looks.missed, looks.is_over) == (False, True, 1, False)
    looks, stamp, height = lifted(looks, seen, stamp)
    assert height == pytest.approx(LATCH.height + BEFORE, abs=2.0 * SPEED * PERIOD)
    looks, _ = lowered(looks, seen, stamp)
    assert looks.is_shown


def given_up_after(seen, **way):
    """Return the number of equal strokes after which a peg is given up, and whether its latch was detected."""
    looks, stamp = Looks(), 0.0
    for count in range(1, MOST_LOOKS + 1):
        looks, stamp = lowered(looks, seen, stamp, **way)
        if looks.is_over or looks.is_shown:
            return count, looks.is_shown
        looks, stamp, _ = lifted(looks, seen, stamp)
    return MOST_LOOKS + 1, False


@pytest.mark.parametrize(
    ("way", "looks"),
    [({"wear": 1.0}, LEAST_LOOKS), ({"shallow": 0.001}, LEAST_LOOKS), ({"wear": 1.05 - FORCE_SHARE}, MOST_LOOKS)],
    ids=["no latch", "another bottom", "in doubt"],
)
def test_a_peg_is_given_up_after_one_more_look_or_if_in_doubt_after_the_last(seen, way, looks):
    assert given_up_after(seen, **way) == (looks, False)


def test_a_peg_whose_first_way_denies_the_bottom_is_not_told_by_the_next_one(seen):
    looks, stamp = lowered(Looks(), seen, 0.0, shallow=0.001)
    looks, stamp, _ = lifted(looks, seen, stamp)
    looks, _ = lowered(looks, seen, stamp)
    assert not looks.is_shown


def test_how_many_ways_are_enough_depends_on_how_sure_they_are():
    open_, sure = Signature(5.0, 0.0, 0.5), Signature(5.0, 0.0, 1.0 - DOUBT / 2)
    assert [is_enough(LEAST_LOOKS - 1, sure), is_enough(LEAST_LOOKS, sure)] == [False, True]
    assert [is_enough(MOST_LOOKS - 1, open_), is_enough(MOST_LOOKS, open_)] == [False, True]


def test_a_rest_away_from_the_bottom_is_no_look(seen):
    looks, _ = lowered(Looks(), seen, 0.0, wear=1.0, beyond=-1.01 * DOUBTED)
    assert (looks.missed, looks.is_lifting) == (0, False)


def test_fingers_that_slide_down_a_resting_peg_change_nothing_of_what_was_felt(seen):
    looks, stamp = lowered(Looks(), seen, 0.0, rest=25)
    before = looks.curve.signature(LATCH, stamp)
    for n in range(20):
        now = scan(seen, -SHEAR * REST - n * 1e-5, REST, stamp + n * PERIOD)
        looks = looks.after(now, pushing(now), LATCH, 0.0)
    assert before is not None
    assert looks.curve.signature(LATCH, stamp + 1.0) == before


def test_push_becomes_pull_no_faster_than_the_gate_bears(seen):
    looks = Looks().pulling(PUSH, PERIOD)
    assert looks.pull == -PUSH
    looks, pulls = replace(looks, missed=1, top=1.0), []
    for _ in range(100):
        looks = looks.pulling(PUSH, PERIOD)
        pulls.append(looks.pull)
    assert np.diff([-PUSH, *pulls]).max() <= TURNING_BACK * PERIOD + 1e-12
    assert pulls[-1] == PUSH
    looks = replace(looks, top=-math.inf).pulling(PUSH, PERIOD)
    assert looks.pull < PUSH
