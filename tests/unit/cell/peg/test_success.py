"""What proves a success, each part of it at its limit and one beyond it."""

from dataclasses import replace

import numpy as np
import pytest

from cell.peg.ending import Ending
from cell.peg.part_state import PartState
from cell.peg.success import AWAY, PLANE_TOLERANCE, LastLook, Proof, judged
from drivers.errors import SuccessUnprovenError, SwitchDisagreesError
from drivers.frames import UP
from drivers.quantities import WIDTH_TOLERANCE, GripperState, ImpedanceSetpoint, SwitchState
from plc_bridge.protocol.messages import PartPlace
from skills.contract import Outcome, Reason
from skills.entry import Claim
from skills.flow import StageRecord
from skills.search.spray_search import SpraySearchResult
from skills.search.surface import Plane
from skills.seating.decision import (
    BORNE_FOR,
    CLOSED_TOLERANCE,
    DOUBTED,
    GIVE,
    LEAST_PUSH,
    MOST_DEEP,
    MOST_SHALLOW,
    Footing,
)

OPEN, CLOSED = SwitchState.OPEN, SwitchState.CLOSED
WIDE, CLOSED_HAND = GripperState(0.04, False, False), GripperState(0.008, True, False)
SUCCESS = Ending(Outcome.SUCCESS, "release_and_retract", Reason.NONE)
SEATED = PartState(PartPlace.SEATED, "let go 20.0 mm deep", False, 0.02)
NOWHERE = (0.0, 0.0, 0.0)


@pytest.fixture
def job(loaded):
    return loaded.cell.job()


def found(plane):
    result = SpraySearchResult(Outcome.SUCCESS, Reason.NONE, 1.0, NOWHERE, NOWHERE[:2], 0, plane)
    return [StageRecord("spray_search", result, 0.0, 1.0)]


def proven(job, depth=0.02):
    tip = np.array(job.hole.centre) - depth * UP
    return Proof(True, tip, tip + job.peg.length * UP)


def away(proof, distance=0.08, hand=WIDE, switch=CLOSED):
    return LastLook(hand, proof.seated_hand + distance * UP, switch)


def judge(job, *, claim=Claim.INSERTED, proof=None, look=None, records=None, part=SEATED, ending=SUCCESS):
    proof = proven(job) if proof is None else proof
    plane = Plane(np.array(job.hole.centre), UP)
    look = away(proven(job)) if look is None else look
    return judged(claim, ending, found(plane) if records is None else records, proof, look, part, job)


def test_a_peg_seated_let_go_and_left_is_a_success(job):
    assert judge(job) is SUCCESS


@pytest.mark.parametrize("outcome", [Outcome.FAILURE, Outcome.ABORTED])
def test_what_is_no_success_stays_what_it_is(job, outcome):
    ending = Ending(outcome, "spiral_adjust", Reason.NOT_SEATED)
    assert judge(job, ending=ending, proof=Proof()) is ending


@pytest.mark.parametrize(("beyond", "is_seated"), [(-1e-5, True), (1e-5, False)])
@pytest.mark.parametrize(("side", "most"), [(-1.0, MOST_SHALLOW), (1.0, MOST_DEEP)])
def test_the_depth_is_that_of_a_seated_peg(job, side, most, beyond, is_seated):
    proof = proven(job, job.hole.depth + side * (most + beyond))
    if is_seated:
        assert judge(job, proof=proof) is SUCCESS
        return
    with pytest.raises(SwitchDisagreesError, match="switch closed with the tip"):
        judge(job, proof=proof)


@pytest.mark.parametrize("early", [0.0011, 0.004])
def test_a_switch_that_closes_more_than_a_millimetre_early_disagrees(job, early):
    with pytest.raises(SwitchDisagreesError, match=r"mm deep; 19\.0 to 22\.0 mm expected"):
        judge(job, proof=proven(job, job.hole.depth - early))


@pytest.mark.parametrize(("short", "is_believed"), [(DOUBTED - 1e-5, True), (DOUBTED + 1e-5, False)])
def test_a_peg_that_the_bottom_bears_may_seem_two_millimetres_short(job, short, is_believed):
    """Surface and tip are measured at two attitudes of the hand; what bears a push does not err with them."""
    proof = proven(job, job.hole.depth - short)
    proof = replace(proof, borne_tip=proof.seated_tip - 0.1e-3 * UP)
    if is_believed:
        assert judge(job, proof=proof) is SUCCESS
        return
    with pytest.raises(SwitchDisagreesError, match=r"18\.0 to 24\.0 mm expected"):
        judge(job, proof=proof)


@pytest.mark.parametrize(("deep", "is_believed"), [(CLOSED_TOLERANCE - 1e-5, True), (CLOSED_TOLERANCE + 1e-5, False)])
def test_a_peg_that_the_bottom_bears_may_have_been_pushed_up_in_the_hand(job, deep, is_believed):
    proof = proven(job, job.hole.depth + deep)
    proof = replace(proof, borne_tip=proof.seated_tip - 0.5e-3 * UP)
    if is_believed:
        assert judge(job, proof=proof) is SUCCESS
        return
    with pytest.raises(SwitchDisagreesError, match=r"18\.0 to 24\.0 mm expected"):
        judge(job, proof=proof)


@pytest.mark.parametrize("push", [0.0, 11.0])
@pytest.mark.parametrize(("beyond", "is_early"), [(-1e-5, False), (1e-5, True)])
def test_after_a_switch_closed_the_hand_sinks_by_what_soft_pads_give(job, push, beyond, is_early):
    gained = MOST_SHALLOW + GIVE * push + beyond
    proof = proven(job, job.hole.depth - 0.0015)
    proof = replace(proof, borne_tip=proof.seated_tip - gained * UP, footing=Footing(push=push))
    if not is_early:
        assert judge(job, proof=proof) is SUCCESS
        return
    with pytest.raises(SwitchDisagreesError, match=r"mm above the bottom that supported the peg"):
        judge(job, proof=proof)


def test_the_depth_is_counted_from_the_surface_that_the_search_felt(job):
    plane = Plane(np.array(job.hole.centre) + 0.003 * UP, UP)
    assert judge(job, records=found(plane), proof=proven(job, job.hole.depth - 0.003)) is SUCCESS


@pytest.mark.parametrize(("off", "is_plate"), [(PLANE_TOLERANCE - 1e-5, True), (PLANE_TOLERANCE + 1e-5, False)])
def test_a_felt_surface_that_is_not_the_plate_s_proves_nothing(job, off, is_plate):
    plane = Plane(np.array(job.hole.centre) + off * UP, UP)
    proof = proven(job, job.hole.depth - off)
    if is_plate:
        assert judge(job, records=found(plane), proof=proof) is SUCCESS
        return
    with pytest.raises(SuccessUnprovenError, match=r"the surface that was felt is 5\.0 mm off"):
        judge(job, records=found(plane), proof=proof)


def test_a_switch_that_was_never_open_proves_nothing(job):
    with pytest.raises(SuccessUnprovenError, match="never open"):
        judge(job, proof=replace(proven(job), was_open=False))


def test_a_switch_that_is_open_at_the_end_proves_nothing(job):
    with pytest.raises(SuccessUnprovenError, match="switch is open at the end"):
        judge(job, look=away(proven(job), switch=OPEN))


def test_a_switch_that_closed_without_a_peg_in_the_hand_proves_nothing(job):
    with pytest.raises(SuccessUnprovenError, match="while the hand held the peg"):
        judge(job, proof=Proof(True))


@pytest.mark.parametrize("hand", [CLOSED_HAND, GripperState(0.04, False, True), GripperState(0.008, False, False)])
def test_a_hand_that_is_not_open_proves_nothing(job, hand):
    with pytest.raises(SuccessUnprovenError, match="must be open and empty"):
        judge(job, look=away(proven(job), hand=hand))


@pytest.mark.parametrize(("distance", "is_gone"), [(AWAY + 1e-5, True), (AWAY - 1e-5, False)])
def test_the_hand_is_gone_from_the_peg(job, distance, is_gone):
    if is_gone:
        assert judge(job, look=away(proven(job), distance)) is SUCCESS
        return
    with pytest.raises(SuccessUnprovenError, match="at least 30 mm needed"):
        judge(job, look=away(proven(job), distance))


def test_a_release_of_a_peg_that_is_not_seated_is_a_failure(job):
    dropped = PartState(PartPlace.ON_PLATE, "fell from 100.0 mm above the plate")
    ending = judge(job, claim=Claim.LEFT, part=dropped)
    assert (ending.outcome, ending.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert judge(job, claim=Claim.LEFT) is SUCCESS


def test_a_grasp_holds_a_peg(job):
    held = PartState(PartPlace.IN_HAND, "hand grips 8.0 mm", True)
    assert judge(job, claim=Claim.HELD, part=held) is SUCCESS
    with pytest.raises(SuccessUnprovenError, match="is to hold a peg"):
        judge(job, claim=Claim.HELD, part=SEATED)


@pytest.mark.parametrize(
    ("place", "hand", "reason"),
    [
        (PartPlace.BIN, WIDE, Reason.NONE),
        (PartPlace.RACK, WIDE, Reason.NONE),
        (PartPlace.SEATED, WIDE, Reason.NONE),
        (PartPlace.ON_PLATE, WIDE, Reason.PART_LEFT),
        (PartPlace.IN_HOLE, WIDE, Reason.PART_LEFT),
        (PartPlace.UNKNOWN, WIDE, Reason.PART_LEFT),
        (PartPlace.IN_HAND, CLOSED_HAND, Reason.STILL_HELD),
    ],
)
def test_a_cell_is_free_with_an_open_hand_and_the_peg_where_it_may_stay(job, place, hand, reason):
    ending = judge(job, claim=Claim.FREED, part=PartState(place, ""), look=away(proven(job), hand=hand))
    assert ending.reason == reason
    assert ending.outcome is (Outcome.SUCCESS if reason is Reason.NONE else Outcome.FAILURE)


def test_a_switch_that_opens_again_takes_its_proof_back_while_the_hand_holds_the_peg(rig):
    ctx = rig.cell.context(0)
    rig.gripper.grip(30.0)
    proof = Proof()
    for switch, is_proven in ((CLOSED, False), (OPEN, False), (CLOSED, True), (OPEN, False), (CLOSED, True)):
        rig.switch.state = switch
        proof = proof.after(ctx.observe())
        assert (proof.seated_tip is not None) == is_proven
    rig.gripper.release(0.04)
    assert proof.after(ctx.observe()).seated_tip is not None


def test_the_proof_says_where_hand_and_peg_were_when_the_switch_closed_on_a_held_peg(rig):
    ctx = rig.cell.context(0)
    rig.gripper.grip(30.0)
    seated = ctx.observe()
    rig.switch.state = CLOSED
    proof = Proof(was_open=True).after(ctx.observe())
    rig.arm.tcp = replace(rig.arm.tcp, position=rig.arm.tcp.position + 0.05 * UP)
    proof = proof.after(ctx.observe())
    np.testing.assert_allclose(proof.seated_hand, seated.arm.tcp.position)
    np.testing.assert_allclose(proof.seated_tip, seated.tip)


def test_a_switch_that_was_open_before_the_hand_took_hold_was_open(rig):
    ctx = rig.cell.context(0)
    assert Proof().after(ctx.observe()).was_open is True


def test_a_switch_that_disagrees_is_told_with_the_depth_that_was_found_and_those_expected(job):
    with pytest.raises(SwitchDisagreesError, match=r"tip 15\.0 mm deep; 19\.0 to 22\.0 mm expected"):
        judge(job, proof=proven(job, 0.015))


# Exactly at a limit: a surface and a hole at the base's origin, where no length is rounded.


@pytest.fixture
def at_origin(job):
    return job.model_copy(update={"hole": job.hole.model_copy(update={"centre": (0.0, 0.0, 0.0)})})


def seated_at(job, depth, borne=None):
    """Return the proof of a switch that closed so deep, m, and of a bottom that bore the peg so deep."""
    return replace(proven(job, depth), borne_tip=None if borne is None else -borne * UP)


@pytest.mark.parametrize(("side", "most"), [(-1.0, MOST_SHALLOW), (1.0, MOST_DEEP)])
def test_a_peg_exactly_as_deep_as_it_may_be_is_seated(at_origin, side, most):
    assert judge(at_origin, proof=seated_at(at_origin, at_origin.hole.depth + side * most), claim=Claim.SEATED)


def test_a_switch_may_be_early_by_exactly_as_much_as_the_limit_says(at_origin):
    shallow = at_origin.model_copy(update={"hole": at_origin.hole.model_copy(update={"depth": DOUBTED})})
    assert judge(shallow, proof=seated_at(shallow, 0.0, borne=MOST_SHALLOW), claim=Claim.SEATED) is SUCCESS


def test_a_felt_surface_exactly_as_far_off_as_it_may_be_is_the_plate_s(at_origin):
    plane = Plane(PLANE_TOLERANCE * UP, UP)
    proof = seated_at(at_origin, at_origin.hole.depth - PLANE_TOLERANCE)
    assert judge(at_origin, records=found(plane), proof=proof, claim=Claim.SEATED) is SUCCESS


def test_a_hand_exactly_as_far_away_as_it_has_to_be_is_gone(job):
    proof = replace(proven(job), seated_hand=np.zeros(3))
    assert judge(job, proof=proof, look=LastLook(WIDE, AWAY * UP, CLOSED)) is SUCCESS


def test_a_hand_that_is_open_by_no_more_than_its_width_errs_may_hold_the_peg(job):
    hand = GripperState(job.peg.part.thickness + WIDTH_TOLERANCE, False, False)
    with pytest.raises(SuccessUnprovenError, match=r"the hand is 9\.5 mm open at the end"):
        judge(job, look=away(proven(job), hand=hand))


# Messages.


def test_depths_are_told_to_a_tenth_of_a_millimetre(at_origin):
    deep = at_origin.model_copy(update={"hole": at_origin.hole.model_copy(update={"depth": 0.06044})})
    with pytest.raises(SwitchDisagreesError, match=r"tip 40\.0 mm deep; 59\.4 to 62\.4 mm expected$"):
        judge(deep, proof=seated_at(deep, 0.04004))
    with pytest.raises(
        SwitchDisagreesError, match=r"closed 11\.0 mm above the bottom that supported the peg then; 1\.0 mm"
    ):
        judge(deep, proof=seated_at(deep, 0.05, borne=0.06104))


def test_what_is_not_proven_is_told_in_whole_words(job):
    for proof, words in (
        (Proof(), "the switch was never open in this run"),
        (Proof(True), "the switch did not close while the hand held the peg"),
    ):
        with pytest.raises(SuccessUnprovenError, match=f"^success is not proven: {words}$"):
            judge(job, proof=proof)


def test_a_hand_that_is_too_near_or_not_open_and_a_surface_too_far_off_are_told_with_their_lengths(job):
    with pytest.raises(SuccessUnprovenError, match=r"the hand is 60\.0 mm open at the end of the run"):
        judge(job, look=away(proven(job), hand=GripperState(0.06004, False, True)))
    with pytest.raises(SuccessUnprovenError, match="the hand is 29 mm from where it held the peg; at least 30 mm"):
        judge(job, look=away(proven(job), 0.02949))
    plane = Plane(np.array(job.hole.centre) + 0.06004 * UP, UP)
    with pytest.raises(SuccessUnprovenError, match=r"that was felt is 60\.0 mm off; 5 mm allowed"):
        judge(job, records=found(plane))


@pytest.mark.parametrize("hand", [WIDE, CLOSED_HAND])
def test_a_cell_that_is_not_freed_is_a_failure_of_the_stage_that_ended_it(job, hand):
    left = PartState(PartPlace.ON_PLATE, "")
    ending = judge(job, claim=Claim.FREED, part=left, look=away(proven(job), hand=hand))
    assert ending.stage == SUCCESS.stage


def pushed_down(rig, heights, push=2.0 * LEAST_PUSH):
    """Return the proof of a held, pushed peg whose switch closes after the first scan, after scans with its end so high, m, 0.01 s apart."""
    rig.gripper.grip(30.0)
    first, proof = rig.cell.context(0).observe(), Proof()
    for number, height in enumerate(heights):
        tip = first.tip + height * UP
        setpoint = ImpedanceSetpoint(1, tip - push / 1e3 * UP, UP, np.full(6, 1e3), np.ones(6), 1.0)
        switch = OPEN if number == 0 else CLOSED
        proof = proof.after(replace(first, stamp=0.01 * number, tip=tip, switch=switch), setpoint)
    return proof, first.tip[2]


BORNE_SCANS = round(BORNE_FOR / 0.01) + 3
"""Number of scans, with the first one of an open switch and one to spare, after which a peg that rests is borne."""


@pytest.mark.parametrize(("scans", "is_borne"), [(BORNE_SCANS - 2, False), (BORNE_SCANS, True)])
def test_a_peg_is_borne_where_it_has_rested_for_long_enough_under_a_push(rig, scans, is_borne):
    proof, ground = pushed_down(rig, [0.0] * scans)
    assert proof.seated_tip[2] == ground
    assert (proof.borne_tip is not None) == is_borne
    assert pushed_down(rig, [0.0] * scans, push=0.5 * LEAST_PUSH)[0].borne_tip is None


def test_what_bore_the_peg_first_is_its_bottom(rig):
    down = [0.0, *(-1e-3 for _ in range(BORNE_SCANS)), *(-3e-3 for _ in range(2 * BORNE_SCANS))]
    proof, ground = pushed_down(rig, down)
    assert proof.seated_tip[2] - ground == pytest.approx(-1e-3)
    assert proof.borne_tip[2] - ground == pytest.approx(-1e-3)
