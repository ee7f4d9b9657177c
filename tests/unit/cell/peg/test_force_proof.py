"""Force proves a success in a hole without a switch, and every part of the proof is needed."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble
from cell.peg.ending import Ending
from cell.peg.part_state import PartState
from cell.peg.success import AWAY, ForceProof, LastLook, Proof, evidence_for, judged
from drivers.errors import ConfigError, SuccessUnprovenError
from drivers.frames import UP
from drivers.quantities import GripperState, SwitchState
from plc_bridge.protocol.messages import PartPlace
from skills.contract import Outcome, Reason
from skills.entry import Claim
from skills.flow import StageRecord
from skills.search.spray_search import SpraySearchResult
from skills.search.surface import Plane
from skills.seating.decision import BORNE_WITHIN, DOUBTED, MOST_DEEP
from skills.seating.latch_likelihood import Signature
from skills.seating.signature import LIFTED, StrokeCurve
from tests.unit.skills.seating.test_latch import HELD, LATCH, lowered, pushing, scan

SETS = ("hole.latch={kind='detent',force=5.0,height=0.003}", "hole.evidence=force")
WIDE = GripperState(0.04, False, False)
SUCCESS = Ending(Outcome.SUCCESS, "release_and_retract", Reason.NONE)


@pytest.fixture
def job():
    return load(sets=SETS).cell.job()


def proven(job, depth=0.02):
    tip = np.array(job.hole.centre) - depth * UP
    return ForceProof(LATCH, StrokeCurve(), tip, tip + job.peg.length * UP, Signature(5.0, 0.0, 1e-6))


def judge(job, proof, away=0.08, hand=WIDE, claim=Claim.INSERTED):
    plane = Plane(np.array(job.hole.centre), UP)
    found = SpraySearchResult(Outcome.SUCCESS, Reason.NONE, 1.0, (0.0, 0.0, 0.0), (0.0, 0.0), 0, plane)
    place = proof.seated_hand if proof.seated_hand is not None else np.array(job.hole.centre)
    look = LastLook(hand, place + away * UP, SwitchState.OPEN)
    records = [StageRecord("spray_search", found, 0.0, 1.0)]
    return judged(claim, SUCCESS, records, proof, look, PartState(PartPlace.IN_HOLE, ""), job)


def test_the_recipe_chooses_the_evidence(job):
    assert isinstance(evidence_for(load().cell.hole), Proof)
    chosen = evidence_for(job.hole)
    assert isinstance(chosen, ForceProof)
    assert chosen.latch == LATCH


def test_a_switch_proves_nothing_if_force_is_required(job, seen):
    proof = evidence_for(job.hole)
    for stamp in range(40):
        proof = proof.after(replace(seen, switch=SwitchState.CLOSED, stamp=0.01 * stamp), pushing(seen))
    assert proof.seated_hand is None


def test_a_peg_that_is_drawn_out_again_voids_the_proof(seen):
    curve, now = lowered(seen)
    proof = ForceProof(LATCH, curve).after(scan(seen, 0.0, 11.0, now), pushing(seen))
    assert proof.seated_hand is not None
    assert proof.after(scan(seen, 0.9 * LIFTED, 0.0, now + 1.0)).seated_hand is proof.seated_hand
    assert proof.after(scan(seen, 0.1, 0.0, now + 1.0, WIDE)) is proof
    assert proof.after(scan(seen, 1.1 * LIFTED, 0.0, now + 1.0)).seated_hand is None


def test_force_as_evidence_needs_a_detent():
    with pytest.raises(ConfigError, match="no latch; a "):
        load(sets=["hole.evidence=force"])
    with pytest.raises(ConfigError, match='kind "press"'):
        load(sets=["hole.latch={kind='press',force=5.0,height=0.003}", "hole.evidence=force"])


def test_a_cell_without_a_switch_inserts_with_force_as_evidence():
    with pytest.raises(ConfigError, match=r'this cell has no switch \(switch.kind = "none"\); "force" allowed'):
        load(sets=["switch={kind='none'}"])
    cell = assemble(load(sets=[*SETS, "switch={kind='none'}"]).cell)
    assert cell.switch.read() is SwitchState.OPEN


@pytest.fixture
def seated(seen):
    """Return the proof of a peg that went through its latch and rests, and when it did."""
    curve, now = lowered(seen)
    return ForceProof(LATCH, curve).after(scan(seen, 0.0, 11.0, now), pushing(seen)), now


def test_the_proof_states_the_rest_and_the_force_of_the_latch(seated, seen):
    proof, _ = seated
    np.testing.assert_allclose(proof.seated_tip, seen.tip)
    assert proof.told.startswith("force: a detent of 5.")
    assert "N, 5 N stated" in proof.told


@pytest.mark.parametrize(
    ("risen", "is_seated"),
    [(LIFTED, True), (LIFTED + 1e-9, False), (-BORNE_WITHIN, True), (-BORNE_WITHIN - 1e-9, False)],
)
def test_a_seated_peg_may_rise_and_sink_up_to_its_limits(seated, seen, risen, is_seated):
    proof, now = seated
    proof = replace(proof, seated_hand=np.zeros(3))
    arm = replace(seen.arm, tcp=replace(seen.arm.tcp, position=risen * UP))
    later = proof.after(replace(seen, arm=arm, gripper=HELD, stamp=now + 1.0))
    assert (later.seated_hand is not None) == is_seated
    assert (later.latch, later.curve.heights != ()) == (LATCH, True)


def test_the_curve_continues_before_and_after_the_bottom(seated, seen):
    proof, now = seated
    sliding = replace(proof, seated_hand=proof.seated_hand - 0.001 * UP)
    deeper = sliding.after(scan(seen, -0.001, 0.0, now + 1.0))
    assert deeper.seated_hand is not None
    assert deeper.curve.heights[-1] < proof.curve.heights[-1]
    begun = ForceProof(LATCH).after(scan(seen, 0.01, 0.0, 0.0), pushing(seen))
    assert len(begun.curve.heights) == 1


@pytest.mark.parametrize(
    ("depth", "run", "words"),
    [
        (0.02, {}, ""),
        (None, {}, "force against depth did not show the latch with the bottom behind it while the hand held the peg"),
        (0.02 - DOUBTED - 1e-5, {}, "the peg rests 18.0 mm deep; 18.0 to 22.0 mm expected"),
        (0.02 + MOST_DEEP + 1e-5, {}, "mm deep"),
        (0.00104, {}, "rests 1.0 mm deep"),
        (0.02, {"hand": GripperState(0.008, True, False)}, "must be open and empty"),
        (0.02, {"away": AWAY - 1e-4}, "at least 30 mm needed"),
    ],
)
def test_latch_bottom_and_distant_hand_prove_a_success(job, depth, run, words):
    proof = ForceProof(LATCH) if depth is None else proven(job, depth)
    if not words:
        assert judge(job, proof, **run) is SUCCESS
        return
    with pytest.raises(SuccessUnprovenError, match=rf"^success is not proven: .*{words}.*$"):
        judge(job, proof, **run)


@pytest.mark.parametrize(("side", "most"), [(-1.0, DOUBTED), (1.0, MOST_DEEP)])
def test_a_peg_exactly_at_a_depth_limit_is_seated(job, side, most):
    tip = -(job.hole.depth + side * most) * UP
    look = LastLook(WIDE, tip, SwitchState.OPEN)
    ForceProof(LATCH, StrokeCurve(), tip, tip).require_seated(Plane(np.zeros(3), UP), look, job)


def test_an_earlier_stroke_without_the_bottom_counts(seen):
    denied, now = lowered(seen, shallow=0.001)
    proof = ForceProof(LATCH, denied).after(scan(seen, 2.0 * LIFTED, 0.0, now))
    shown, later = lowered(seen)
    again = replace(shown, earlier=proof.curve.earlier)
    resting = scan(seen, 0.0, 11.0, later)
    assert ForceProof(LATCH, again).after(resting, pushing(seen)).seated_hand is None
    assert ForceProof(LATCH, shown).after(resting, pushing(seen)).seated_hand is not None
