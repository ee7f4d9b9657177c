"""Setpoints and free-space moves that the skills share."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, PositiveFloat

from drivers.config_model import ConfigModel, Figure, Quantity, Source, Tempo
from drivers.frames import UP, cross, quaternion, rotation_about
from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from skills.contract import Observation, SkillContext
from skills.guards.clearance import SAMPLES, Attitude, require_clear

VALIDITY = 0.1
"""Validity of a setpoint, s; if no newer one arrives within this time, the arm holds still. Source: chosen, not measured."""

LONGEST_MOVE = 10.0
"""Time limit of a move on the cell's clock, multiple of its planned time; late scans slow a move."""

TWIST = 0.5
"""Factor on the rotational stiffness about the vertical during a move, fraction. The wrist's inertia about this axis is the lowest, and rotor
inertia may be hidden by the torque controller. With the full stiffness, the hand oscillated at a torque delay of 3.5 ms.
Source: decision 0012.
"""

STRAY = 4e-3
"""Largest distance from the found hole up to which the setpoint follows the tip, m; the hole itself does not move. For pegs broader than 8 mm
it is half the breadth: while a tilted peg is raised upright in the hole, its tip moves that far. Source: docs/tried/insertion.md.
"""


class Gains(ConfigModel):
    """Stiffness and damping ratio of the arm's impedance law."""

    translation: Annotated[float, Field(gt=0.0, le=1e5), Quantity("N/m")]
    """Translational stiffness, N/m."""
    rotation: Annotated[float, Field(gt=0.0, le=1e4), Quantity("N·m/rad")]
    """Rotational stiffness, N·m/rad."""
    damping_ratio: Annotated[float, Figure("multiple"), Field(exclude=True), Source("decision 0011")] = 1.0
    """Damping ratio of every mode, multiple of the critical damping at the arm's own inertia."""

    def stiffness(self) -> Vector:
        """Return the stiffness, shape (6,), N/m and N·m/rad."""
        return np.array([self.translation] * 3 + [self.rotation] * 3)

    def damping_ratios(self) -> Vector:
        """Return the damping ratio of each direction, shape (6,)."""
        return np.array([self.damping_ratio] * 6)


class DampedGains(Gains):
    """Gains whose damping ratio a config can set."""

    damping_ratio: Annotated[PositiveFloat, Quantity("multiple"), Source("decision 0011")] = 1.0
    """Damping ratio of every mode, multiple of the critical damping at the arm's own inertia."""


class Transfer(ConfigModel):
    """Figures of a move through free space."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    gains: Annotated[Gains, Figure(""), Field(exclude=True)] = Gains(translation=1500.0, rotation=60.0)
    """Stiffness and damping ratio during the move."""
    speed: Annotated[float, Figure("m/s", Tempo.SPEED), Field(exclude=True)] = 0.25
    """Largest speed of the tip, m/s."""
    turn_speed: Annotated[float, Figure("rad/s", Tempo.SPEED), Field(exclude=True), Source("docs/tried/grasp.md")] = 1.5
    """Largest turning rate, rad/s."""
    elbow: Annotated[float, Figure("rad"), Field(exclude=True)] = 0.05
    """Goal of the elbow's joint in the null space, rad; without it the elbow would drift from run to run."""
    clearance: Annotated[float, Figure("m"), Field(exclude=True), Source("decision 0013")] = 0.002
    """Least distance of hand and peg from plate and rack during a move, m; if the start or the goal is nearer, the move may come as near as that."""

    settle: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.3
    """Time to settle at the end of a move, s."""

    def stiffness(self) -> Vector:
        """Return the stiffness during a move, shape (6,): N/m along the axes of the base frame, then N·m/rad about them."""
        stiffness = self.gains.stiffness()
        stiffness[5] *= TWIST
        return stiffness


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """Goal of a move: position of the controlled point, m, and directions of the peg's axis and closing axis, base frame."""

    tip: Vector
    axis: Vector
    roll: Vector


def minimum_jerk(share: float) -> tuple[float, float]:
    """Return position and rate of a minimum-jerk move (Flash and Hogan) of length and time 1, at `share` >= 0 of its time."""
    # x = 10 s³ - 15 s⁴ + 6 s⁵, dx/ds = 30 s² (1 - s)²
    s = min(share, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) ** 2


def move(
    goal: Goal,
    transfer: Transfer,
    ctx: SkillContext,
    in_hand: InHandTip | None,
    settle: float | None = None,
    limited: bool = True,
) -> Iterator[Observation]:
    """Move the tip straight to `goal` while the hand turns, and yield every scan until it has settled there.

    The setpoint follows a minimum-jerk profile, with its twist as feedforward. The peak speed is within the transfer's speeds.

    Args:
        goal: Goal of the move.
        transfer: Speeds and gains of the move.
        ctx: The skill's context.
        in_hand: Pose of the peg in the hand; its loss ends the move. None for the empty hand.
        settle: Time to settle at the end, s; None for that of the transfer.
        limited: False if the motion can start in contact: no limits and no clearance are checked, no friction is learnt.
    """
    first = ctx.observe()
    if in_hand is None:
        tip, axis = first.arm.tcp.position, -first.arm.tcp.rotation[:, 0]
    else:
        tip, axis = first.tip, first.axis
    way = TransferPath(Goal(tip, axis, first.arm.tcp.rotation[:, 2]), goal)
    if limited:
        places = [way.at(share)[0] for share in np.linspace(0.0, 1.0, SAMPLES + 1)]
        require_clear([Attitude(at.tip, at.axis, at.roll) for at in places], ctx.job, in_hand, transfer.clearance)
    duration, settle = way.duration(transfer), transfer.settle if settle is None else settle
    identity = ctx.new_id()
    stiffness, damping_ratio = transfer.stiffness(), transfer.gains.damping_ratios()
    for seen in ctx.scan(LONGEST_MOVE * (duration + settle), in_hand is not None, limited):
        share, rate = minimum_jerk(seen.elapsed / duration)
        at, twist = way.at(share, rate / duration)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=at.tip,
                axis=at.axis,
                roll=at.roll,
                stiffness=stiffness,
                damping_ratio=damping_ratio,
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
                posture=seen.arm.posture(transfer.elbow),
                is_free=limited,
                twist=twist,
            )
        )
        yield seen
        if seen.elapsed >= duration + settle:
            break


class TransferPath:
    """Path between two goals: a straight line of the tip while the hand turns about one axis."""

    def __init__(self, start: Goal, goal: Goal) -> None:
        """Prepare the path from `start` to `goal`."""
        self._start, self._way = start, goal.tip - start.tip
        # [w, v] = [cos(φ/2), sin(φ/2) a], the quaternion of the rotation from start to goal; w >= 0, so that φ <= π
        w, *v = quaternion(_hand_frame(goal) @ _hand_frame(start).T)
        size = math.hypot(*v)
        self._about, self._turn = (np.array(v) / size, 2.0 * math.atan2(size, w)) if size > 1e-9 else (UP, 0.0)

    def duration(self, transfer: Transfer) -> float:
        """Return the time in which a minimum-jerk profile stays within the transfer's speeds, s, at least 0.2."""
        # Peak of dx/ds = 30 s² (1 - s)²: 1.875 at s = 1/2
        peak = 1.875
        return max(
            peak * float(np.linalg.norm(self._way)) / transfer.speed, peak * self._turn / transfer.turn_speed, 0.2
        )

    def at(self, share: float, rate: float = 0.0) -> tuple[Goal, Twist]:
        """Return the goal at `share` of the path, and the twist there if the share grows at `rate`, 1/s."""
        start, turned = self._start, rotation_about(self._about, self._turn * share)
        goal = Goal(start.tip + self._way * share, turned @ start.axis, turned @ start.roll)
        return goal, Twist(self._way * rate, self._about * (self._turn * rate))


def _hand_frame(goal: Goal) -> Vector:
    """Return the rotation, shape (3, 3), with the closing axis, the axis across, and the peg's axis as columns."""
    return np.array([goal.roll, cross(goal.axis, goal.roll), goal.axis]).T


def tilted_by(offset: Vector, length: float) -> Vector:
    """Return the unit axis, shape (3,), of a peg whose finger centre is `length`, m, from the tip and horizontally `offset`, shape (2,), m."""
    # v = [o_x, o_y, sqrt(length² - |o|²)] / length
    axis = np.array([offset[0], offset[1], 0.0]) + math.sqrt(max(length**2 - float(offset @ offset), 1e-12)) * UP
    return axis / math.sqrt(float(axis @ axis))


def stay(ctx: SkillContext, stamp: float) -> None:
    """Extend the validity of the held setpoint, with zero twist."""
    held = ctx.lead.held
    if held is not None:
        ctx.follow(held.moved(held.tip, stamp + VALIDITY))


def between(goal: Vector, start: Vector, share: float) -> Vector:
    """Return the unit vector between `start` and `goal`, shape (3,); `share` is the weight of `start`, 0 to 1."""
    if share == 0.0:
        return goal
    mixed: Vector = (1.0 - share) * goal + share * start
    return mixed / math.sqrt(float(mixed @ mixed))


def spin_between(before: Vector, after: Vector, period: float) -> Vector:
    """Return the angular velocity, shape (3,), rad/s, from one rotation, shape (3, 3), to the next in `period` seconds."""
    # R = after · beforeᵀ; omega = [R32 - R23, R13 - R31, R21 - R12] / (2 period), for small angles
    turn = after @ before.T
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (2.0 * period)


def anchored(tip: Vector, found: Vector, breadth: float = 0.0) -> Vector:
    """Return the tip, shape (3,), m, with x and y within `STRAY`, or half the peg's breadth if larger, of the found hole."""
    stray = max(STRAY, breadth / 2.0)
    way = (tip - found)[:2]
    size = math.hypot(way[0], way[1])
    held = tip.copy()
    if size > stray:
        held[:2] = found[:2] + stray / size * way
    return held


@dataclass(frozen=True, slots=True)
class Trim:
    """Integral action on the position setpoint; the arm's law integrates only the orientation, as in [gibbons]."""

    rate: float
    """Rate at which the trim grows with the error, 1/s."""
    limit: float
    """Largest trim, m."""
    value: float = 0.0
    """Trim added to the setpoint, m."""

    def after(self, error: float, period: float) -> "Trim":
        """Return the trim after `period` seconds with this error of the tip, m."""
        # trim <- trim + rate · error · period, within ±limit
        value = self.value + self.rate * error * period
        if not -self.limit <= value <= self.limit:
            value = math.copysign(self.limit, value)
        return Trim(self.rate, self.limit, value)
