"""Transitions between the phases of a search."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.quantities import Pose
from skills.catalogue import SEARCH
from skills.search.course import make_course
from skills.search.feel import Push
from skills.search.phases import ComingDown, Detour, Felt, Probing, Resting, Sliding, after_rest, next_phase
from skills.search.size import shallow

CONFIG = load().cell
PARAMS = CONFIG.params(SEARCH)
COURSE = make_course(PARAMS, CONFIG.job(), np.random.default_rng(1))
HAND, HERE = Pose(np.zeros(3), np.eye(3)), np.array([0.5, 0.01, 0.1])
ASLANT = np.array([0.6, 0.0, 0.8])


def felt(elapsed=3.0, frame_stamp=12.95, **changes):
    """Return the quantities of a peg that slides along y, 3 s after the search began, with these differences."""
    arm, peg = SimpleNamespace(tcp=HAND), SimpleNamespace(stamp=frame_stamp)
    seen = SimpleNamespace(elapsed=elapsed, stamp=13.0, arm=arm, peg=peg, tip=HERE, axis=ASLANT)
    usual = {"turned": 0.0, "below": 0.0, "is_pressed": True, "is_edge": False, "velocity": np.array([0.0, -0.1])}
    return Felt(seen, **{**usual, **changes})


BACK = Detour(3.0, np.zeros(2), COURSE.axis, COURSE.closing)


def after(phase, **changes):
    return next_phase(phase, felt(**changes), PARAMS, COURSE, np.zeros(2))


DOWN = (PARAMS.height + PARAMS.push_offset) / PARAMS.descent
"""Time in which the setpoint comes down, s."""


@pytest.mark.parametrize(
    ("elapsed", "is_pressed", "phase"),
    [
        (DOWN + 1e-6, True, Sliding),
        (DOWN - 1e-6, True, ComingDown),
        (DOWN + 1e-6, False, ComingDown),
        (PARAMS.touch_down - 1e-6, False, ComingDown),
        (PARAMS.touch_down, False, Sliding),
    ],
)
def test_the_search_slides_once_the_plate_bears_or_time_is_over(elapsed, is_pressed, phase):
    assert isinstance(after(ComingDown(BACK), elapsed=elapsed, is_pressed=is_pressed), phase)


def test_a_hand_that_stood_still_is_held_where_it_is():
    rest = after(Sliding(BACK), is_edge=True, velocity=np.zeros(2))
    assert (rest.tcp.position == HAND.position).all()
    assert rest.place == pytest.approx(HERE[:2])


def test_a_rest_is_judged_by_a_frame_of_its_end():
    rest = Resting(HERE[:2], HAND, stopped=10.0)
    assert not rest.is_over(felt(frame_stamp=10.0 + PARAMS.rest - 1e-6), PARAMS)
    assert rest.is_over(felt(frame_stamp=10.0 + PARAMS.rest), PARAMS)


def test_a_place_is_looked_round_once_and_then_left():
    rest = Resting(HERE[:2] - 1e-3, HAND, stopped=10.0)
    probe = after_rest(rest, felt(below=PARAMS.dip_threshold), PARAMS, COURSE, np.zeros(2))
    assert isinstance(probe, Probing)
    assert probe.detour.offset == pytest.approx([1e-3, 1e-3])
    again = after(probe, elapsed=3.1, below=PARAMS.fall + PARAMS.dip_threshold)
    assert isinstance(again, Resting)
    assert isinstance(after_rest(again, felt(), PARAMS, COURSE, np.zeros(2)), Sliding)


def test_a_probe_goes_on_to_a_deeper_place():
    """The peg leans on the rim there; it would be judged too high again, and its hole passed over as a dent."""
    probe = Probing(BACK, HERE[:2], PARAMS.fall - 1e-5)
    assert after(probe, below=PARAMS.fall + 1e-6) is probe
    assert isinstance(after(probe, below=PARAMS.fall + PARAMS.dip_threshold), Resting)


@pytest.mark.parametrize("doubtful", [CONFIG.corner.searching(PARAMS), shallow(PARAMS, 0.004)], ids=["corner", "4 mm"])
def test_a_doubtful_dip_that_has_gone_is_not_probed(doubtful):
    """An error of theta, or a peg that sticks and slips, resembles a dip until the peg rests."""
    rest = Resting(HERE[:2], HAND, stopped=10.0)
    gone, left = (felt(below=share * doubtful.gone * doubtful.dip_threshold) for share in (0.99, 1.01))
    for params, each, phase in ((doubtful, gone, Sliding), (doubtful, left, Probing), (PARAMS, gone, Probing)):
        assert isinstance(after_rest(rest, each, params, COURSE, np.zeros(2)), phase)


def test_a_probe_that_ends_while_the_peg_falls_rests():
    """A peg that leans on the far side of the rim has just begun to fall when the spiral is over."""
    probe, elapsed = Probing(BACK, HERE[:2], 1e-4), 60.0
    assert isinstance(after(probe, elapsed=elapsed, below=1.2 * PARAMS.dip_threshold), Sliding)
    resting = after(probe, elapsed=elapsed, below=1.5 * PARAMS.dip_threshold)
    assert isinstance(resting, Resting)
    assert resting.was_probed
    assert after(probe, elapsed=3.01, below=1.5 * PARAMS.dip_threshold) is probe


def test_every_slip_takes_back_the_push_down_to_its_least():
    push, theta = Push(PARAMS.push_stiffness, 0.0), 0.0
    assert push.after(0.09, PARAMS) is push
    found = []
    for _ in range(5):
        theta += 0.11
        push = push.after(theta, PARAMS)
        found.append(push.stiffness / PARAMS.push_stiffness)
    assert found == pytest.approx([max(PARAMS.push_back**n, PARAMS.least_push) for n in range(1, 6)])
