"""Where the peg is by the evidence: every place, every way in and out, and what a start makes of it."""

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
    UPRIGHT,
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
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal
from skills.seating.decision import CLOSED_TOLERANCE

OPEN, CLOSED, UNKNOWN = SwitchState.OPEN, SwitchState.CLOSED, SwitchState.UNKNOWN
EMPTY = PartState(PartPlace.RACK, "in the rack")


@pytest.fixture
def places(loaded):
    return places_of(loaded.cell.job(), loaded.cell.recover.bin)


def seen(places, tip, *, gripping=True, width=None, moving=False, switch=OPEN, tilt=math.pi / 4, felt=None):
    thickness = places.thickness if gripping else 0.04
    return PegEvidence(thickness if width is None else width, gripping, moving, tip, 0.0, switch, tilt, felt)


def at_depth(places, depth, aside=0.0):
    x, y, z = places.hole.centre
    return (x + aside, y, z - depth)


def held_at(places, depth, switch=OPEN):
    return after(EMPTY, seen(places, at_depth(places, depth), switch=switch), places, is_running=True)


@pytest.mark.parametrize(
    ("depth", "switch", "place"),
    [
        (-0.1, OPEN, PartPlace.IN_HAND),
        (IN_HOLE_DEPTH - 1e-5, OPEN, PartPlace.IN_HAND),
        (IN_HOLE_DEPTH + 1e-5, OPEN, PartPlace.IN_HOLE),
        (0.02, OPEN, PartPlace.IN_HOLE),
        (0.02, CLOSED, PartPlace.SEATED),
        (0.0159, CLOSED, PartPlace.IN_HOLE),
        (0.02, UNKNOWN, PartPlace.IN_HOLE),
    ],
)
def test_a_held_peg_is_where_depth_and_switch_say(places, depth, switch, place):
    state = held_at(places, depth, switch)
    assert (state.place, state.is_held) == (place, True)
    assert state.depth == pytest.approx(depth if place is not PartPlace.IN_HAND else 0.0)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(
    ("beyond", "place"), [(HOLE_MARGIN - 1e-5, PartPlace.IN_HOLE), (HOLE_MARGIN + 1e-5, PartPlace.IN_HAND)]
)
def test_a_held_peg_is_in_the_hole_up_to_a_margin_beside_the_hole_s_area(places, axis, beyond, place):
    tip = list(at_depth(places, 0.02))
    tip[axis] -= places.hole.area[axis] / 2 + beyond
    assert after(EMPTY, seen(places, tuple(tip)), places, is_running=True).place is place


def test_a_held_peg_beside_the_hole_s_area_is_in_no_hole_however_deep(places):
    aside = places.hole.area[0] / 2 + 0.006
    state = after(EMPTY, seen(places, at_depth(places, 0.02, aside)), places, is_running=True)
    assert state.place is PartPlace.IN_HAND


@pytest.mark.parametrize(("off", "is_held"), [(WIDTH_TOLERANCE - 1e-5, True), (WIDTH_TOLERANCE + 1e-5, False)])
def test_the_hand_holds_what_is_as_wide_as_the_peg(places, off, is_held):
    look = seen(places, at_depth(places, -0.1), width=places.thickness + off)
    assert after(EMPTY, look, places, is_running=True).is_held == is_held


@pytest.mark.parametrize(
    ("depth", "switch", "place"),
    [
        (-0.1, OPEN, PartPlace.ON_PLATE),
        (0.001, OPEN, PartPlace.ON_PLATE),
        (0.012, OPEN, PartPlace.IN_HOLE),
        (0.02, CLOSED, PartPlace.SEATED),
    ],
)
def test_a_peg_that_is_let_go_is_where_it_was_held_or_fell(places, depth, switch, place):
    held = held_at(places, depth, switch)
    state = after(held, seen(places, held.tip, gripping=False, switch=switch), places, is_running=True)
    assert (state.place, state.is_held) == (place, False)


def test_a_peg_that_is_lost_from_a_closed_hand_fell(places):
    held = held_at(places, -0.1)
    state = after(held, seen(places, held.tip, gripping=False, width=0.0), places, is_running=True)
    assert state.place is PartPlace.ON_PLATE
    assert "fell from 100.0 mm above the plate's height at x " in state.evidence


def test_a_peg_that_is_let_go_above_the_bin_is_in_it_and_in_its_slot_in_the_rack(places):
    for tip, place in (
        ((*places.bin[:2], 0.2), PartPlace.BIN),
        ((*places.slots[1][:2], places.slots[1][2] - 0.001), PartPlace.RACK),
        ((*places.slots[1][:2], places.slots[1][2] + 0.001), PartPlace.ON_PLATE),
    ):
        held = after(EMPTY, seen(places, tip), places, is_running=True)
        assert after(held, seen(places, tip, gripping=False), places, is_running=True).place is place


def test_a_peg_that_is_lost_over_the_hole_after_it_stood_in_it_may_have_slipped_out_of_the_hand(places):
    drawn = after(held_at(places, 0.012), seen(places, at_depth(places, -0.02)), places, is_running=True)
    assert drawn.place is PartPlace.IN_HAND
    lost = after(drawn, seen(places, drawn.tip, gripping=False, width=0.0), places, is_running=True)
    assert lost.place is PartPlace.UNKNOWN
    taken_again = after(lost, seen(places, at_depth(places, -0.02)), places, is_running=True)
    lost = after(taken_again, seen(places, drawn.tip, gripping=False, width=0.0), places, is_running=True)
    assert lost.place is PartPlace.ON_PLATE


def test_while_the_fingers_move_the_peg_is_where_it_was(places):
    held = held_at(places, -0.1)
    assert after(held, seen(places, held.tip, gripping=False, moving=True), places, is_running=True) is held


def test_a_hand_that_neither_grips_nor_opens_leaves_nobody_knowing(places):
    held = held_at(places, -0.1)
    slack = seen(places, held.tip, gripping=False, width=places.thickness)
    assert after(held, slack, places, is_running=True).place is PartPlace.UNKNOWN


def test_a_hand_that_is_opened_outside_a_run_leaves_nobody_knowing(places):
    held = held_at(places, -0.1)
    assert after(held, seen(places, held.tip, gripping=False), places, is_running=False).place is PartPlace.UNKNOWN


def test_a_seated_peg_is_taken_away_where_the_switch_opens_while_the_cell_waits(places):
    seated = PartState(PartPlace.SEATED, "seated", False, 0.02)
    look = seen(places, (0.0, 0.0, 0.5), gripping=False, switch=OPEN)
    assert after(seated, look, places, is_running=False).place is PartPlace.RACK
    assert after(seated, replace(look, switch=CLOSED), places, is_running=False) is seated
    assert after(seated, replace(look, switch=UNKNOWN), places, is_running=False) is seated


def test_a_seated_peg_whose_switch_has_opened_when_the_run_ends_came_along(places):
    seated = PartState(PartPlace.SEATED, "seated", False, 0.02)
    look = seen(places, (0.0, 0.0, 0.5), gripping=False, switch=OPEN)
    assert after_run(seated, look, places).place is PartPlace.UNKNOWN
    assert after_run(seated, replace(look, switch=CLOSED), places).place is PartPlace.SEATED


@pytest.mark.parametrize(
    ("answer", "place"), [(CLOSED, PartPlace.SEATED), (OPEN, PartPlace.UNKNOWN), (UNKNOWN, PartPlace.SEATED)]
)
def test_a_seated_peg_whose_switch_falls_silent_is_where_the_switch_says_once_it_answers(places, answer, place):
    held = held_at(places, places.hole.depth, CLOSED)
    gone = seen(places, (0.0, 0.0, 0.5), gripping=False, switch=CLOSED)
    silent = after_run(after(held, gone, places, is_running=True), replace(gone, switch=UNKNOWN), places)
    assert (silent.place, silent.is_held) == (PartPlace.SEATED, False)
    assert "the switch does not answer now" in silent.evidence
    assert not silent.basis & PartEvidence.SWITCH_CLOSED
    now = after(silent, replace(gone, switch=answer), places, is_running=False)
    assert now.place is place
    # Taking a peg away opens the switch that has reported it as seated since, and no other.
    later = after(now, replace(gone, switch=OPEN), places, is_running=False)
    assert later.place is (PartPlace.RACK if answer is CLOSED else PartPlace.UNKNOWN)


@pytest.mark.parametrize(
    ("kept", "gripping", "switch", "place"),
    [
        (None, False, OPEN, PartPlace.RACK),
        (None, False, CLOSED, PartPlace.SEATED),
        (None, True, OPEN, PartPlace.IN_HAND),
        (PartState(PartPlace.IN_HAND, "", True), False, OPEN, PartPlace.UNKNOWN),
        (PartState(PartPlace.IN_HAND, "", True), True, OPEN, PartPlace.IN_HAND),
        (PartState(PartPlace.ON_PLATE, ""), False, OPEN, PartPlace.ON_PLATE),
        (PartState(PartPlace.IN_HOLE, "", False, 0.01), False, OPEN, PartPlace.IN_HOLE),
        (PartState(PartPlace.SEATED, ""), False, CLOSED, PartPlace.SEATED),
        (PartState(PartPlace.SEATED, ""), False, OPEN, PartPlace.RACK),
        (PartState(PartPlace.UNKNOWN, ""), False, OPEN, PartPlace.UNKNOWN),
    ],
)
def test_a_program_that_begins_believes_the_devices_first_and_then_the_record(places, kept, gripping, switch, place):
    look = seen(places, (0.45, 0.0, 0.3), gripping=gripping, switch=switch)
    assert at_start(kept, look, places).place is place


@pytest.mark.parametrize("place", PartPlace)
def test_a_start_wants_the_last_peg_where_it_may_stay(place):
    refused = refusal_of(PartState(place, ""), OPEN, is_rack_empty=False, recovers_first=False)
    assert refused is (Refusal.PART_UNRESOLVED if place in UNRESOLVED else Refusal.NONE)


@pytest.mark.parametrize(
    ("place", "is_held", "is_refused"),
    [
        (PartPlace.IN_HAND, True, False),
        (PartPlace.IN_HOLE, True, False),
        (PartPlace.IN_HOLE, False, True),
        (PartPlace.ON_PLATE, False, True),
        (PartPlace.UNKNOWN, False, True),
    ],
)
def test_what_the_hand_holds_is_recovered_first_where_the_config_says_so(place, is_held, is_refused):
    refused = refusal_of(PartState(place, "", is_held), OPEN, is_rack_empty=False, recovers_first=True)
    assert (refused is Refusal.PART_UNRESOLVED) == is_refused


@pytest.mark.parametrize(("switch", "refusal"), [(CLOSED, Refusal.HOLE_OCCUPIED), (UNKNOWN, Refusal.SWITCH_UNKNOWN)])
def test_a_start_wants_an_open_switch(switch, refusal):
    assert refusal_of(EMPTY, switch, is_rack_empty=False, recovers_first=False) is refusal


def test_a_start_wants_a_peg_in_the_rack():
    assert refusal_of(EMPTY, OPEN, is_rack_empty=True, recovers_first=False) is Refusal.RACK_EMPTY


@pytest.mark.parametrize("place", PartPlace)
def test_every_place_is_told_with_what_to_do_in_one_line(place):
    line = told(PartState(place, "hand grips 8.0 mm", depth=0.012))
    assert line.startswith(f"peg {place.name.lower().replace('_', ' ')}, 12.0 mm deep (hand grips 8.0 mm): ")
    assert line.endswith(REMEDIES[place])
    assert "\n" not in line


def test_the_evidence_names_what_was_read(places):
    assert held_at(places, 0.012).evidence == "hand grips 8.0 mm, its end 12.0 mm deep, switch open"
    assert held_at(places, -0.1).evidence == "hand grips 8.0 mm, switch open"
    x, y, z = places.bin
    above = after(EMPTY, seen(places, (x, y, z)), places, is_running=True)
    gone = after(above, seen(places, (x, y, z), gripping=False), places, is_running=True)
    assert (gone.place, gone.evidence) == (PartPlace.BIN, "let go above the bin, hand 40.0 mm open")


def test_a_peg_that_is_in_no_hole_is_told_without_a_depth():
    assert told(EMPTY) == f"peg rack (in the rack): {REMEDIES[PartPlace.RACK]}"


def test_a_peg_that_was_held_when_the_program_ended_and_is_gone_is_told_so(places):
    now = at_start(held_at(places, 0.012), seen(places, at_depth(places, -0.1), gripping=False), places)
    assert now.evidence == "in hole when the program ended; the hand is empty now"


def test_a_peg_that_is_back_in_its_slot_or_came_along_is_told_so(places):
    x, y, z = places.slots[0]
    held = after(EMPTY, seen(places, (x, y, z - 0.001)), places, is_running=True)
    gone = after(held, seen(places, (x, y, z), gripping=False), places, is_running=True)
    assert (gone.place, gone.evidence) == (PartPlace.RACK, "let go in its slot, hand 40.0 mm open")
    seated = PartState(PartPlace.SEATED, "let go", depth=0.02)
    out = after_run(seated, seen(places, at_depth(places, -0.1), gripping=False), places)
    assert (out.place, out.evidence) == (PartPlace.UNKNOWN, "was seated and let go; the switch is open now")


def test_a_peg_that_was_held_and_is_gone_is_held_no_more(places):
    assert not at_start(held_at(places, 0.012), seen(places, at_depth(places, -0.1), gripping=False), places).is_held


def test_a_peg_whose_end_nobody_can_tell_is_where_the_hand_is(rig):
    state = rig.cell.context(0).observe()
    for tip, where in ((np.array([0.1, 0.2, 0.3]), (0.1, 0.2, 0.3)), (np.full(3, np.nan), (0.45, 0.0, 0.3))):
        assert evidence_of(state.arm, state.gripper, OPEN, tip, 0.0, None).tip == where


def test_a_peg_that_force_has_proven_stays_seated_while_the_switch_is_open(places):
    hole = places.hole.model_copy(update={"evidence": "force", "latch": Latch(kind="detent", force=5.0, height=0.003)})
    without = replace(places, hole=hole)
    let_go = after(held_at(places, 0.02), seen(places, at_depth(places, 0.02), gripping=False), without, True)
    assert let_go.place is PartPlace.IN_HOLE
    seated = proven(let_go, "force: a detent of 5.0 N")
    assert (seated.place, "a detent of 5.0 N" in seated.evidence) == (PartPlace.SEATED, True)
    looked = seen(places, at_depth(places, 0.02), gripping=False)
    assert after_run(seated, looked, without) == after(seated, looked, without, False) == seated
    assert at_start(seated, looked, without) == replace(seated, basis=seated.basis | PartEvidence.RECORD)
    assert refusal_of(seated, OPEN, False, False) is Refusal.NONE


@pytest.mark.parametrize(
    ("depth", "tilt", "place"),
    [
        (1e-3, 0.05, PartPlace.UNKNOWN),
        (-1e-3, 0.05, PartPlace.UNKNOWN),
        (1e-3, math.pi / 4, PartPlace.ON_PLATE),
        (-0.02, 0.05, PartPlace.ON_PLATE),
    ],
)
def test_a_peg_that_is_lost_upright_at_the_hole_may_be_in_it_and_a_leaning_one_lies_on_the_plate(
    places, depth, tilt, place
):
    tip = at_depth(places, depth)
    held = after(EMPTY, seen(places, tip, tilt=tilt), places, is_running=True)
    lost = after(held, seen(places, tip, gripping=False), places, is_running=True)
    assert (held.place, lost.place) == (PartPlace.IN_HAND, place)


@pytest.mark.parametrize("is_running", [True, False])
def test_a_peg_that_fell_at_the_surface_is_not_on_the_plate_once_the_switch_closes(places, is_running):
    """A leaning peg whose edge is in the hole may slide in after the hand has lost it."""
    lost = after(held_at(places, 1e-4), seen(places, at_depth(places, 0.0), gripping=False), places, is_running=True)
    assert lost.place is PartPlace.ON_PLATE
    closed = seen(places, at_depth(places, 0.0), gripping=False, switch=CLOSED)
    now = after(lost, closed, places, is_running)
    assert now.place is PartPlace.UNKNOWN
    assert "the switch is closed" in now.evidence
    assert after(now, closed, places, is_running) == now


# Exactly at a limit: a cell at the base's origin, where no length is rounded.


@pytest.fixture
def at_origin(places):
    hole = places.hole.model_copy(update={"centre": (0.0, 0.0, 0.0), "depth": 0.0})
    return replace(places, hole=hole, thickness=0.0, slots=((0.0, 2.0, 0.0),), bin=(0.0, 4.0, 0.0))


def let_go_at(places, tip, **how):
    """Return where a peg is that was held with its end there and is let go."""
    held = after(EMPTY, seen(places, tip, **how), places, is_running=True)
    return after(held, seen(places, tip, gripping=False), places, is_running=True).place


def test_a_hand_that_is_slack_by_exactly_what_its_width_errs_neither_grips_nor_opens(at_origin):
    held = after(EMPTY, seen(at_origin, (0.5, 0.0, 0.2), width=WIDTH_TOLERANCE), at_origin, is_running=True)
    slack = seen(at_origin, held.tip, gripping=False, width=WIDTH_TOLERANCE)
    assert (held.place, after(held, slack, at_origin, True).evidence) == (
        PartPlace.IN_HAND,
        "the hand does not grip, 1.5 mm open at a peg of 0.0 mm",
    )


@pytest.mark.parametrize(
    ("tip", "place"),
    [
        ((BIN_REACH, 4.0, 0.2), PartPlace.BIN),
        ((SLOT_REACH, 2.0, -0.01), PartPlace.RACK),
        ((0.0, 2.0, 0.0), PartPlace.ON_PLATE),
        ((0.0, 0.0, IN_HOLE_DEPTH), PartPlace.ON_PLATE),
    ],
)
def test_bin_and_slot_reach_exactly_as_far_as_their_limits_say_and_a_hole_begins_below_its(at_origin, tip, place):
    assert let_go_at(at_origin, tip, tilt=0.0) is place


@pytest.mark.parametrize(("tilt", "place"), [(UPRIGHT, PartPlace.ON_PLATE), (UPRIGHT - 1e-9, PartPlace.UNKNOWN)])
def test_a_peg_that_leans_by_the_limit_is_not_upright(at_origin, tilt, place):
    assert let_go_at(at_origin, (0.0, 0.0, 0.0), tilt=tilt) is place


@pytest.mark.parametrize("aside", [0.0, 1.0])
def test_a_held_peg_is_in_the_hole_exactly_from_its_depth_on_and_up_to_its_margin(at_origin, aside):
    tip = (aside * (at_origin.hole.area[0] / 2 + HOLE_MARGIN), 0.0, -IN_HOLE_DEPTH)
    assert after(EMPTY, seen(at_origin, tip), at_origin, is_running=True).place is PartPlace.IN_HOLE


def test_a_held_peg_is_seated_exactly_as_far_off_the_hole_s_depth_as_the_switch_may_err(at_origin):
    closed = seen(at_origin, (0.0, 0.0, -CLOSED_TOLERANCE), switch=CLOSED)
    assert after(EMPTY, closed, at_origin, is_running=True).place is PartPlace.SEATED


# Place of a peg after the hand lets go, and its report.


@pytest.mark.parametrize(
    ("before", "switch", "place", "bits"),
    [
        (OPEN, CLOSED, PartPlace.SEATED, PartEvidence.SWITCH_CLOSED),
        (CLOSED, OPEN, PartPlace.IN_HOLE, PartEvidence.SWITCH_OPEN),
    ],
)
def test_a_peg_that_is_let_go_in_the_hole_is_where_the_switch_says_then(places, before, switch, place, bits):
    held = held_at(places, 0.02, before)
    gone = after(held, seen(places, held.tip, gripping=False, switch=switch), places, is_running=True)
    assert gone == PartState(
        place,
        f"let go 20.0 mm deep, hand 40.0 mm open, switch {switch}",
        False,
        pytest.approx(0.02),
        at_depth(places, 0.02),
        True,
        bits | PartEvidence.HAND_EMPTY | PartEvidence.TIP_IN_HOLE,
        0.04,
    )


def test_a_peg_that_was_lost_is_told_with_how(places):
    x, y, _ = places.hole.centre
    drawn = after(held_at(places, 0.012), seen(places, at_depth(places, -0.02)), places, is_running=True)
    dropped = seen(places, drawn.tip, gripping=False)
    assert after(drawn, dropped, places, True).evidence == (
        "lost over the hole after it stood in it or at it, hand 40.0 mm open"
    )
    never = held_at(places, -0.02)
    assert after(never, dropped, places, False).evidence == "the hand was opened outside a run, hand 40.0 mm open"
    assert after(never, dropped, places, True).evidence == (
        f"fell from 20.0 mm above the plate's height at x {x:.3f}, y {y:.3f} m, hand 40.0 mm open"
    )


def test_a_peg_that_is_proven_seated_is_no_longer_held(places):
    assert proven(held_at(places, 0.02), "force").is_held is False


# The evidence in bits, as the buses carry it.

Bit = PartEvidence


@pytest.mark.parametrize(
    ("how", "bits"),
    [
        ({"felt": True}, Bit.HAND_HOLDS | Bit.SKIN_TOUCHED | Bit.SWITCH_OPEN),
        ({"felt": False, "switch": CLOSED}, Bit.HAND_HOLDS | Bit.SKIN_FREE | Bit.SWITCH_CLOSED),
        ({"switch": UNKNOWN}, Bit.HAND_HOLDS),
        ({"depth": 0.012}, Bit.HAND_HOLDS | Bit.TIP_IN_HOLE | Bit.SWITCH_OPEN),
    ],
)
def test_the_bits_say_what_hand_skin_tip_and_switch_said(places, how, bits):
    depth = how.pop("depth", -0.1)
    state = after(EMPTY, seen(places, at_depth(places, depth), **how), places, is_running=True)
    assert (state.basis, state.width) == (bits, places.thickness)


def test_a_hand_that_is_slack_has_neither_bit_of_the_hand(places):
    held = held_at(places, -0.1)
    slack = seen(places, held.tip, gripping=False, width=places.thickness, felt=True)
    assert after(held, slack, places, is_running=True).basis == Bit.SKIN_TOUCHED | Bit.SWITCH_OPEN


def test_a_peg_that_fell_keeps_the_evidence_of_its_fall(places):
    held = held_at(places, -0.1)
    fell = after(held, seen(places, held.tip, gripping=False, width=0.0, felt=False), places, is_running=True)
    later = after(fell, seen(places, held.tip, gripping=False, width=0.04, switch=UNKNOWN), places, is_running=False)
    assert (later.basis, later.width) == (Bit.HAND_EMPTY | Bit.SKIN_FREE | Bit.SWITCH_OPEN, 0.0)


def test_a_place_that_only_the_record_tells_says_so_and_one_that_the_sensors_tell_does_not(places):
    kept = PartState(PartPlace.IN_HOLE, "let go 12.0 mm deep", depth=0.012, basis=Bit.HAND_EMPTY | Bit.TIP_IN_HOLE)
    look = seen(places, (0.45, 0.0, 0.3), gripping=False)
    assert at_start(kept, look, places).basis == Bit.HAND_EMPTY | Bit.TIP_IN_HOLE | Bit.RECORD
    seated = replace(kept, place=PartPlace.SEATED, basis=kept.basis | Bit.SWITCH_CLOSED)
    assert at_start(seated, look, places).basis == Bit.HAND_EMPTY | Bit.SWITCH_OPEN


def test_a_peg_that_force_has_proven_seated_says_so(places):
    assert (
        proven(held_at(places, 0.02), "force").basis == Bit.HAND_HOLDS | Bit.TIP_IN_HOLE | Bit.SWITCH_OPEN | Bit.FORCE
    )


def test_the_bits_in_words_name_each_of_them_and_the_width():
    assert in_words(Bit.HAND_HOLDS | Bit.SKIN_TOUCHED | Bit.TIP_IN_HOLE | Bit.SWITCH_OPEN, 0.008) == (
        "the hand holds a peg, skin touched, its end was in the hole, switch open, pads 8.0 mm apart"
    )
    assert in_words(Bit.SWITCH_CLOSED, 0.008) == "the hand does not grip, switch closed, pads 8.0 mm apart"
    assert in_words(Bit.PERSON, 0.0) == "a person has taken the last peg away"
    assert in_words(Bit.NOTHING, 0.0) == ""


def alone(before, places, *, gripping, moving=False, width=None, switch=OPEN, is_running=True):
    """Return where the peg is after a reading of the hand while the arm reports nothing."""
    wide = places.thickness if gripping else 0.04
    return by_hand_alone(
        before, GripperState(wide if width is None else width, gripping, moving), switch, places, is_running
    )


def test_a_hand_that_closes_on_its_peg_while_the_arm_does_not_tell_holds_it_wherever_that_is(places):
    now = alone(EMPTY, places, gripping=True)
    assert (now.place, now.is_held, now.depth) == (PartPlace.IN_HAND, True, 0.0)
    assert "the arm does not tell where" in now.evidence
    assert now.basis & PartEvidence.HAND_HOLDS
    assert alone(EMPTY, places, gripping=True, width=places.thickness + 1.1 * WIDTH_TOLERANCE) is EMPTY


@pytest.mark.parametrize("depth", [-0.05, 0.01, 0.02])
def test_a_hand_that_goes_on_holding_its_peg_leaves_it_where_it_was(places, depth):
    before = held_at(places, depth)
    assert alone(before, places, gripping=True) is before
    assert alone(before, places, gripping=False, moving=True) is before


@pytest.mark.parametrize(
    ("depth", "switch", "place"),
    [(0.02, CLOSED, PartPlace.SEATED), (0.01, UNKNOWN, PartPlace.IN_HOLE), (-0.05, OPEN, PartPlace.ON_PLATE)],
)
def test_a_hand_that_opens_while_the_arm_does_not_tell_lets_go_of_its_peg_where_the_arm_was_last(
    places, depth, switch, place
):
    now = alone(held_at(places, depth), places, gripping=False, switch=switch)
    assert (now.place, now.is_held) == (place, False)


def test_a_hand_that_is_opened_outside_a_run_while_the_arm_does_not_tell_leaves_nobody_knowing(places):
    assert alone(held_at(places, -0.05), places, gripping=False, is_running=False).place is PartPlace.UNKNOWN


def test_a_hand_that_holds_nothing_and_goes_on_holding_nothing_is_no_news(places):
    assert alone(EMPTY, places, gripping=False) is EMPTY


BEARS = 12.5
"""Force that the pads bear in these tests, N."""


def pressed(places, depths, push):
    """Return the state of a peg at the hole whose believed end goes through these depths, m, while so much presses it along the fingers, N."""
    part = held_at(places, depths[0])
    for depth in depths[1:]:
        part = after(part, replace(seen(places, at_depth(places, depth)), push=push), places, is_running=True)
    return part


@pytest.mark.parametrize(
    ("push", "place"), [(BEARS - 0.1, PartPlace.IN_HOLE), (BEARS + 0.1, PartPlace.IN_HAND), (60.0, PartPlace.IN_HAND)]
)
def test_a_peg_that_is_pressed_harder_than_the_pads_bear_may_have_slid_up_instead_of_gone_in(places, push, place):
    places = replace(places, bears=BEARS)
    part = pressed(places, np.arange(0.0, 0.0105, 0.001), push)
    assert part.place is place
    assert part.slid == pytest.approx(0.01 if place is PartPlace.IN_HAND else 0.0)


def test_what_the_hand_has_slid_is_missing_from_the_way_into_the_hole_and_no_more(places):
    places = replace(places, bears=BEARS)
    slid = pressed(places, [0.0, 0.003], 2.0 * BEARS)
    for deeper, place in ((0.99, PartPlace.IN_HAND), (1.01, PartPlace.IN_HOLE)):
        now = after(slid, seen(places, at_depth(places, 0.003 + deeper * IN_HOLE_DEPTH)), places, is_running=True)
        assert (now.place, now.slid) == (place, pytest.approx(0.003))


def test_a_peg_that_is_pushed_back_by_a_hand_that_rises_has_slid_nowhere(places):
    places = replace(places, bears=BEARS)
    assert pressed(places, [0.0, 0.003, -0.002], 2.0 * BEARS).slid == 0.0


def test_a_peg_on_its_switch_is_seated_whatever_the_arm_reports_as_its_push(places):
    """An arm whose wrench is off reports a push all the while."""
    places, depth = replace(places, bears=BEARS), places.hole.depth
    pushed = pressed(places, np.linspace(0.0, depth, 20), 2.0 * BEARS)
    assert pushed.place is PartPlace.IN_HAND
    look = replace(seen(places, at_depth(places, depth), switch=CLOSED), push=2.0 * BEARS)
    seated = after(pushed, look, places, is_running=True)
    assert (seated.place, seated.depth) == (PartPlace.SEATED, pytest.approx(depth))
    gone = seen(places, (0.0, 0.0, 0.5), gripping=False, switch=CLOSED)
    assert after(seated, gone, places, is_running=True).place is PartPlace.SEATED


def test_a_peg_that_is_let_go_has_slid_in_no_hand(places):
    places = replace(places, bears=BEARS)
    free = after(pressed(places, [0.0, 0.003], 20.0), seen(places, (0.3, 0.3, 0.3), gripping=False), places, True)
    taken = after(free, replace(seen(places, at_depth(places, -0.05)), push=20.0), places, is_running=True)
    assert taken.slid == 0.0


def test_a_program_that_begins_again_remembers_how_far_the_hand_has_slid(places):
    places = replace(places, bears=BEARS)
    kept = pressed(places, np.arange(0.0, 0.0065, 0.001), 20.0)
    again = at_start(kept, seen(places, at_depth(places, 0.006)), places)
    assert (again.place, again.slid) == (PartPlace.IN_HAND, pytest.approx(0.006))


def test_the_push_is_the_force_on_the_hand_along_the_peg(rig):
    rig.gripper.grip(30.0)
    arm = replace(rig.arm.read(), wrench=Wrench(np.array([5.0, -3.0, 9.0]), np.zeros(3)))
    leaning = arm.tcp.position - 0.05 * np.array([0.6, 0.0, 0.8])
    found = evidence_of(arm, rig.gripper.read(), OPEN, leaning, 0.0, True)
    assert found.push == pytest.approx(0.6 * 5.0 + 0.8 * 9.0)
    assert evidence_of(arm, rig.gripper.read(), OPEN, np.full(3, math.nan), 0.0, True).push == 0.0
