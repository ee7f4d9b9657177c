"""Take the peg from a rack slot: approach from above, close with a set force, draw the peg out, check that it is held."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from drivers.config_model import Figure, Quantity, Source, Tempo
from drivers.errors import SkinUntrustedError
from drivers.frames import UP, angle_between
from drivers.quantities import Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.held_peg import HeldPeg
from skills.motion import VALIDITY, Goal, Transfer, move, stay
from skills.release_and_retract import HAND_TIME
from skills.tactile.order import PrintOrder
from skills.tactile.steady import GraspPrint

ACROSS_RACK: Vector = np.array([0.0, -1.0, 0.0])
"""Direction of the closing axis at the rack, base frame; it is constant so that the wrist does not wind up over the runs."""


class GraspFromRackParams(SkillParams):
    """Parameters of taking a peg from the rack."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    transfer: Annotated[Transfer, Figure(""), Field(exclude=True)] = Transfer()
    """Motion of the hand to the slot and away from it."""
    force: Annotated[float, Field(gt=0.0, le=70.0), Quantity("N")]
    """Grip force, N."""
    pad_friction: Annotated[float, Field(gt=0.0, le=2.0), Quantity("ratio"), Source("assumed")] = 0.3
    """Assumed least Coulomb coefficient of peg on pads, ratio; with the grip force it bounds every push."""
    grip_margin: Annotated[float, Figure("ratio"), Field(exclude=True), Source("docs/tried/search.md")] = 1.4375
    """Safety factor on grip force times friction, ratio; pushes stay below the load that the pads bear with it."""
    opening: Annotated[float, Field(gt=0.0, le=0.08), Quantity("m")]
    """Distance between the pads during the approach, m."""
    clearance: Annotated[float, Field(gt=0.0, le=0.3), Quantity("m")]
    """Height of the fingers above the slot before and after the grasp, m."""
    width_tolerance: Annotated[float, Field(gt=0.0, le=0.005), Quantity("m")]
    """Largest difference between the pads' distance and the peg's width between them, m."""
    drawing_speed: Annotated[float, Figure("m/s", Tempo.SPEED), Field(exclude=True), Source("docs/tried/grasp.md")] = (
        0.05
    )
    """Speed at which the peg leaves the slot, m/s; at higher speeds a peg that rubs in the slot slips between the pads."""
    drawing_time: Annotated[float, Figure("multiple"), Field(exclude=True)] = 2.0
    """Time limit of the draw, multiple of its time at the drawing speed."""
    centred: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/grasp.md")] = 2e-4
    """Error of the hand's position over the slot below which it closes at once, m."""
    upright: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/grasp.md")] = math.radians(0.2)
    """Error of the hand's directions below which it closes at once, rad."""
    near: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/grasp.md")] = 1e-3
    """Largest error of the hand's position for closing, m: the clearance of the slot."""
    askew: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/grasp.md")] = math.radians(1.0)
    """Largest error of the hand's directions for closing, rad."""
    resting: Annotated[float, Figure("m/s"), Field(exclude=True)] = 2e-3
    """Speed of the hand below which it is at rest, m/s; when static friction releases, a moving hand overshoots the slot."""
    centring_time: Annotated[float, Figure("s"), Field(exclude=True)] = 2.0
    """Longest time to centre the hand on the slot, s."""
    proportion: Annotated[float, Figure("ratio"), Field(exclude=True), Source("docs/tried/grasp.md")] = 1.4
    """Proportional gain of the position setpoint over the slot, ratio. The hand follows its setpoint there with a lag of
    0.12 s = `proportion` / `trim_rate`, which this zero cancels.
    """
    trim_rate: Annotated[float, Figure("1/s"), Field(exclude=True), Source("docs/tried/grasp.md")] = 12.0
    """Integral rate of the position setpoint over the slot, 1/s."""
    trim_limit: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/grasp.md")] = 0.01
    """Largest integral, m."""
    saturated: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/grasp.md")] = 2e-3
    """Position error at which the proportional and integral parts saturate, m, so that the arriving hand's lag winds up no integral."""
    integral_gain: Annotated[float, Figure("N·m/(rad·s)"), Field(exclude=True)] = 300.0
    """Integral gain of the arm's orientation over the slot, N·m/(rad·s)."""
    integral_limit: Annotated[float, Figure("N·m"), Field(exclude=True)] = 6.0
    """Saturation of the integral of the arm's orientation, N·m."""
    print_time: Annotated[float, Figure("s"), Field(exclude=True)] = 5.0
    """Longest wait for the frames that show the peg, s; at 10 Hz they take 0.9 s, and a skin that times out raises a fault earlier."""


@dataclass(frozen=True, slots=True)
class GraspFromRackResult(SkillResult):
    """State of the hand after the grasp."""

    width: float
    """Distance between the pads at the end, m."""
    theta: float
    """In-hand angle after the lift, rad."""


def run(params: GraspFromRackParams, ctx: SkillContext) -> GraspFromRackResult:
    """Take the peg from the job's slot and check that the hand holds it."""
    started = ctx.devices.clock.now()
    job = ctx.job
    slot = np.array(job.rack.first) + np.array([0.0, job.rack.pitch * (job.slot % job.rack.slots), 0.0])
    # The peg stands on the slot's floor, so the finger centre goes to the height `length` above that floor.
    grip_at = slot + UP * (job.peg.length - job.rack.depth)

    ctx.devices.gripper.release(params.opening)
    ctx.peg = HeldPeg()
    above = Goal(grip_at + UP * params.clearance, UP, ACROSS_RACK)
    _rise(above.tip[2], params, ctx)
    for _ in move(above, params.transfer, ctx, None, settle=0.0):
        pass
    for _ in move(Goal(grip_at, UP, ACROSS_RACK), params.transfer, ctx, None, settle=0.0):
        pass
    centring = Centring(params, grip_at, ctx)
    for seen in ctx.scan(params.centring_time):
        if centring.follow(seen):
            break
    if not (centring.is_within(params.near, params.askew) and _close(params, centring, ctx)):
        return _missed(params, ctx, started, Reason.MISSED_GRASP)
    _require_print(params, ctx)
    _draw_out(grip_at[2] + job.rack.depth, params, ctx)
    for _ in move(above, params.transfer, ctx, None, settle=0.0):
        pass
    if not _holds_peg(params, ctx):
        return _missed(params, ctx, started, Reason.LOST_GRASP)
    seen = ctx.observe()
    return GraspFromRackResult(
        Outcome.SUCCESS, Reason.NONE, ctx.devices.clock.now() - started, seen.gripper.width, seen.peg.theta
    )


def _rise(height: float, params: GraspFromRackParams, ctx: SkillContext) -> None:
    """Rise straight up to `height`, m, base frame, if a fault left the hand lower; turning there could hit the plate."""
    hand = ctx.observe().arm.tcp
    if hand.position[2] >= height:
        return
    up = np.array([*hand.position[:2], height])
    for _ in move(Goal(up, -hand.rotation[:, 0], hand.rotation[:, 2]), params.transfer, ctx, None, limited=False):
        pass


class Centring:
    """Control that centres the open hand on the slot against joint friction, also while the hand closes.

    If the hand grips the peg aslant, the peg jams in the slot. The final setpoint balances the joints' friction.
    """

    def __init__(self, params: GraspFromRackParams, grip_at: Vector, ctx: SkillContext) -> None:
        """Start from the held setpoint, with the goal `grip_at`, shape (3,), m, base frame."""
        assert ctx.lead.held is not None
        self._params, self._ctx, self._grip_at, self._trim = params, ctx, grip_at, np.zeros(3)
        self._held = replace(
            ctx.lead.held,
            id=ctx.new_id(),
            twist=None,
            is_free=False,  # from here to the end of the slot, peg and rack may touch
            integral_gain=params.integral_gain,
            integral_limit=params.integral_limit,
        )
        self._off, self._aslant, self._speed = np.full(3, math.inf), math.inf, math.inf

    def follow(self, seen: Observation) -> bool:
        """Process one scan; return True if the hand rests, centred on the goal."""
        params, hand, before = self._params, seen.arm.tcp, self._off
        self._off = self._grip_at - hand.position
        self._speed = float(np.abs(self._off - before).max()) / seen.step
        self._aslant = max(angle_between(-hand.rotation[:, 0], UP), angle_between(hand.rotation[:, 2], ACROSS_RACK))
        # x_sp = x_goal + K sat(e) + k ∫ sat(e) dt
        error = np.clip(self._off, -params.saturated, params.saturated)
        self._trim = np.clip(self._trim + params.trim_rate * seen.step * error, -params.trim_limit, params.trim_limit)
        tip = self._grip_at + params.proportion * error + self._trim
        self._held = self._held.moved(tip, seen.stamp + VALIDITY)
        self._ctx.follow(self._held)
        return self.is_within(params.centred, params.upright) and self._speed < params.resting

    def is_within(self, off: float, aslant: float) -> bool:
        """Return True if position and directions of the hand were within `off`, m, and `aslant`, rad, of the goal at the last scan."""
        return float(np.abs(self._off).max()) < off and self._aslant < aslant

    def freeze(self) -> None:
        """Freeze the setpoint and stop the arm's integral."""
        self._ctx.follow(replace(self._held, integral_gain=0.0))


def _close(params: GraspFromRackParams, centring: Centring, ctx: SkillContext) -> bool:
    """Close the hand while `centring` continues; return True if it holds a peg."""
    ctx.devices.gripper.grip(params.force)
    for seen in ctx.scan(HAND_TIME):
        if seen.gripper.is_gripping or not seen.gripper.is_moving:
            break
        centring.follow(seen)
    centring.freeze()
    return _holds_peg(params, ctx)


def _require_print(params: GraspFromRackParams, ctx: SkillContext) -> None:
    """Check that the skin shows a print of this grasp while the peg is still in its slot; otherwise release it there.

    The check detects modules that are dead, stuck below the rail, exchanged, or read at random, before the peg moves.

    Raises:
        SkinUntrustedError: The skin does not show the print, or the print fits exchanged modules better.
    """
    shown, order = GraspPrint(ctx.devices.layout), PrintOrder(ctx.perception.estimator, ctx.devices.layout)
    for seen in ctx.scan(params.print_time):
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
        ctx.devices.gripper.release(params.opening)
        raise


def _draw_out(height: float, params: GraspFromRackParams, ctx: SkillContext) -> None:
    """Rise until the finger centre is at `height`, m, base frame, at which the peg's end has left the slot."""
    held = ctx.lead.held
    assert held is not None
    twist = Twist(UP * params.drawing_speed, np.zeros(3))
    for seen in ctx.scan(params.drawing_time * (height - held.tip[2]) / params.drawing_speed):
        if seen.arm.tcp.position[2] >= height:
            break
        tip = held.tip + twist.linear * seen.elapsed
        ctx.follow(held.moved(tip, seen.stamp + VALIDITY, twist))


def _holds_peg(params: GraspFromRackParams, ctx: SkillContext) -> bool:
    hand = ctx.read_hand()
    return hand.is_gripping and abs(hand.width - ctx.job.peg.part.thickness) <= params.width_tolerance


def _missed(params: GraspFromRackParams, ctx: SkillContext, started: float, reason: Reason) -> GraspFromRackResult:
    seen = ctx.observe()
    ctx.devices.gripper.release(params.opening)
    return GraspFromRackResult(
        Outcome.FAILURE, reason, ctx.devices.clock.now() - started, seen.gripper.width, seen.peg.theta
    )
