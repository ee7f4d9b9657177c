"""Transitions between the phases of a search."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.quantities import Pose
from skills.catalogue import SEARCH
from skills.search.course import make_course
from skills.search.feel import Push
from skills.search.phases import (
    ComingDown,
    Detour,
    Felt,
    Probing,
    Resting,
    Sliding,
    after_rest,
    first_phase,
    next_phase,
)

CONFIG = load().cell
PARAMS = CONFIG.params(SEARCH)
COURSE = make_course(PARAMS, CONFIG.job(), np.random.default_rng(1))
PERIOD = 0.01
HAND, HERE = Pose(np.zeros(3), np.eye(3)), np.array([0.5, 0.01, 0.1])
ASLANT = np.array([0.6, 0.0, 0.8])
FELT = Felt(
    elapsed=3.0,
    stamp=13.0,
    frame_stamp=12.95,
    tcp=HAND,
    tip=HERE,
    axis=ASLANT,
    turned=0.0,
    below=0.0,
    is_pressed=True,
    is_edge=False,
)
BACK = Detour(3.0, np.zeros(2), COURSE.axis, COURSE.closing)


def after(phase, **felt):
    return next_phase(phase, replace(FELT, **felt), PARAMS, COURSE, np.zeros(2))


def test_the_search_slides_once_the_plate_has_borne_the_push():
    down = (PARAMS.height + PARAMS.push_offset) / PARAMS.descent
    assert isinstance(after(first_phase(COURSE), elapsed=down + 1e-6), Sliding)
    assert isinstance(after(first_phase(COURSE), elapsed=down - 1e-6), ComingDown)
    assert isinstance(after(first_phase(COURSE), elapsed=down + 1e-6, is_pressed=False), ComingDown)


def test_a_plate_that_is_never_felt_is_taken_to_be_there():
    phase = first_phase(COURSE)
    assert isinstance(after(phase, elapsed=PARAMS.touch_down - 1e-6, is_pressed=False), ComingDown)
    assert isinstance(after(phase, elapsed=PARAMS.touch_down, is_pressed=False), Sliding)


def test_evidence_stops_the_hand_where_it_is():
    rest = after(Sliding(BACK), is_edge=True)
    assert isinstance(rest, Resting)
    assert (rest.stopped, rest.tcp, rest.was_probed) == (FELT.stamp, HAND, False)
    assert rest.place == pytest.approx(HERE[:2])


def test_without_evidence_the_search_slides_on():
    phase = Sliding(BACK)
    assert after(phase) is phase


def test_a_rest_is_judged_by_a_frame_of_its_end():
    rest = Resting(HERE[:2], HAND, stopped=10.0)
    assert not rest.is_over(replace(FELT, frame_stamp=10.0 + PARAMS.rest - 1e-6), PARAMS)
    assert rest.is_over(replace(FELT, frame_stamp=10.0 + PARAMS.rest), PARAMS)


def test_a_place_is_looked_round_once_and_then_left():
    rest = Resting(HERE[:2] - 1e-3, HAND, stopped=10.0)
    probe = after_rest(rest, FELT, PARAMS, COURSE, np.zeros(2))
    assert isinstance(probe, Probing)
    assert probe.detour.offset == pytest.approx([1e-3, 1e-3])
    again = after(probe, elapsed=3.1, below=PARAMS.fall + 1e-6)
    assert isinstance(again, Resting)
    assert isinstance(after_rest(again, FELT, PARAMS, COURSE, np.zeros(2)), Sliding)


def test_a_corner_whose_dip_has_gone_at_rest_is_not_led_round_the_place():
    """If the peg turns in the hand, the tip seems to dip until the skin measures the turn; a probe would turn it further."""
    corner = CONFIG.corner.searching(PARAMS)
    gone = replace(FELT, below=0.1 * corner.dip_threshold)
    dip = next_phase(Sliding(BACK), replace(FELT, is_edge=True), corner, COURSE, np.zeros(2))
    lag = next_phase(Sliding(BACK), replace(FELT, is_edge=True, is_held=True), corner, COURSE, np.zeros(2))
    assert isinstance(after_rest(dip, gone, corner, COURSE, np.zeros(2)), Sliding)
    assert isinstance(after_rest(dip, replace(FELT, below=corner.dip_threshold), corner, COURSE, np.zeros(2)), Probing)
    assert isinstance(after_rest(lag, gone, corner, COURSE, np.zeros(2)), Probing)
    assert isinstance(after_rest(dip, gone, PARAMS, COURSE, np.zeros(2)), Probing)


def test_a_place_that_was_probed_is_left_at_once():
    rest = Resting(HERE[:2], HAND, stopped=10.0, was_probed=True)
    phase = after_rest(rest, FELT, PARAMS, COURSE, np.array([0.01, 0.02]))
    assert isinstance(phase, Sliding)
    assert phase.detour.offset == pytest.approx(HERE[:2] - COURSE.middle - [0.01, 0.02])
    np.testing.assert_array_equal(phase.detour.axis, ASLANT)


def test_a_probe_that_finds_nothing_ends_at_its_radius_without_a_jump():
    probe, elapsed = Probing(replace(BACK, offset=np.array([2e-3, 0.0])), HERE[:2], FELT.below), 3.0
    while (phase := after(probe, elapsed=elapsed)) is probe:
        elapsed += PERIOD
    looked = probe.looked(elapsed, PARAMS)
    assert PARAMS.probe_radius < np.hypot(*looked) < PARAMS.probe_radius + PARAMS.probe_speed * PERIOD
    assert isinstance(phase, Sliding)
    assert COURSE.middle + phase.detour.offset == pytest.approx(
        HERE[:2] + looked + probe.detour.left(elapsed, PARAMS) * np.array([2e-3, 0.0])
    )


def test_a_probe_that_ends_while_the_peg_falls_rests():
    """A peg that leans on the far side of the rim has just begun to fall when the spiral is over."""
    probe, elapsed = Probing(BACK, HERE[:2], 1e-4), 60.0
    assert isinstance(after(probe, elapsed=elapsed, below=1.2 * PARAMS.dip_threshold), Sliding)
    resting = after(probe, elapsed=elapsed, below=1.5 * PARAMS.dip_threshold)
    assert isinstance(resting, Resting)
    assert resting.was_probed
    assert after(probe, elapsed=3.01, below=1.5 * PARAMS.dip_threshold) is probe


def test_a_detour_is_over_after_its_time():
    assert [BACK.left(3.0 + share * PARAMS.return_time, PARAMS) for share in (0.0, 0.5, 1.0, 2.0)] == pytest.approx(
        [1.0, 0.5, 0.0, 0.0]
    )


def test_every_slip_takes_back_the_push_down_to_its_least():
    push, theta = Push(PARAMS.push_stiffness, 0.0), 0.0
    assert push.after(0.09, PARAMS) is push
    found = []
    for _ in range(5):
        theta += 0.11
        push = push.after(theta, PARAMS)
        found.append(push.stiffness / PARAMS.push_stiffness)
    assert found == pytest.approx([max(PARAMS.push_back**n, PARAMS.least_push) for n in range(1, 6)])
