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
E = 1e-5
"""Beyond a limit, m."""


@pytest.fixture
def job(loaded):
    return loaded.cell.job()


def with_hole(job, **changes):
    return job.model_copy(update={"hole": job.hole.model_copy(update=changes)})


def proven(job, depth=0.02, borne=None, push=0.0):
    """Return the proof of a switch that closed so deep, m, and of a bottom so much deeper, m, under this push, N."""
    tip = np.array(job.hole.centre) - depth * UP
    borne_tip = None if borne is None else tip - borne * UP
    return Proof(True, tip, tip + job.peg.length * UP, footing=Footing(push=push), borne_tip=borne_tip)


def judge(
    job,
    *,
    claim=Claim.INSERTED,
    proof=None,
    hand=WIDE,
    distance=0.08,
    switch=CLOSED,
    felt=0.0,
    part=SEATED,
    ending=SUCCESS,
):
    """Judge a run whose search felt the plate so much too high, m, and whose hand ends so far from the peg, m."""
    plane = Plane(np.array(job.hole.centre) + felt * UP, UP)
    result = SpraySearchResult(Outcome.SUCCESS, Reason.NONE, 1.0, NOWHERE, NOWHERE[:2], 0, plane)
    look = LastLook(hand, proven(job).seated_hand + distance * UP, switch)
    records = [StageRecord("spray_search", result, 0.0, 1.0)]
    return judged(claim, ending, records, proof or proven(job), look, part, job)


def fault(job, **run):
    """Return the fault that a run is judged to be, with its message, or an empty text if it is a success."""
    try:
        assert judge(job, **run) is SUCCESS
    except (SuccessUnprovenError, SwitchDisagreesError) as error:
        return f"{type(error).__name__}: {error}"
    return ""


@pytest.mark.parametrize("outcome", [Outcome.FAILURE, Outcome.ABORTED])
def test_an_ending_without_success_needs_no_proof(job, outcome):
    ending = Ending(outcome, "spiral_adjust", Reason.NOT_SEATED)
    assert judge(job, ending=ending, proof=Proof()) is ending


@pytest.mark.parametrize(
    ("deeper", "borne", "push", "words"),
    [
        (-MOST_SHALLOW - E, None, 0.0, "switch closed with the tip 19.0 mm deep; 19.0 to 22.0 mm expected"),
        (-0.004, None, 0.0, "tip 16.0 mm deep; 19.0 to 22.0 mm expected"),
        (MOST_DEEP + E, None, 0.0, "19.0 to 22.0 mm expected"),
        # Surface and tip are measured at two attitudes of the hand; what bears a push does not err with them.
        (-DOUBTED - E, 0.1e-3, 0.0, "18.0 to 24.0 mm expected"),
        # A push may have moved the peg up in the hand.
        (CLOSED_TOLERANCE - E, 0.5e-3, 0.0, ""),
        (CLOSED_TOLERANCE + E, 0.5e-3, 0.0, "18.0 to 24.0 mm expected"),
        # The switch is early by what the peg gains after it closed, beyond the give of soft pads.
        (-0.0015, MOST_SHALLOW + E, 0.0, "closed 1.0 mm above the bottom that later supported the peg; 1.0 mm"),
        (-0.0015, MOST_SHALLOW + 11.0 * GIVE - E, 11.0, ""),
        (-0.0015, MOST_SHALLOW + 11.0 * GIVE + E, 11.0, "closed 3.2 mm above the bottom that later supported the peg"),
    ],
)
def test_the_switch_closes_at_the_depth_of_a_seated_peg(job, deeper, borne, push, words):
    told = fault(job, proof=proven(job, job.hole.depth + deeper, borne, push))
    assert (told == "") is (words == "")
    assert words in told
    assert told.startswith("SwitchDisagreesError: " if words else "")


@pytest.mark.parametrize(
    ("run", "words"),
    [
        ({"felt": 0.003, "proof": 0.017}, ""),
        (
            {"felt": PLANE_TOLERANCE + E, "proof": 0.02 - PLANE_TOLERANCE},
            "the measured surface is 5.0 mm from the plate's; 5 mm allowed",
        ),
        ({"felt": 0.06004}, "the measured surface is 60.0 mm from the plate's; 5 mm allowed"),
        ({"proof": Proof()}, "the switch was never open in this run"),
        ({"proof": Proof(True)}, "the switch did not close while the hand held the peg"),
        ({"switch": OPEN}, "switch is open at the end"),
        ({"hand": CLOSED_HAND}, "must be open and empty"),
        ({"hand": GripperState(0.06004, False, True)}, "the hand is 60.0 mm open at the end of the run"),
        ({"hand": GripperState(0.008, False, False)}, "must be open and empty"),
        ({"hand": GripperState(0.008 + WIDTH_TOLERANCE, False, False)}, "the hand is 9.5 mm open at the end"),
        ({"distance": 0.02949}, "the hand is 29 mm from where it held the peg; at least 30 mm needed"),
        ({"distance": AWAY - E}, "at least 30 mm needed"),
    ],
)
def test_an_insertion_is_proven_by_surface_switch_and_hand(job, run, words):
    if isinstance(run.get("proof"), float):
        run = {**run, "proof": proven(job, run["proof"])}
    told = fault(job, **run)
    assert (told == "") is (words == "")
    assert words in told
    assert told.startswith("SuccessUnprovenError: success is not proven: " if words else "")


def test_lengths_are_reported_to_a_tenth_of_a_millimetre(job):
    deep = with_hole(job, centre=NOWHERE, depth=0.06044)
    assert fault(deep, proof=proven(deep, 0.04004)).endswith("tip 40.0 mm deep; 59.4 to 62.4 mm expected")
    told = fault(deep, proof=proven(deep, 0.05, borne=0.01104))
    assert "closed 11.0 mm above the bottom that later supported the peg; 1.0 mm" in told


# Exactly at a limit: a surface and a hole at the base's origin, where no length is rounded.


@pytest.mark.parametrize(
    ("hole_depth", "depth", "borne", "felt"),
    [
        (0.02, 0.02 - MOST_SHALLOW, None, 0.0),
        (0.02, 0.02 + MOST_DEEP, None, 0.0),
        (DOUBTED, 0.0, MOST_SHALLOW, 0.0),
        (0.02, 0.02 - PLANE_TOLERANCE, None, PLANE_TOLERANCE),
    ],
)
def test_depth_and_surface_are_accepted_exactly_at_their_limits(job, hole_depth, depth, borne, felt):
    job = with_hole(job, centre=NOWHERE, depth=hole_depth)
    assert fault(job, proof=proven(job, depth, borne), felt=felt, claim=Claim.SEATED) == ""


def test_a_hand_exactly_at_the_least_distance_is_gone(job):
    proof = replace(proven(job), seated_hand=np.zeros(3))
    assert judged(Claim.INSERTED, SUCCESS, [], proof, LastLook(WIDE, AWAY * UP, CLOSED), SEATED, job) is SUCCESS


# Other claims.


@pytest.mark.parametrize(
    ("claim", "place", "hand", "reason"),
    [
        (Claim.LEFT, PartPlace.SEATED, WIDE, Reason.NONE),
        (Claim.LEFT, PartPlace.ON_PLATE, WIDE, Reason.NOT_SEATED),
        (Claim.FREED, PartPlace.BIN, WIDE, Reason.NONE),
        (Claim.FREED, PartPlace.RACK, WIDE, Reason.NONE),
        (Claim.FREED, PartPlace.SEATED, WIDE, Reason.NONE),
        (Claim.FREED, PartPlace.ON_PLATE, WIDE, Reason.PART_LEFT),
        (Claim.FREED, PartPlace.IN_HOLE, WIDE, Reason.PART_LEFT),
        (Claim.FREED, PartPlace.UNKNOWN, WIDE, Reason.PART_LEFT),
        (Claim.FREED, PartPlace.IN_HAND, CLOSED_HAND, Reason.STILL_HELD),
    ],
)
def test_a_freed_cell_has_an_open_hand_and_a_resolved_peg(job, claim, place, hand, reason):
    ending = judge(job, claim=claim, part=PartState(place, ""), hand=hand)
    outcome = Outcome.SUCCESS if reason is Reason.NONE else Outcome.FAILURE
    assert (ending.outcome, ending.reason, ending.stage) == (outcome, reason, SUCCESS.stage)


def test_a_grasp_holds_a_peg(job):
    assert fault(job, claim=Claim.HELD, part=PartState(PartPlace.IN_HAND, "hand grips 8.0 mm", True)) == ""
    assert "must hold a peg" in fault(job, claim=Claim.HELD)


# The proof, scan by scan.


def test_a_switch_that_opens_under_a_held_peg_voids_the_proof(rig):
    ctx, proof = rig.cell.context(0), Proof()
    rig.gripper.grip(30.0)
    for switch, is_proven in ((CLOSED, False), (OPEN, False), (CLOSED, True), (OPEN, False), (CLOSED, True)):
        rig.switch.state = switch
        proof = proof.after(ctx.observe())
        assert (proof.seated_tip is not None) == is_proven
    rig.gripper.release(0.04)
    assert proof.after(ctx.observe()).seated_tip is not None


def test_the_proof_keeps_the_pose_at_which_the_switch_closed(rig):
    ctx = rig.cell.context(0)
    proof = Proof().after(ctx.observe())
    assert proof.was_open is True  # before the hand took hold
    rig.gripper.grip(30.0)
    seated = ctx.observe()
    rig.switch.state = CLOSED
    proof = proof.after(ctx.observe())
    rig.arm.tcp = replace(rig.arm.tcp, position=rig.arm.tcp.position + 0.05 * UP)
    proof = proof.after(ctx.observe())
    np.testing.assert_allclose(proof.seated_hand, seated.arm.tcp.position)
    np.testing.assert_allclose(proof.seated_tip, seated.tip)


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


@pytest.mark.parametrize(
    ("scans", "push", "is_borne"), [(BORNE_SCANS - 2, 2.0, False), (BORNE_SCANS, 2.0, True), (BORNE_SCANS, 0.5, False)]
)
def test_the_bottom_supports_a_peg_that_rests_under_a_push(rig, scans, push, is_borne):
    proof, ground = pushed_down(rig, [0.0] * scans, push * LEAST_PUSH)
    assert proof.seated_tip[2] == ground
    assert (proof.borne_tip is not None) == is_borne


def test_the_first_support_is_the_bottom(rig):
    down = [0.0, *(-1e-3 for _ in range(BORNE_SCANS)), *(-3e-3 for _ in range(2 * BORNE_SCANS))]
    proof, ground = pushed_down(rig, down)
    assert proof.seated_tip[2] - ground == pytest.approx(-1e-3)
    assert proof.borne_tip[2] - ground == pytest.approx(-1e-3)
