"""The one gate for success: the evidence that a run needs before the supervisor reports success; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cell.peg.ending import Ending
from cell.peg.part_state import UNRESOLVED, PartState
from drivers.errors import CellError, SuccessUnprovenError, SwitchDisagreesError
from drivers.parts import Hole, Job, Latch
from drivers.quantities import GripperState, ImpedanceSetpoint, SwitchState, Vector
from plc_bridge.protocol.messages import PartPlace
from skills.contract import Observation, Outcome, Reason
from skills.entry import Claim
from skills.flow import StageRecord
from skills.search.surface import Plane, nominal
from skills.seating.decision import BORNE_WITHIN, CLOSED_TOLERANCE, DOUBTED, GIVE, MOST_DEEP, MOST_SHALLOW, Footing
from skills.seating.latch_likelihood import Signature
from skills.seating.signature import LIFTED, StrokeCurve

PLANE_TOLERANCE = 0.005
"""Largest distance of the measured surface from the job's plate surface, m."""
AWAY = 0.03
"""Least distance of the retracted hand from its position when the peg was seated, m."""


@dataclass(frozen=True, slots=True, eq=False)
class LastLook:
    """Readings of the devices when the arm is at rest after a run."""

    hand: GripperState
    tcp: Vector
    """Position of the finger centre, shape (3,), m, base frame."""
    switch: SwitchState


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """Evidence of a run so far, in a hole with a switch."""

    was_open: bool = False
    """True if the switch was open at some time of the run."""
    seated_tip: Vector | None = None
    """Position of the held peg's end when the open switch closed, shape (3,), m, base frame."""
    seated_hand: Vector | None = None
    """Position of the hand when the open switch closed, shape (3,), m, base frame."""
    footing: Footing = field(default_factory=Footing)
    """Contact of the held peg with the bottom while the switch is closed."""
    borne_tip: Vector | None = None
    """Position of the held peg's end when the bottom had supported it for long enough, shape (3,), m, base frame."""

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None = None) -> "Proof":
        """Return the proof after one more scan and its setpoint; if the switch opens while the peg is held, the proof is void."""
        if seen.switch is SwitchState.OPEN:
            is_kept = self.was_open and (self.seated_tip is None or not seen.gripper.is_gripping)
            return self if is_kept else Proof(was_open=True)
        if not self.was_open or seen.switch is not SwitchState.CLOSED or not seen.gripper.is_gripping:
            return self
        footing = self.footing.after(seen, setpoint)
        if self.seated_tip is None:
            return Proof(True, seen.tip.copy(), seen.arm.tcp.position.copy(), footing)
        if self.borne_tip is None and footing.is_firm(seen.stamp):
            return replace(self, footing=footing, borne_tip=seen.tip.copy())
        return replace(self, footing=footing)

    @property
    def told(self) -> str:
        """Evidence in words for the record of a success; empty without proof."""
        return "" if self.seated_tip is None else "switch"

    def require_seated(self, plane: Plane | None, look: LastLook, job: Job) -> None:
        """Require that the switch closed under a held peg at the hole's depth and is still closed.

        Raises:
            SuccessUnprovenError: The evidence is missing.
            SwitchDisagreesError: The switch closed while the peg's end was not at the seated depth.
        """
        if not self.was_open:
            raise _unproven("the switch was never open in this run")
        if look.switch is not SwitchState.CLOSED:
            raise _unproven(f"the switch is {look.switch} at the end of the run; closed needed")
        if self.seated_tip is None:
            raise _unproven("the switch did not close while the hand held the peg")
        surface, less, more = nominal(job.hole), CLOSED_TOLERANCE, CLOSED_TOLERANCE
        if plane is not None:
            surface, less, more = plane, MOST_SHALLOW, MOST_DEEP
        depth, low, high = surface.depth(self.seated_tip), job.hole.depth - less, job.hole.depth + more
        if plane is not None and self.borne_tip is not None:
            low, high = job.hole.depth - DOUBTED, job.hole.depth + CLOSED_TOLERANCE
            # The hand sinks further in soft pads while the bottom already supports the peg.
            gained, most = surface.depth(self.borne_tip) - depth, MOST_SHALLOW + GIVE * self.footing.push
            if gained > most:
                raise SwitchDisagreesError(
                    f"switch closed {1e3 * gained:.1f} mm above the bottom that later supported the peg; {1e3 * most:.1f} mm allowed"
                )
        if not low <= depth <= high:
            raise SwitchDisagreesError(
                f"switch closed with the tip {1e3 * depth:.1f} mm deep; {1e3 * low:.1f} to {1e3 * high:.1f} mm expected"
            )


@dataclass(frozen=True, slots=True, eq=False)
class ForceProof:
    """Evidence of a run so far, in a hole without a switch: the force of its latch, and the bottom behind it."""

    latch: Latch
    """The latch as the recipe states it."""
    curve: StrokeCurve = field(default_factory=StrokeCurve)
    """Force against depth of the held peg."""
    seated_tip: Vector | None = None
    """Position of the held peg's end when it rested behind its latch, shape (3,), m, base frame."""
    seated_hand: Vector | None = None
    """Position of the hand when the peg rested there, shape (3,), m, base frame."""
    found: Signature | None = None
    """Signature of the latch in the curve before the peg rested."""

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None = None) -> "ForceProof":
        """Return the proof after one more scan and its setpoint; if the hand later sinks, or lifts the held peg, the proof is void."""
        if self.seated_hand is not None and not seen.gripper.is_gripping:
            return self
        curve = self.curve.after(seen, setpoint, self.latch)
        if self.seated_hand is not None:
            risen = float(seen.arm.tcp.position[2] - self.seated_hand[2])
            # If it yields, it was not the bottom.
            return replace(self, curve=curve) if -BORNE_WITHIN <= risen <= LIFTED else ForceProof(self.latch, curve)
        found = curve.signature(self.latch, seen.stamp)
        if found is None or not found.is_sure:
            return replace(self, curve=curve)
        return ForceProof(self.latch, curve, seen.tip.copy(), seen.arm.tcp.position.copy(), found)

    def require_seated(self, plane: Plane | None, look: LastLook, job: Job) -> None:
        """Require that the held peg passed its latch and then rested at the hole's depth.

        Raises:
            SuccessUnprovenError: The evidence is missing.
        """
        if self.seated_tip is None:
            raise _unproven(
                "force against depth did not show the latch with the bottom behind it while the hand held the peg"
            )
        surface, less, more = nominal(job.hole), CLOSED_TOLERANCE, CLOSED_TOLERANCE
        if plane is not None:
            surface, less, more = plane, DOUBTED, MOST_DEEP
        depth, low, high = surface.depth(self.seated_tip), job.hole.depth - less, job.hole.depth + more
        if not low <= depth <= high:
            raise _unproven(f"the peg rests {1e3 * depth:.1f} mm deep; {1e3 * low:.1f} to {1e3 * high:.1f} mm expected")

    @property
    def told(self) -> str:
        """Evidence in words for the record of a success; empty without proof."""
        if self.found is None:
            return ""
        force, offset = self.found.force, 1e3 * self.found.offset
        return f"force: a {self.latch.kind} of {force:.1f} N, {self.latch.force:g} N stated, {offset:+.1f} mm off its place"


SeatingProof = Proof | ForceProof
"""Evidence that the peg is seated; depth counts from the surface that the search measured, else from the job's."""


def evidence_for(hole: Hole) -> SeatingProof:
    """Return evidence of the kind that the hole's recipe requires, still empty, for the start of a run."""
    return ForceProof(hole.latch) if hole.evidence == "force" and hole.latch is not None else Proof()


def judged(
    claim: Claim,
    ending: Ending,
    records: Sequence[StageRecord],
    proof: SeatingProof,
    look: LastLook,
    part: PartState,
    job: Job,
) -> Ending:
    """Return the ending of a run, judged by the evidence.

    Args:
        claim: Meaning of the program's success.
        ending: Ending as the skills reported it.
        records: Stages of the run.
        proof: Evidence collected in the run.
        look: Readings of the devices at the end.
        part: Place of the peg at the end.
        job: The part and its place.

    Raises:
        SuccessUnprovenError: The skills report success without the required evidence.
        SwitchDisagreesError: The switch closed while the peg's end was not at the seated depth.
    """
    if ending.outcome is not Outcome.SUCCESS:
        return ending
    if claim is Claim.FREED:
        return _freed(ending, look, part, job)
    if claim is Claim.HELD and not part.is_held:
        raise _unproven(f"the hand must hold a peg; found {part.evidence}")
    if claim in (Claim.SEATED, Claim.INSERTED):
        proof.require_seated(_plane(records, job), look, job)
    if claim is Claim.INSERTED:
        _require_gone(proof, look, job)
    if claim is Claim.LEFT and part.place is not PartPlace.SEATED:
        return Ending(Outcome.FAILURE, ending.stage, Reason.NOT_SEATED)
    return ending


def _freed(ending: Ending, look: LastLook, part: PartState, job: Job) -> Ending:
    if not look.hand.is_open(job.peg.part.thickness):
        return Ending(Outcome.FAILURE, ending.stage, Reason.STILL_HELD)
    if part.place in UNRESOLVED:
        return Ending(Outcome.FAILURE, ending.stage, Reason.PART_LEFT)
    return ending


def _require_gone(proof: SeatingProof, look: LastLook, job: Job) -> None:
    if not look.hand.is_open(job.peg.part.thickness):
        raise _unproven(
            f"the hand is {1e3 * look.hand.width:.1f} mm open at the end of the run and must be open and empty"
        )
    assert proof.seated_hand is not None
    away = math.dist(look.tcp, proof.seated_hand)
    if not away >= AWAY:
        raise _unproven(
            f"the hand is {1e3 * away:.0f} mm from where it held the peg; at least {1e3 * AWAY:.0f} mm needed"
        )


def _plane(records: Sequence[StageRecord], job: Job) -> Plane | None:
    """Return the surface measured by the run's last search; None without a search.

    Raises:
        SuccessUnprovenError: The surface is farther than `PLANE_TOLERANCE` from the plate's.
    """
    felt = [plane for record in records if isinstance(plane := getattr(record.result, "plane", None), Plane)]
    if not felt:
        return None
    plane = felt[-1]
    off = abs(plane.depth(np.array(job.hole.centre)))
    if not off <= PLANE_TOLERANCE:
        raise _unproven(
            f"the measured surface is {1e3 * off:.1f} mm from the plate's; {1e3 * PLANE_TOLERANCE:.0f} mm allowed"
        )
    return plane


def _unproven(what: str) -> CellError:
    return SuccessUnprovenError(f"success is not proven: {what}")
