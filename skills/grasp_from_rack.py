"""Take the peg from a rack slot: come from above, close with a set force, draw the peg out, and make sure that it came
along.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.errors import SkinUntrustedError
from drivers.frames import UP, angle_between
from drivers.quantities import Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Goal, Transfer, Trim, move, stay
from skills.tactile.order import PrintOrder
from skills.tactile.steady import GraspPrint

ACROSS_RACK: Vector = np.array([0.0, -1.0, 0.0])
"""Direction of the closing axis at the rack, base frame; always the same, so that the wrist does not wind up from run
to run.
"""

CENTRED = (2e-4, math.radians(0.2))
"""Error of the hand's place, m, and of its directions, rad, below which it closes. Source: docs/tried/grasp.md."""
RESTING = 2e-3
"""Speed of the hand below which it counts as at rest, m/s; a hand that breaks loose from friction passes the slot."""
CENTRING_TIME = 2.0
"""Longest time to centre the hand on the slot, s."""
NEAR = (1e-3, math.radians(1.0))
"""Error of the hand's place, m, and of its directions, rad, beyond which it does not close: the slot leaves no more.
Source: docs/tried/grasp.md.
"""
TRIM = Trim(rate=6.0, limit=0.01)
"""Integral that trims the hand's place over the slot, along each axis."""
INTEGRAL_GAIN, INTEGRAL_LIMIT = 300.0, 6.0
"""Integral gain of the arm's orientation over the slot, N·m/(rad·s), and its saturation, N·m."""
DRAWING_SPEED = 0.05
"""Speed at which the peg leaves the slot, m/s; a peg that rubs in the slot is drawn through the pads at higher speeds.
Source: docs/tried/grasp.md.
"""
PRINT_TIME = 5.0
"""Longest wait for the frames that tell whether the skin shows the peg, s; a skin at 10 Hz tells within 0.9 s, a silent one is a fault before."""
DRAWING_TIME = 2.0
"""Time added to what the drawing speed takes before the draw is given up, s."""


class GraspFromRackParams(SkillParams):
    """How to take a peg from the rack.

    Source: chosen, not measured.
    """

    transfer: Transfer
    """How the hand goes to the slot and away from it."""
    force: Annotated[float, Field(gt=0.0, le=70.0)]
    """Grip force, N."""
    pad_friction: Annotated[float, Field(gt=0.0, le=2.0)] = 0.3
    """Least Coulomb coefficient of peg on pads that is believed, ratio; with the grip force it bounds every push. Source: assumed.
    """
    grip_margin: Annotated[float, Field(ge=1.0, le=10.0)] = 1.4375
    """Factor by which grip force times friction may fall short of what is stated, ratio; pushes stay below what the pads then bear.
    Source: docs/tried/search.md.
    """
    opening: Annotated[float, Field(gt=0.0, le=0.08)]
    """Distance between the pads on the way down, m."""
    clearance: Annotated[float, Field(gt=0.0, le=0.3)]
    """Height of the fingers' way above the slot, m; the peg is lifted by as much."""
    closing_time: Annotated[float, Field(gt=0.0, le=10.0)]
    """Longest time for the fingers to close, s."""
    width_tolerance: Annotated[float, Field(gt=0.0, le=0.005)]
    """Largest difference between the pads' distance and the peg's width between them, m."""


@dataclass(frozen=True, slots=True)
class GraspFromRackResult(SkillResult):
    """What the hand holds."""

    width: float
    """Distance between the pads at the end, m."""
    theta: float
    """In-hand angle after the lift, rad."""


def run(params: GraspFromRackParams, ctx: SkillContext) -> GraspFromRackResult:
    """Take the peg from the job's slot and make sure that it is held."""
    started = ctx.clock.now()
    job = ctx.job
    slot = np.array(job.rack.first) + np.array([0.0, job.rack.pitch * (job.slot % job.rack.slots), 0.0])
    # The peg stands on the slot's floor, so that the finger centre goes to `length` above that floor.
    grip_at = slot + UP * (job.peg.length - job.rack.depth)

    ctx.gripper.release(params.opening)
    ctx.peg = ctx.peg.grasped_anew()
    above = Goal(grip_at + UP * params.clearance, UP, ACROSS_RACK)
    _rise(above.tip[2], params, ctx)
    for _ in move(above, params.transfer, ctx, None):
        pass
    for _ in move(Goal(grip_at, UP, ACROSS_RACK), params.transfer, ctx, None, settle=0.0):
        pass
    centring = Centring(grip_at, ctx)
    for seen in ctx.scan(CENTRING_TIME):
        if centring.follow(seen, CENTRED):
            break
    if not (centring.is_within(NEAR) and _close(params, centring, ctx)):
        return _missed(params, ctx, started, Reason.MISSED_GRASP)
    _require_print(params, ctx)
    _draw_out(grip_at[2] + job.rack.depth, ctx)
    for _ in move(above, params.transfer, ctx, None):
        pass
    if not _holds_peg(params, ctx):
        return _missed(params, ctx, started, Reason.LOST_GRASP)
    ctx.zero_wrench()
    seen = ctx.observe()
    return GraspFromRackResult(
        Outcome.SUCCESS, Reason.NONE, ctx.clock.now() - started, seen.gripper.width, seen.peg.theta
    )


def _rise(height: float, params: GraspFromRackParams, ctx: SkillContext) -> None:
    """Rise straight up to `height`, m, base frame, where a fault left the hand lower: it would sweep over the plate as it turns."""
    hand = ctx.observe().arm.tcp
    if hand.position[2] >= height:
        return
    up = np.array([*hand.position[:2], height])
    for _ in move(Goal(up, -hand.rotation[:, 0], hand.rotation[:, 2]), params.transfer, ctx, None, limited=False):
        pass


class Centring:
    """Brings the open hand to the slot, from which friction in the joints holds it off, and keeps it there
    while it closes.

    A peg that is gripped aslant jams in the slot. The setpoint that is left behind balances the joints' friction.
    """

    def __init__(self, grip_at: Vector, ctx: SkillContext) -> None:
        """Begin from the setpoint that is held, towards `grip_at`, shape (3,), m, base frame."""
        assert ctx.held is not None
        self._ctx, self._grip_at, self._trims = ctx, grip_at, [TRIM] * 3
        self._held = replace(
            ctx.held,
            id=ctx.new_id(),
            twist=None,
            is_free=False,  # from here to the end of the slot, peg and rack may touch
            integral_gain=INTEGRAL_GAIN,
            integral_limit=INTEGRAL_LIMIT,
        )
        self._off, self._aslant, self._speed = np.full(3, math.inf), math.inf, math.inf

    def follow(self, seen: Observation, near: tuple[float, float]) -> bool:
        """Take one scan; return whether the hand rests as near as `near`, m and rad."""
        hand, before = seen.arm.tcp, self._off
        self._off = self._grip_at - hand.position
        self._speed = float(np.abs(self._off - before).max()) / seen.step
        self._aslant = max(angle_between(-hand.rotation[:, 0], UP), angle_between(hand.rotation[:, 2], ACROSS_RACK))
        self._trims = [trim.after(float(error), seen.step) for trim, error in zip(self._trims, self._off, strict=True)]
        tip = self._grip_at + np.array([trim.value for trim in self._trims])
        self._held = replace(self._held, tip=tip, valid_until=seen.stamp + VALIDITY)
        self._ctx.follow(self._held)
        return self.is_within(near) and self._speed < RESTING

    def is_within(self, near: tuple[float, float]) -> bool:
        """Return whether the hand was as near as `near`, m and rad, at the last scan."""
        return float(np.abs(self._off).max()) < near[0] and self._aslant < near[1]

    def freeze(self) -> None:
        """Leave the setpoint as it is."""
        self._ctx.follow(replace(self._held, integral_gain=0.0))


def _close(params: GraspFromRackParams, centring: Centring, ctx: SkillContext) -> bool:
    """Close the hand, which is centred all the while; return whether it holds a peg."""
    ctx.gripper.grip(params.force)
    for seen in ctx.scan(params.closing_time):
        if seen.gripper.is_gripping or not seen.gripper.is_moving:
            break
        centring.follow(seen, CENTRED)
    centring.freeze()
    return _holds_peg(params, ctx)


def _require_print(params: GraspFromRackParams, ctx: SkillContext) -> None:
    """Make sure that the skin shows the grasp's own print while the peg still stands in its slot; otherwise let go of it there.

    Raises:
        SkinUntrustedError: It does not. Modules that are dead, stuck below the rail, in each other's places or tell anything at random
            are found here, before the peg is moved.
    """
    shown, order = GraspPrint(), PrintOrder(ctx.estimator)
    for seen in ctx.scan(PRINT_TIME):
        stay(ctx, seen.stamp)
        if seen.is_new_frame:
            shown.take(seen.frame, seen.peg.healthy and seen.peg.stamp >= seen.frame.stamp)
            order.take(seen.frame)
        if shown.is_judged:
            break
    try:
        shown.require()
        order.require()
    except SkinUntrustedError:
        ctx.gripper.release(params.opening)
        raise


def _draw_out(height: float, ctx: SkillContext) -> None:
    """Rise from the held setpoint until the finger centre is at `height`, m, base frame, where the peg's end has left
    the slot.
    """
    held = ctx.held
    assert held is not None
    twist = Twist(UP * DRAWING_SPEED, np.zeros(3))
    for seen in ctx.scan(DRAWING_TIME * (height - held.tip[2]) / DRAWING_SPEED):
        if seen.arm.tcp.position[2] >= height:
            break
        tip = held.tip + twist.linear * seen.elapsed
        ctx.follow(replace(held, tip=tip, twist=twist, valid_until=seen.stamp + VALIDITY))


def _holds_peg(params: GraspFromRackParams, ctx: SkillContext) -> bool:
    hand = ctx.read_hand()
    return hand.is_gripping and abs(hand.width - ctx.job.peg.part.thickness) <= params.width_tolerance


def _missed(params: GraspFromRackParams, ctx: SkillContext, started: float, reason: Reason) -> GraspFromRackResult:
    seen = ctx.observe()
    ctx.gripper.release(params.opening)
    return GraspFromRackResult(Outcome.FAILURE, reason, ctx.clock.now() - started, seen.gripper.width, seen.peg.theta)
