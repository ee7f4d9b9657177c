"""Turn the peg upright with its tip in the hole, by the angle that the skin measures: [gibbons], Sec. V.A, Eq. (4)-(7)."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from drivers.frames import angle_between, cross, rotation_about
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains, anchored
from skills.paper.equations import k_33
from skills.search.surface import Plane, nominal
from skills.seating.decision import is_seated
from skills.tactile.estimators import EstimatorName


class TactileInsertParams(SkillParams):
    """Parameters of aligning the peg with the plate's normal."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    gains: Annotated[Gains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along x and y and in rotation."""
    integral_gain: Annotated[
        NonNegativeFloat, Quantity("N·m/(rad·s)"), Source("chosen, not measured; method of [gibbons], Eq. (6)")
    ]
    """Integral gain on orientation, N·m/(rad·s); K_I of [gibbons], Eq. (6)."""
    integral_limit: Annotated[NonNegativeFloat, Quantity("N·m")]
    """Saturation of the integral, N·m."""
    push_offset: Annotated[NonNegativeFloat, Quantity("m"), Source("[gibbons], Sec. V")]
    """Depth of the tip's setpoint below the surface, m; 0.01 in [gibbons]."""
    push_stiffness: Annotated[
        tuple[PositiveFloat, PositiveFloat],
        Quantity("N/m"),
        Source("chosen, not measured; method of [gibbons], Eq. (7)"),
    ]
    """Least and largest stiffness along z, N/m; K_min and K_max of [gibbons], Eq. (7)."""
    turn_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED)]
    """Rate at which the setpoint of the axis turns from the peg's first axis to upright, rad/s."""
    turn_run_up: Annotated[
        NonNegativeFloat, Quantity("s", Tempo.WAIT), Source("chosen, not measured; reason in docs/tried/insertion.md")
    ]
    """Time in which the setpoint of the axis reaches its rate, s; the hole's wall bears the force that accelerates the arm."""
    steady_rate: Annotated[float, Figure("rad/s"), Field(exclude=True), Source("docs/tried/insertion.md")] = 0.55
    """Largest `turn_rate` after a failed attempt, rad/s: if the peg left the hole during the turn, it would leave it again."""
    follow_rate: Annotated[float, Figure("1/s"), Field(exclude=True), Source("docs/tried/search.md")] = 2.0
    """Rate at which the hand follows a rotation of the peg in the hand, 1/s."""
    aligned: Annotated[float, Field(gt=0.0, lt=0.8), Quantity("rad"), Source("docs/tried/insertion.md")]
    """Tilt phi below which the adjustment takes over, rad; 15 degrees in [gibbons]. It also takes over when the setpoint is
    upright: if the hand turned further, it would only deform the soft pads.
    """
    compliance_rate: Annotated[PositiveFloat, Quantity("1/s"), Source("docs/tried/insertion.md")]
    """Rate at which the tip's setpoint along x and y moves to the tip's measured position, which the hole determines, 1/s."""
    forward: Annotated[PositiveFloat, Quantity("m"), Source("chosen, not measured; reason in docs/tried/insertion.md")]
    """Distance of the tip's setpoint ahead of the tip, towards the side to which the peg leans, m; it keeps the tip in the hole during the turn."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT)]
    """Longest insertion, s."""
    lost_height: Annotated[PositiveFloat, Quantity("m")]
    """Height of the tip above the surface from which it counts as out of the hole, m."""
    estimator: Annotated[EstimatorName, Source("measured by `cell study tactile`")] = "image"
    """Estimator of the peg's pose from the taxels, in every skill."""


@dataclass(frozen=True, slots=True)
class TactileInsertResult(SkillResult):
    """Tilt of the peg at the beginning and at the end of the insertion."""

    first_phi: float
    """Angle phi_0 between the peg and the normal upon contact, rad."""
    phi: float
    """Angle between the peg and the normal at the end, rad, measured by the skin."""


def run(params: TactileInsertParams, ctx: SkillContext, plane: Plane | None = None) -> TactileInsertResult:
    """Align the peg, whose tip is in the hole, with the normal of the plate.

    Args:
        params: Parameters of the insertion.
        ctx: The skill's context.
        plane: Surface estimate of the search; None for the surface stated in the job.
    """
    plane = plane or nominal(ctx.job.hole)
    normal = plane.normal
    first = ctx.observe()
    first_phi = angle_between(first.axis, normal)
    hole = first.tip.copy()
    hole[2] = ctx.job.hole.centre[2] - params.push_offset
    identity = ctx.new_id()
    roll = first.arm.tcp.rotation[:, 2]
    stiffness, damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
    phi, theta = first_phi, first.peg.theta
    peg = ctx.job.peg.part
    for seen in ctx.scan(params.timeout, holding=True):
        elapsed = seen.running
        phi = angle_between(seen.axis, normal)
        if is_seated(seen.switch, plane.depth(seen.tip), ctx.job.hole):
            return TactileInsertResult(Outcome.SUCCESS, Reason.NONE, elapsed, first_phi, phi)
        angle, rate = turned(seen.elapsed, params.turn_rate, params.turn_run_up)
        if phi < params.aligned or angle >= first_phi:
            return TactileInsertResult(Outcome.SUCCESS, Reason.NONE, elapsed, first_phi, phi)
        if plane.depth(seen.tip) < -params.lost_height - peg.reach * math.sin(phi):
            return TactileInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, elapsed, first_phi, phi)
        ctx.callbacks.progress(1.0 - min(phi / max(first_phi, 1e-6), 1.0))
        hole[:2] += (
            min(params.compliance_rate * seen.step, 1.0) * (anchored(seen.tip, first.tip, peg.thickness) - hole)[:2]
        )
        tip = hole + params.forward * _ahead(seen.axis)
        stiffness[2] = k_33(phi, first_phi, *params.push_stiffness)
        theta += min(params.follow_rate * seen.step, 1.0) * (seen.peg.theta - theta)
        left = rotation_about(seen.arm.tcp.rotation[:, 2], seen.peg.theta - theta)
        axis, spin = _on_the_way(first.axis, normal, angle, rate)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=tip,
                axis=left @ axis,
                roll=roll,
                stiffness=stiffness.copy(),
                damping_ratio=damping_ratio,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
                integral_gain=params.integral_gain,
                integral_limit=params.integral_limit,
                twist=Twist(np.zeros(3), spin),
            )
        )
    return TactileInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, params.timeout, first_phi, phi)


def turned(elapsed: float, rate: float, run_up: float) -> tuple[float, float]:
    """Return angle, rad, and rate, rad/s, after `elapsed` seconds, if the rate grows linearly to `rate` within `run_up`, s."""
    if elapsed < run_up:
        return rate * elapsed**2 / (2.0 * run_up), rate * elapsed / run_up
    return rate * (elapsed - run_up / 2.0), rate


def _ahead(axis: Vector) -> Vector:
    """Return the horizontal direction in which the peg leans, unit, shape (3,); zero for an upright peg."""
    size = math.hypot(axis[0], axis[1])
    return np.array([axis[0], axis[1], 0.0]) / size if size > 1e-6 else np.zeros(3)


def _on_the_way(start: Vector, goal: Vector, turned: float, rate: float) -> tuple[Vector, Vector]:
    """Return the setpoint of the axis, turned by `turned`, rad, from `start` towards `goal`, and its angular velocity, rad/s."""
    about = cross(start, goal)
    about /= math.sqrt(float(about @ about))
    return rotation_about(about, turned) @ start, rate * about
