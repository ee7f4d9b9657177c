"""Measure the height of a surface by touching it from above with the held peg: a guarded motion with a bounded force."""

from collections import deque
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Tempo
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import SkillContext
from skills.grasp_from_rack import ACROSS_RACK
from skills.motion import VALIDITY, Goal, Transfer, move


class TouchOff(ConfigModel):
    """Motion that touches a surface."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    speed: Annotated[float, Figure("m/s", Tempo.SPEED), Field(exclude=True)] = 0.01
    """Speed at which the peg descends and rises again, m/s."""
    rest: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.3
    """Time at rest on the surface before its height is measured, s."""
    force: Annotated[float, Figure("N"), Field(exclude=True)] = 4.0
    """Mean force along z at which the surface counts as touched, N; higher if the noise requires it."""
    most: Annotated[float, Figure("N"), Field(exclude=True)] = 12.0
    """Largest push from the setpoint's lead over the tip, N; joint friction reduces it."""
    scans: Annotated[int, Figure("count"), Field(exclude=True)] = 5
    """Number of scans in the mean of the force, and in the mean of the height."""
    clear: Annotated[float, Figure("m"), Field(exclude=True)] = 0.012
    """Height over the stated surface at which the descent starts, m; the longest plausible peg does not touch it there."""
    deepest: Annotated[float, Figure("m"), Field(exclude=True)] = 0.012
    """Depth below the stated surface at which the descent ends, m."""


def touch_off(place: Vector, transfer: Transfer, touch: TouchOff, ctx: SkillContext) -> Vector | None:
    """Lower the upright peg onto a surface, measure the touched point, and rise again.

    Args:
        place: Stated point on the surface, shape (3,), m, base frame.
        transfer: Motion of the peg to the surface.
        touch: Speed and rest of the touch.
        ctx: The skill's context; the hand holds a peg.

    Returns:
        The touched point, shape (3,), m, base frame; None if nothing was touched down to `deepest`.

    Raises:
        Interrupted: Stop request, a force above the limit, or a lost peg.
        WrenchReversedError: The arm reports a downward force while it presses down.
    """
    above = Goal(place + touch.clear * UP, UP, ACROSS_RACK)
    for _ in move(above, transfer, ctx, ctx.in_hand()):
        pass
    ctx.wrench.set_zero()
    touched = _come_down(place, transfer, touch, ctx)
    height = ctx.observe().tip[2]
    up = Goal(np.array([*place[:2], max(float(height), float(place[2])) + touch.clear]), UP, ACROSS_RACK)
    for _ in move(up, transfer.model_copy(update={"speed": touch.speed}), ctx, ctx.in_hand(), limited=False):
        pass
    return touched


def _come_down(place: Vector, transfer: Transfer, touch: TouchOff, ctx: SkillContext) -> Vector | None:
    """Descend until the surface bears the peg, rest there, and return the peg's lowest point; None without a surface."""
    identity, in_hand = ctx.new_id(), ctx.in_hand()
    stiffness, damping = transfer.gains.stiffness(), transfer.gains.damping_ratios()
    lead, forces = touch.most / transfer.gains.translation, deque[float](maxlen=touch.scans)
    threshold = ctx.wrench.zero.guarded(touch.force, touch.scans)
    tip, since = place + touch.clear * UP, None
    lowest: deque[Vector] = deque(maxlen=touch.scans)
    for seen in ctx.scan((touch.clear + touch.deepest) / touch.speed + 2.0 * touch.rest, holding=True):
        forces.append(float(seen.arm.wrench.force[2]))
        lowest.append(ctx.job.peg.part.lowest(seen.tip, seen.axis, seen.arm.tcp.rotation[:, 2]))
        is_moving = since is None
        if since is None and len(forces) == touch.scans and float(np.mean(forces)) > threshold:
            since = seen.elapsed
        if since is not None and seen.elapsed - since >= touch.rest:
            return np.asarray(np.mean(lowest, axis=0))
        if is_moving:
            tip = np.array([*place[:2], max(tip[2] - touch.speed * seen.step, seen.tip[2] - lead)])
        if tip[2] < place[2] - touch.deepest:
            break
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=tip,
                axis=UP,
                roll=ACROSS_RACK,
                stiffness=stiffness,
                damping_ratio=damping,
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
                posture=seen.arm.posture(transfer.elbow),
                twist=Twist(-touch.speed * UP, np.zeros(3)) if is_moving else None,
            )
        )
    ctx.wrench.zero.require_sense(forces, touch.force)
    return None
