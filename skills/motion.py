"""Setpoints and free-space moves that the skills share."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat

from drivers.config_model import ConfigModel
from drivers.frames import UP, angle_between, rotation_about
from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from skills.clearance import SAMPLES, Attitude, require_clear
from skills.contract import Observation, SkillContext

VALIDITY = 0.1
"""Time for which a setpoint is valid, s; without a newer one the arm then holds still."""

LONGEST_MOVE = 10.0
"""Time on the cell's clock after which a move is over although late scans keep it from its end, multiple of its own time."""

TWIST = 0.5
"""Share of the rotational stiffness that a hand has about the vertical on the way, fraction: about its own axis it has the least inertia beside rotors
that may not show, and swung where torques came 3.5 ms late. Source: decision 0012."""

STRAY = 4e-3
"""Largest distance from where the hole was found at which a setpoint still follows the tip of a peg that is not broader than 8 mm, m; a hole keeps
its place. The tip of a broader peg, whose edge has fallen in, goes as much further while the peg is turned upright. Source: docs/tried/insertion.md."""


class Gains(ConfigModel):
    """Stiffness and damping ratio with which the arm follows a setpoint."""

    translation: PositiveFloat
    """Translational stiffness, N/m."""
    rotation: PositiveFloat
    """Rotational stiffness, N·m/rad."""
    damping_ratio: PositiveFloat = 1.0
    """Damping of every mode, multiple of what is critical at the arm's own inertia. Source: decision 0011."""

    def stiffness(self) -> Vector:
        """Return the stiffness, shape (6,)."""
        return np.array([self.translation] * 3 + [self.rotation] * 3)

    def damping_ratios(self) -> Vector:
        """Return the damping ratio of each direction, shape (6,)."""
        return np.full(6, self.damping_ratio)


class Transfer(ConfigModel):
    """How the arm moves through free space.

    Source: chosen, not measured.
    """

    gains: Gains
    """Stiffness and damping ratio on the way."""
    speed: PositiveFloat
    """Largest speed of the tip, m/s."""
    turn_speed: PositiveFloat
    """Largest turning rate, rad/s."""
    elbow: Annotated[float, Field(ge=-math.pi, le=math.pi)]
    """Position of the elbow's joint that the null space is drawn to, rad; without it the elbow would wander from run to run."""
    clearance: Annotated[float, Field(ge=0.0, le=0.05)] = 0.002
    """Least distance of hand and peg from plate and rack on the way, m; only a way that begins or ends nearer may come nearer. Source: decision 0013."""

    def stiffness(self) -> Vector:
        """Return the stiffness on the way, shape (6,): N/m along the axes of the base frame, then N·m/rad about them."""
        stiffness = self.gains.stiffness()
        stiffness[5] *= TWIST
        return stiffness


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """Goal of a move: place of the controlled point, m, and directions of the peg's axis and of the closing axis, base frame."""

    tip: Vector
    axis: Vector
    roll: Vector


def minimum_jerk(share: float) -> tuple[float, float]:
    """Return position and rate, both per whole move, after a share of its time: 10 s^3 - 15 s^4 + 6 s^5 (Flash and Hogan)."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) ** 2


def move(
    goal: Goal,
    transfer: Transfer,
    ctx: SkillContext,
    in_hand: InHandTip | None,
    settle: float = 0.3,
    limited: bool = True,
) -> Iterator[Observation]:
    """Move the tip straight to `goal`, turning on the way, and yield every scan until it has settled there.

    The setpoint follows a minimum-jerk profile whose peak keeps to the transfer's speeds, with its twist fed
    forward.

    Args:
        goal: Goal of the move.
        transfer: Speeds and gains of the move.
        ctx: The skill's context.
        in_hand: The peg as it is held, which the hand must not lose on the way, or None for the empty hand.
        settle: Time allowed to settle at the end, s.
        limited: Whether the limits of force and workspace hold; a motion that may begin in contact goes without them, and
            the arm learns nothing about its joints from it.
    """
    first = ctx.observe()
    if in_hand is None:
        tip, axis = first.arm.tcp.position, -first.arm.tcp.rotation[:, 0]
    else:
        tip, axis = first.tip, first.axis
    way = Way(Goal(tip, axis, first.arm.tcp.rotation[:, 2]), goal)
    if limited:
        places = [way.at(share)[0] for share in np.linspace(0.0, 1.0, SAMPLES + 1)]
        require_clear([Attitude(at.tip, at.axis, at.roll) for at in places], ctx.job, in_hand, transfer.clearance)
    duration = way.duration(transfer)
    identity = ctx.new_id()
    stiffness, damping_ratio = transfer.stiffness(), transfer.gains.damping_ratios()
    for seen in ctx.scan(LONGEST_MOVE * (duration + settle), in_hand is not None, limited):
        if seen.elapsed >= duration + settle:
            break
        share, rate = minimum_jerk(seen.elapsed / duration)
        at, twist = way.at(share)
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
                is_free=True,
                twist=Twist(twist.linear * (rate / duration), twist.angular * (rate / duration)),
            )
        )
        yield seen


class Way:
    """The way from one place to another: straight for the tip, about one axis for the peg, and about the peg for the hand."""

    def __init__(self, start: Goal, goal: Goal) -> None:
        """Lay the way from `start` to `goal`."""
        self._start, self._way = start, goal.tip - start.tip
        self._swing_axis, self._swing = _turn_between(start.axis, goal.axis)
        carried = rotation_about(self._swing_axis, self._swing) @ start.roll
        self._twist = math.atan2(float(goal.axis @ np.cross(carried, goal.roll)), float(carried @ goal.roll))

    def duration(self, transfer: Transfer) -> float:
        """Return the time for which a minimum-jerk profile keeps to the transfer's speeds, s."""
        turn, peak = self._swing + abs(self._twist), 1.875
        return max(peak * float(np.linalg.norm(self._way)) / transfer.speed, peak * turn / transfer.turn_speed, 0.2)

    def at(self, share: float) -> tuple[Goal, Twist]:
        """Return the place after a share of the way, and the twist there per whole way."""
        start, turned = self._start, rotation_about(self._swing_axis, self._swing * share)
        axis = turned @ start.axis
        roll = rotation_about(axis, self._twist * share) @ turned @ start.roll
        return Goal(start.tip + self._way * share, axis, roll), Twist(
            self._way, self._swing_axis * self._swing + axis * self._twist
        )


def _turn_between(a: Vector, b: Vector) -> tuple[Vector, float]:
    cross = np.cross(a, b)
    size = float(np.linalg.norm(cross))
    if size < 1e-9:
        other = np.cross(a, UP) if abs(a[2]) < 0.9 else np.cross(a, np.array([1.0, 0.0, 0.0]))
        return other / np.linalg.norm(other), angle_between(a, b)
    return cross / size, angle_between(a, b)


def tilted_by(offset: Vector, length: float) -> Vector:
    """Return the axis of a peg whose finger centre, `length` above its tip, stands off the vertical by `offset`, m."""
    axis = np.array([offset[0], offset[1], 0.0]) + math.sqrt(max(length**2 - float(offset @ offset), 1e-12)) * UP
    return axis / np.linalg.norm(axis)


def stay(ctx: SkillContext, stamp: float) -> None:
    """Keep the held setpoint alive, at rest."""
    if ctx.held is not None:
        ctx.follow(replace(ctx.held, valid_until=stamp + VALIDITY, twist=None))


def between(goal: Vector, start: Vector, share: float) -> Vector:
    """Return the unit vector between `start` and `goal`, shape (3,); `share` is the weight of `start`, 0 to 1."""
    mixed: Vector = (1.0 - share) * goal + share * start
    return mixed / math.sqrt(float(mixed @ mixed))


def spin_between(before: Vector, after: Vector, period: float) -> Vector:
    """Return the angular velocity, shape (3,), rad/s, that takes one rotation, shape (3, 3), to the next in `period` seconds."""
    turn = after @ before.T
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (2.0 * period)


def anchored(tip: Vector, found: Vector, breadth: float = 0.0) -> Vector:
    """Return the tip, shape (3,), m, drawn back along x and y to within `STRAY`, or half the peg's breadth, of where the hole was found."""
    stray = max(STRAY, breadth / 2.0)
    way = (tip - found)[:2]
    size = math.hypot(way[0], way[1])
    held = tip.copy()
    if size > stray:
        held[:2] = found[:2] + stray / size * way
    return held


@dataclass(frozen=True, slots=True)
class Trim:
    """An integral on the setpoint's side, where the arm's law has none: [gibbons] integrates the orientation alone."""

    rate: float
    """Rate at which the trim grows with the error, 1/s."""
    limit: float
    """Largest trim, m."""
    value: float = 0.0
    """Trim that is added to the setpoint, m."""

    def after(self, error: float, period: float) -> "Trim":
        """Return the trim after `period` seconds with this error of the tip, m."""
        value = min(max(self.value + self.rate * error * period, -self.limit), self.limit)
        return Trim(self.rate, self.limit, value)
