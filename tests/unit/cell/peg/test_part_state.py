"""The place of the peg follows from the evidence, in and out of the hand, in runs and between programs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.peg.part_state import (
    BIN_REACH,
    HOLE_MARGIN,
    IN_HOLE_DEPTH,
    REMEDIES,
    SLOT_REACH,
    UNRESOLVED,
    PartState,
    PegEvidence,
    after,
    after_run,
    at_start,
    by_hand_alone,
    evidence_of,
    in_words,
    places_of,
    proven,
    refusal_of,
    told,
)
from drivers.parts import Latch
from drivers.quantities import WIDTH_TOLERANCE, GripperState, SwitchState, Wrench
from plc_bridge.protocol.messages import PartEvidence as Bit
from plc_bridge.protocol.messages import PartPlace, Refusal
from skills.seating.decision import CLOSED_TOLERANCE

OPEN, CLOSED, UNKNOWN = SwitchState.OPEN, SwitchState.CLOSED, SwitchState.UNKNOWN
IN_HAND, IN_HOLE, SEATED, ON_PLATE = PartPlace.IN_HAND, PartPlace.IN_HOLE, PartPlace.SEATED, PartPlace.ON_PLATE
RACK, BIN, NOWHERE = PartPlace.RACK, PartPlace.BIN, PartPlace.UNKNOWN
EMPTY = PartState(RACK, "in the rack")
AWAY = (0.0, 0.0, 0.5)
"""A hand far from the hole, m."""
EPSILON = 1e-5
"""Beyond a limit, m."""
BEARS = 12.5
"""Force that the pads bear in tests of a peg that slides, N."""


class Peg:
    """The last peg by the evidence, look after look."""

    def __init__(self, places):
        self.places, self.state = places, EMPTY

    def evidence(self, tip=None, *, gripping=True, width=None, moving=False, switch=OPEN, felt=None, inserts=False):
        """Return what a look finds, with the end of the peg where it was unless given."""
        if width is None:
            width = self.places.thickness if gripping else 0.04
        return PegEvidence(GripperState(width, gripping, moving), tip or self.state.tip, switch, felt, inserts)

    def look(self, tip=None, *, is_running=True, push=0.0, **how):
        """Take a look, and return what is known then."""
        look = replace(self.evidence(tip, **how), push=push)
        self.state = after(self.state, look, self.places, is_running)
        return self.state

    def at(self, depth, aside=0.0):
        """Return the point so deep in the hole, and so far from its axis, m."""
        x, y, z = self.places.hole.centre
        return (x + aside, y, z - depth)

    def held(self, depth, aside=0.0, **how):
        """Look at the peg in the hand, its end so deep in the hole, m."""
        return self.look(self.at(depth, aside), **how)

    def gone(self, **how):
        """Look at the open hand where the peg was held."""
        return self.look(gripping=False, **how)

    def by_hand(self, gripping, *, width=None, moving=False, switch=OPEN, is_running=True):
        """Look at the hand alone, because the arm reports nothing."""
        if width is None:
            width = self.places.thickness if gripping else 0.04
        self.state = by_hand_alone(self.state, GripperState(width, gripping, moving), switch, self.places, is_running)
        return self.state


@pytest.fixture
def peg(loaded):
    return Peg(replace(places_of(loaded.cell), bears=math.inf))


@pytest.fixture
def sliding(peg):
    """Return a peg in a hand whose pads bear little."""
    peg.places = replace(peg.places, bears=BEARS)
    return peg


@pytest.fixture
def at_origin(peg):
    """Return a peg in a cell at the base's origin, where no length is rounded."""
    hole = peg.places.hole.model_copy(update={"centre": (0.0, 0.0, 0.0), "depth": 0.0})
    peg.places = replace(peg.places, hole=hole, thickness=0.0, slots=((0.0, 2.0, 0.0),), bin=(0.0, 4.0, 0.0))
    return peg


# In the hand.


@pytest.mark.parametrize(
    ("depth", "switch", "place"),
    [
        (-0.1, OPEN, IN_HAND),
        (IN_HOLE_DEPTH - EPSILON, OPEN, IN_HAND),
        (0.02, OPEN, IN_HOLE),
        (0.02, CLOSED, SEATED),
        (0.0159, CLOSED, IN_HOLE),
        (0.02, UNKNOWN, IN_HOLE),
    ],
)
def test_depth_and_switch_place_a_held_peg(peg, depth, switch, place):
    state = peg.held(depth, switch=switch)
    assert (state.place, state.is_held) == (place, True)
    assert state.depth == pytest.approx(depth if place is not IN_HAND else 0.0)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(
    ("beyond", "place"), [(HOLE_MARGIN - EPSILON, IN_HOLE), (HOLE_MARGIN + EPSILON, IN_HAND), (0.006, IN_HAND)]
)
def test_a_peg_is_in_the_hole_within_a_margin_of_the_area(peg, axis, beyond, place):
    tip = list(peg.at(0.02))
    tip[axis] -= peg.places.hole.area[axis] / 2 + beyond
    assert peg.look(tuple(tip)).place is place


@pytest.mark.parametrize(("off", "is_held"), [(WIDTH_TOLERANCE - EPSILON, True), (WIDTH_TOLERANCE + EPSILON, False)])
def test_the_hand_holds_what_is_as_wide_as_the_peg(peg, off, is_held):
    assert peg.held(-0.1, width=peg.places.thickness + off).is_held == is_held


@pytest.mark.parametrize(
    ("aside", "depth", "switch", "place"),
    [
        (0.0, IN_HOLE_DEPTH, OPEN, IN_HOLE),
        (1.0, IN_HOLE_DEPTH, OPEN, IN_HOLE),
        (0.0, CLOSED_TOLERANCE, CLOSED, SEATED),
    ],
)
def test_hole_and_seat_begin_exactly_at_their_limits(at_origin, aside, depth, switch, place):
    x = aside * (at_origin.places.hole.area[0] / 2 + HOLE_MARGIN)
    assert at_origin.look((x, 0.0, -depth), switch=switch).place is place


# Out of the hand.


@pytest.mark.parametrize(
    ("depth", "before", "switch", "place", "bits"),
    [
        (-0.1, OPEN, OPEN, ON_PLATE, Bit.SWITCH_OPEN),
        (0.001, OPEN, OPEN, ON_PLATE, Bit.SWITCH_OPEN),
        (0.012, OPEN, OPEN, IN_HOLE, Bit.SWITCH_OPEN | Bit.TIP_IN_HOLE),
        (0.02, CLOSED, CLOSED, SEATED, Bit.SWITCH_CLOSED | Bit.TIP_IN_HOLE),
        (0.02, OPEN, CLOSED, SEATED, Bit.SWITCH_CLOSED | Bit.TIP_IN_HOLE),
        (0.02, CLOSED, OPEN, IN_HOLE, Bit.SWITCH_OPEN | Bit.TIP_IN_HOLE),
        (0.012, OPEN, CLOSED, SEATED, Bit.SWITCH_CLOSED | Bit.TIP_IN_HOLE),  # it dropped to the bottom
        (0.012, CLOSED, CLOSED, IN_HOLE, Bit.SWITCH_CLOSED | Bit.TIP_IN_HOLE),  # the switch is inverted
        (0.025, CLOSED, CLOSED, SEATED, Bit.SWITCH_CLOSED | Bit.TIP_IN_HOLE),  # the hand slid down the peg
    ],
)
def test_a_released_peg_is_where_it_was_held_or_fell(peg, depth, before, switch, place, bits):
    peg.held(depth, switch=before)
    gone = peg.gone(switch=switch)
    assert (gone.place, gone.is_held, gone.basis, gone.width) == (place, False, bits | Bit.HAND_EMPTY, 0.04)
    assert (gone.tip, gone.was_in_hole) == (peg.at(depth), place is not ON_PLATE)


@pytest.mark.parametrize(
    ("place_of", "below", "place", "words"),
    [
        ("bin", 0.0, BIN, "let go above the bin, hand 40.0 mm open"),
        ("slots", 0.001, RACK, "let go in its slot, hand 40.0 mm open"),
        ("slots", -0.001, ON_PLATE, "fell from"),
    ],
)
def test_a_peg_released_over_bin_or_slot_is_in_it(peg, place_of, below, place, words):
    x, y, z = peg.places.bin if place_of == "bin" else peg.places.slots[1]
    peg.look((x, y, z - below))
    gone = peg.gone()
    assert (gone.place, gone.evidence.startswith(words)) == (place, True)


@pytest.mark.parametrize(
    ("tip", "place"),
    [
        ((BIN_REACH, 4.0, 0.2), BIN),
        ((SLOT_REACH, 2.0, -0.01), RACK),
        ((0.0, 2.0, 0.0), ON_PLATE),
        ((0.0, 0.0, IN_HOLE_DEPTH), ON_PLATE),
        ((0.0, 0.0, IN_HOLE_DEPTH - EPSILON), NOWHERE),
    ],
)
def test_bin_slot_and_hole_end_exactly_at_their_limits(at_origin, tip, place):
    at_origin.look(tip, inserts=True)
    assert at_origin.gone().place is place


@pytest.mark.parametrize(
    ("depth", "inserts", "place"),
    [(1e-3, True, NOWHERE), (-1e-3, True, NOWHERE), (1e-3, False, ON_PLATE), (-0.02, True, ON_PLATE)],
)
def test_a_peg_lost_at_the_found_hole_may_lean_in_it(peg, depth, inserts, place):
    assert peg.held(depth, inserts=inserts).place is IN_HAND
    assert peg.gone().place is place


def test_a_peg_lost_over_its_hole_may_have_slipped_in(peg):
    peg.held(0.012)
    assert peg.held(-0.02).place is IN_HAND
    lost = peg.gone(width=0.0)
    assert (lost.place, lost.evidence) == (
        NOWHERE,
        "lost over the hole after it stood in it or at it, hand 0.0 mm open",
    )
    peg.held(-0.02)
    assert peg.gone(width=0.0).place is ON_PLATE


def test_while_the_fingers_move_the_peg_is_where_it_was(peg):
    held = peg.held(-0.1)
    assert peg.gone(moving=True) is held


@pytest.mark.parametrize("is_running", [True, False])
def test_a_fallen_peg_is_unknown_once_the_switch_closes(peg, is_running):
    """A leaning peg whose edge is in the hole may slide in after the hand has lost it."""
    peg.held(1e-4)
    assert peg.gone().place is ON_PLATE
    now = peg.gone(switch=CLOSED, is_running=is_running)
    assert now.place is NOWHERE
    assert "the switch is closed" in now.evidence
    assert peg.gone(switch=CLOSED, is_running=is_running) == now


# Seated.


@pytest.mark.parametrize(("switch", "place"), [(OPEN, RACK), (CLOSED, SEATED), (UNKNOWN, SEATED)])
def test_a_switch_that_opens_while_idle_means_peg_taken_away(peg, switch, place):
    peg.state = PartState(SEATED, "seated", False, 0.02)
    assert peg.look(AWAY, gripping=False, switch=switch, is_running=False).place is place


@pytest.mark.parametrize(("switch", "place"), [(OPEN, NOWHERE), (CLOSED, SEATED)])
def test_a_switch_that_opens_in_the_run_means_peg_came_out(peg, switch, place):
    seated = PartState(SEATED, "let go", False, 0.02)
    state = after_run(seated, peg.evidence(AWAY, gripping=False, switch=switch), peg.places)
    assert state.place is place
    assert (state.evidence == "was seated and let go; the switch is open now") is (switch is OPEN)


@pytest.mark.parametrize(("answer", "place"), [(CLOSED, SEATED), (OPEN, NOWHERE), (UNKNOWN, SEATED)])
def test_a_silent_switch_decides_on_a_seated_peg_when_it_answers(peg, answer, place):
    peg.held(peg.places.hole.depth, switch=CLOSED)
    peg.look(AWAY, gripping=False, switch=CLOSED)
    peg.state = silent = after_run(peg.state, peg.evidence(AWAY, gripping=False, switch=UNKNOWN), peg.places)
    assert (silent.place, silent.is_held) == (SEATED, False)
    assert "the switch does not answer now" in silent.evidence
    assert not silent.basis & Bit.SWITCH_CLOSED
    assert peg.look(AWAY, gripping=False, switch=answer, is_running=False).place is place
    # Taking a peg away opens the switch that has reported it as seated since, and no other.
    later = peg.look(AWAY, gripping=False, switch=OPEN, is_running=False)
    assert later.place is (RACK if answer is CLOSED else NOWHERE)


def test_a_peg_proven_by_force_stays_seated_without_the_switch(peg):
    latch = Latch(kind="detent", force=5.0, height=0.003)
    peg.places = replace(peg.places, hole=peg.places.hole.model_copy(update={"evidence": "force", "latch": latch}))
    assert proven(peg.held(0.02), "force", Bit.FORCE).is_held is False
    assert proven(peg.state, "", Bit.FORCE).basis == Bit.HAND_HOLDS | Bit.TIP_IN_HOLE | Bit.SWITCH_OPEN | Bit.FORCE
    assert peg.gone().place is IN_HOLE
    peg.state = seated = proven(peg.state, "force: a detent of 5.0 N", Bit.FORCE)
    assert (seated.place, "a detent of 5.0 N" in seated.evidence) == (SEATED, True)
    look = peg.evidence(gripping=False)
    assert after_run(seated, look, peg.places) == peg.gone(is_running=False) == seated
    assert at_start(seated, look, peg.places) == replace(seated, basis=seated.basis | Bit.RECORD)
    assert refusal_of(seated, OPEN, False, False) is Refusal.NONE


@pytest.mark.parametrize("depth", [0.0145, 0.02])
def test_a_success_by_the_switch_seats_the_peg_at_any_depth(peg, depth):
    peg.held(depth, switch=CLOSED)
    let_go = peg.gone(switch=CLOSED)
    assert let_go.place is (SEATED if depth == 0.02 else IN_HOLE)
    seated = proven(let_go, "switch", Bit.SWITCH_CLOSED)
    assert seated.place is SEATED
    assert (seated is let_go) is (depth == 0.02)


# When a program begins.


@pytest.mark.parametrize(
    ("kept", "gripping", "switch", "place"),
    [
        (None, False, OPEN, RACK),
        (None, False, CLOSED, SEATED),
        (None, True, OPEN, IN_HAND),
        (PartState(IN_HAND, "", True), False, OPEN, NOWHERE),
        (PartState(IN_HAND, "", True), True, OPEN, IN_HAND),
        (PartState(ON_PLATE, ""), False, OPEN, ON_PLATE),
        (PartState(IN_HOLE, "", False, 0.01), False, OPEN, IN_HOLE),
        (PartState(SEATED, ""), False, CLOSED, SEATED),
        (PartState(SEATED, ""), False, OPEN, RACK),
        (PartState(NOWHERE, ""), False, OPEN, NOWHERE),
    ],
)
def test_a_new_program_trusts_the_devices_before_the_record(peg, kept, gripping, switch, place):
    look = peg.evidence((0.45, 0.0, 0.3), gripping=gripping, switch=switch)
    assert at_start(kept, look, peg.places).place is place


def test_a_place_known_only_by_the_record_has_its_bit(peg):
    kept = PartState(IN_HOLE, "let go 12.0 mm deep", depth=0.012, basis=Bit.HAND_EMPTY | Bit.TIP_IN_HOLE)
    look = peg.evidence((0.45, 0.0, 0.3), gripping=False)
    assert at_start(kept, look, peg.places).basis == Bit.HAND_EMPTY | Bit.TIP_IN_HOLE | Bit.RECORD
    seated = replace(kept, place=SEATED, basis=kept.basis | Bit.SWITCH_CLOSED)
    assert at_start(seated, look, peg.places).basis == Bit.HAND_EMPTY | Bit.SWITCH_OPEN
    now = at_start(peg.held(0.012), peg.evidence(peg.at(-0.1), gripping=False), peg.places)
    assert (now.is_held, now.evidence) == (False, "in hole when the program ended; the hand is empty now")


@pytest.mark.parametrize(
    ("place", "is_held", "recovers_first", "is_refused"),
    [
        *((place, False, False, place in UNRESOLVED) for place in PartPlace),
        (IN_HAND, True, True, False),
        (IN_HOLE, True, True, False),
        (IN_HOLE, False, True, True),
        (ON_PLATE, False, True, True),
        (NOWHERE, False, True, True),
    ],
)
def test_a_start_needs_the_last_peg_resolved_or_recoverable(place, is_held, recovers_first, is_refused):
    refused = refusal_of(PartState(place, "", is_held), OPEN, is_rack_empty=False, recovers_first=recovers_first)
    assert refused is (Refusal.PART_UNRESOLVED if is_refused else Refusal.NONE)


@pytest.mark.parametrize(
    ("switch", "is_rack_empty", "refusal"),
    [
        (CLOSED, False, Refusal.HOLE_OCCUPIED),
        (UNKNOWN, False, Refusal.SWITCH_UNKNOWN),
        (OPEN, True, Refusal.RACK_EMPTY),
    ],
)
def test_a_start_needs_an_open_switch_and_a_peg(switch, is_rack_empty, refusal):
    assert refusal_of(EMPTY, switch, is_rack_empty, recovers_first=False) is refusal


# The evidence in words and in bits.


@pytest.mark.parametrize("place", PartPlace)
def test_every_place_comes_with_its_remedy(place):
    where = place.name.lower().replace("_", " ")
    state = PartState(place, "hand grips 8.0 mm", depth=0.012)
    assert told(state) == f"peg {where}, 12.0 mm deep (hand grips 8.0 mm): {REMEDIES[place].told()}"
    assert told(replace(state, depth=0.0)) == f"peg {where} (hand grips 8.0 mm): {REMEDIES[place].told()}"


@pytest.mark.parametrize(
    ("depth", "how", "words"),
    [
        (0.012, {}, "let go 12.0 mm deep, hand 40.0 mm open, switch open"),
        (-0.02, {"is_running": False}, "the hand was opened outside a run, hand 40.0 mm open"),
        (
            -0.02,
            {"width": 0.0},
            "fell from 20.0 mm above the plate's height at x {x:.3f}, y {y:.3f} m, hand 0.0 mm open",
        ),
        (-0.02, {"width": 0.008}, "the hand does not grip, 8.0 mm open at a peg of 8.0 mm"),
    ],
)
def test_the_evidence_names_what_was_read(peg, depth, how, words):
    end = "its end 12.0 mm deep, " if depth > 0.0 else ""
    assert peg.held(depth).evidence == f"hand grips 8.0 mm, {end}switch open"
    x, y, _ = peg.places.hole.centre
    gone = peg.gone(**how)
    assert gone.evidence == words.format(x=x, y=y)
    assert (gone.place is NOWHERE) is ("hand was" in words or "not grip" in words)


def test_one_reading_without_a_grip_hides_no_peg_in_the_hole(peg):
    peg.held(0.001, inserts=True)
    peg.gone(width=peg.places.thickness)
    peg.held(-0.001)
    assert peg.gone().place is NOWHERE


def test_one_reading_without_a_grip_keeps_the_slide(sliding):
    press(sliding, [0.0, 0.003], 2.0 * BEARS)
    sliding.gone(width=sliding.places.thickness)
    assert sliding.held(0.003).slid == pytest.approx(0.003)


def test_a_hand_slack_by_exactly_its_tolerance_neither_grips_nor_opens(at_origin):
    at_origin.look((0.5, 0.0, 0.2), width=WIDTH_TOLERANCE)
    slack = at_origin.gone(width=WIDTH_TOLERANCE, felt=True)
    assert (slack.place, slack.evidence) == (NOWHERE, "the hand does not grip, 1.5 mm open at a peg of 0.0 mm")
    assert slack.basis == Bit.SKIN_TOUCHED | Bit.SWITCH_OPEN


def test_a_peg_that_fell_keeps_the_evidence_of_its_fall(peg):
    peg.held(-0.1)
    peg.gone(width=0.0, felt=False)
    later = peg.gone(switch=UNKNOWN, is_running=False)
    assert (later.basis, later.width) == (Bit.HAND_EMPTY | Bit.SKIN_FREE | Bit.SWITCH_OPEN, 0.0)


@pytest.mark.parametrize(
    ("bits", "words"),
    [
        (
            Bit.HAND_HOLDS | Bit.SKIN_TOUCHED | Bit.TIP_IN_HOLE | Bit.SWITCH_OPEN,
            "the hand holds a peg, skin touched, its end was in the hole, switch open, pads 8.0 mm apart",
        ),
        (Bit.SWITCH_CLOSED, "the hand does not grip, switch closed, pads 8.0 mm apart"),
        (Bit.PERSON, "a person has taken the last peg away"),
        (Bit.NOTHING, ""),
    ],
)
def test_the_words_name_each_bit_and_the_width(bits, words):
    assert in_words(bits, 0.008) == words


# A hand whose arm reports nothing.


def test_a_hand_closing_while_the_arm_is_silent_holds_its_peg(peg):
    assert peg.by_hand(gripping=False) is EMPTY
    assert peg.by_hand(gripping=True, width=peg.places.thickness + 1.1 * WIDTH_TOLERANCE) is EMPTY
    now = peg.by_hand(gripping=True)
    assert (now.place, now.is_held, now.depth) == (IN_HAND, True, 0.0)
    assert "the arm reports no position" in now.evidence
    assert now.basis & Bit.HAND_HOLDS


@pytest.mark.parametrize("depth", [-0.05, 0.01, 0.02])
def test_a_hand_that_keeps_holding_changes_nothing(peg, depth):
    before = peg.held(depth)
    assert peg.by_hand(gripping=True) is before
    assert peg.by_hand(gripping=False, moving=True) is before


def test_a_peg_held_at_the_hole_may_enter_while_the_arm_is_silent(peg):
    peg.held(0.003, inserts=True)
    assert peg.by_hand(gripping=True).place is NOWHERE
    assert peg.held(0.01).place is IN_HOLE
    peg.held(-0.05)
    assert peg.by_hand(gripping=True).place is IN_HAND


@pytest.mark.parametrize(
    ("depth", "switch", "is_running", "place"),
    [
        (0.02, CLOSED, True, SEATED),
        (0.01, UNKNOWN, True, IN_HOLE),
        (-0.05, OPEN, True, ON_PLATE),
        (-0.05, OPEN, False, NOWHERE),
    ],
)
def test_a_hand_that_opens_releases_at_the_last_pose(peg, depth, switch, is_running, place):
    peg.held(depth)
    now = peg.by_hand(gripping=False, switch=switch, is_running=is_running)
    assert (now.place, now.is_held) == (place, False)


# A peg that slides in the hand because it is pressed harder than the pads bear.


def press(peg, depths, push):
    """Look at the peg while the hand goes through these depths, m, and so much presses on it, N."""
    for number, depth in enumerate(depths):
        peg.held(depth, push=push if number else 0.0)
    return peg.state


@pytest.mark.parametrize(("push", "place"), [(BEARS - 0.1, IN_HOLE), (BEARS + 0.1, IN_HAND), (60.0, IN_HAND)])
def test_a_peg_pressed_beyond_the_grip_may_have_slid(sliding, push, place):
    state = press(sliding, np.arange(0.0, 0.0105, 0.001), push)
    assert state.place is place
    assert state.slid == pytest.approx(0.01 if place is IN_HAND else 0.0)
    again = at_start(state, sliding.evidence(), sliding.places)
    assert (again.place, again.slid) == (place, state.slid)


def test_the_slide_is_subtracted_from_the_depth_in_the_hole(sliding):
    press(sliding, [0.0, 0.003], 2.0 * BEARS)
    for deeper, place in ((0.99, IN_HAND), (1.01, IN_HOLE)):
        now = sliding.held(0.003 + deeper * IN_HOLE_DEPTH)
        assert (now.place, now.slid) == (place, pytest.approx(0.003))


def test_a_hand_that_rises_or_releases_resets_the_slide(sliding):
    assert press(sliding, [0.0, 0.003, -0.002], 2.0 * BEARS).slid == 0.0
    press(sliding, [0.0, 0.003], 20.0)
    sliding.look((0.3, 0.3, 0.3), gripping=False)
    assert sliding.held(-0.05, push=20.0).slid == 0.0


def test_a_peg_on_its_switch_is_seated_at_any_push(sliding):
    depth = sliding.places.hole.depth
    assert press(sliding, np.linspace(0.0, depth, 20), 2.0 * BEARS).place is IN_HAND
    seated = sliding.held(depth, switch=CLOSED, push=2.0 * BEARS)
    assert (seated.place, seated.depth) == (SEATED, pytest.approx(depth))
    assert sliding.look(AWAY, gripping=False, switch=CLOSED).place is SEATED


def test_evidence_has_the_push_along_the_peg_and_an_end(rig):
    rig.gripper.grip(30.0)
    arm = replace(rig.arm.read(), wrench=Wrench(np.array([5.0, -3.0, 9.0]), np.zeros(3)))
    leaning = arm.tcp.position - 0.05 * np.array([0.6, 0.0, 0.8])
    for tip, push, where in ((leaning, 0.6 * 5.0 + 0.8 * 9.0, leaning), (np.full(3, math.nan), 0.0, arm.tcp.position)):
        found = evidence_of(arm, rig.gripper.read(), OPEN, tip, True)
        assert found.push == pytest.approx(push)
        assert found.tip == pytest.approx(tuple(where))
