"""Setpoint gate: it checks every setpoint of a skill before the arm receives it.

`GatedArm` is between the skills and the arm. It refuses only setpoints beyond any that a correct skill requests. Each skill
bounds its own contact forces.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel, Quantity
from drivers.errors import ArmSilentError, NotFiniteError, SetpointError, TrackingError
from drivers.frames import angle_between
from drivers.parts import Point
from drivers.protocols import Arm
from drivers.quantities import ArmState, ImpedanceSetpoint
from skills.setpoint_bounds import (
    AGE_SLACK,
    ArmBounds,
    Numbers,
    numbers_of,
    require_numbers,
    require_permitted,
    require_values,
)

MOST_ASKEW = 1.0
"""Largest angle between the axis of a setpoint and that of the peg or hand, rad; a correct skill stays below 0.6."""
LONGEST_STEP_TIME = 0.1
"""Largest time used to compute the permitted step, s; a longer pause does not permit a larger step."""
STEP_SLACK = 1e-3
"""Addition to the longest step, m: an integral or a new frame of the skin can move a setpoint at rest."""
LEAD = 0.02
"""Largest distance from the arm at which a motion may start, m; a correct skill starts a push at most 13 mm ahead."""
POSTURE_SLACK = 0.02
"""Addition to the longest step of a posture, rad."""
POSTURE_LEAD = 0.2
"""Largest distance from a joint at which the posture of a motion may start, rad: the null-space torque is then 2 N·m, a sixth of a wrist's
limit. After a halt, a correct posture is 0.1 rad from the joints. The elbow's joint has its own goal and no such limit.
"""
OUTWARD_SLACK = 1e-3
"""Tolerance for setpoints outside the workspace while the hand returns, m."""
LONGEST_UNTAKEN = 0.2
"""Longest time for which the arm may report an older setpoint than the last one sent, or none, s; its control loop takes milliseconds.
Source: chosen, not measured; reason in decision 0013.
"""


LONGEST_UNCHANGED = 0.15
"""Longest time for which all readings of an arm may be identical to the last digit while it follows a setpoint, s: 15 scans at 100 Hz, and
a fault within 0.2 s.
"""
MOST_LOAD = 1e4
"""Largest force, N, or torque, N·m, that a sensor of an arm can report; more than ten times the load of arms of this size."""


class Limits(ConfigModel):
    """Limits that end a skill at once; no defaults.

    Source: set for each cell.
    """

    force: Annotated[float, Field(gt=0.0, le=500.0), Quantity("N")]
    """Largest estimated external force at the TCP, N."""
    low: Annotated[Point, Quantity("m")]
    """Lower corner of the permitted workspace of the TCP, m, base frame."""
    high: Annotated[Point, Quantity("m")]
    """Upper corner of the permitted workspace of the TCP, m, base frame."""


@dataclass(frozen=True, slots=True)
class Handed:
    """A setpoint sent to the arm, with its time."""

    setpoint: ImpedanceSetpoint
    stamp: float
    """Time of the arm's state used to check the setpoint, s."""


def require_readings(arm: ArmState) -> None:
    """Check that every reading of an arm is a plausible number.

    Raises:
        NotFiniteError: A reading is not plausible; the message names it.
    """
    require_numbers("arm", "stamp", (arm.stamp,), NotFiniteError)
    for name, values, most in (
        ("joint position", arm.q, 100.0),
        ("joint velocity", arm.dq, 1000.0),
        ("TCP position", arm.tcp.position, 100.0),
        ("TCP orientation", arm.tcp.rotation, 2.0),
        ("force", arm.wrench.force, MOST_LOAD),
        ("torque", arm.wrench.torque, MOST_LOAD),
        ("commanded torque", arm.commanded, MOST_LOAD),
        ("unexplained torque", arm.unexplained, MOST_LOAD),
    ):
        # If the sum of squares is within most², every value is within the bound. Otherwise each value is checked.
        if values is not None and not np.vdot(values, values) <= most * most:
            require_numbers("arm", name, values.ravel().tolist(), NotFiniteError, most)


def require_sound(
    setpoint: ImpedanceSetpoint, arm: ArmState, before: Handed | None, limits: Limits, bounds: ArmBounds
) -> None:
    """Check that a setpoint may be sent to the arm.

    Args:
        setpoint: Setpoint of a skill.
        arm: The newest state of the arm.
        before: The previous setpoint, if any.
        limits: Limits of force and workspace.
        bounds: Bounds of the arm's setpoints.

    Raises:
        SetpointError: The setpoint is not finite, outside the workspace, too far, too fast or out of the arm's bounds.
        TrackingError: The arm lags so far behind that the spring would exceed the force limit.
    """
    asked, here, rotation = numbers_of(setpoint), arm.tcp.position.tolist(), arm.tcp.rotation.tolist()
    require_values(setpoint, asked, arm.stamp, bounds)
    _require_inside(asked, here, limits)
    # v = -(cos t·x + sin t·y) and x_p = x - length·v, as in `drivers.frames.end_point`.
    c, s = math.cos(asked.theta), math.sin(asked.theta)
    axis = [-c * x - s * y for x, y, _ in rotation]
    away = [there - (at - asked.length * v) for there, at, v in zip(asked.tip, here, axis, strict=True)]
    _require_aligned(asked, axis, [z for _, _, z in rotation], bounds)
    _require_posture(asked, setpoint.id, arm, before, bounds)
    goes_on = before is not None and _has_same_point(setpoint, before.setpoint)
    if before is not None and goes_on:
        _require_step(asked, before, arm.stamp, bounds.speed)
    _require_force(asked, away, goes_on, limits)
    if not goes_on:
        _require_beginning(asked, math.hypot(*away), before, arm.stamp, bounds.speed)


def _require_aligned(asked: Numbers, axis: list[float], closing: list[float], bounds: ArmBounds) -> None:
    """Check the angles from the hand to the setpoint's axis and roll, and that their torque is within the joints' limits."""
    if (askew := angle_between(axis, asked.axis)) > MOST_ASKEW:
        raise SetpointError(f"setpoint: axis {askew:.2f} rad from where it points; at most {MOST_ASKEW} rad allowed")
    rolled = _angle_about(axis, closing, asked.roll) if asked.roll else 0.0
    if abs(rolled) > MOST_ASKEW:
        raise SetpointError(
            f"setpoint: roll {abs(rolled):.2f} rad from the closing axis; at most {MOST_ASKEW} rad allowed"
        )
    torque = max(asked.turning) * math.hypot(askew, rolled)
    if torque > (most := max(bounds.torques)):
        raise SetpointError(
            f"setpoint: {math.hypot(askew, rolled):.2f} rad askew turns with {torque:.0f} N·m; at most {most:g} N·m allowed"
        )


def _angle_about(axis: list[float], start: list[float], goal: list[float]) -> float:
    """Return the angle about `axis` v, unit, from direction a to b, rad: atan2(v·(a × b), a·b - (v·a)(v·b))."""
    (x, y, z), (ax, ay, az), (bx, by, bz) = axis, start, goal
    across = x * (ay * bz - az * by) + y * (az * bx - ax * bz) + z * (ax * by - ay * bx)
    along = ax * bx + ay * by + az * bz - (x * ax + y * ay + z * az) * (x * bx + y * by + z * bz)
    return math.atan2(across, along)


def _require_force(asked: Numbers, away: list[float], goes_on: bool, limits: Limits) -> None:
    """Check that stiffness times error is within the force limit; if a motion that goes on exceeds it, the arm is blocked."""
    # F = |(K_x e_x, K_y e_y, K_z e_z)|
    (kx, ky, kz), (x, y, z) = asked.pushing, away
    force = math.hypot(kx * x, ky * y, kz * z)
    if force > limits.force:
        found = f"{1e3 * math.hypot(x, y, z):.0f} mm away presses with {force:.0f} N; limits.force = {limits.force:g} N allowed"
        if not goes_on:
            raise SetpointError(f"setpoint: {found}")
        raise TrackingError(f"arm: blocked, or its setpoint cannot be reached: a setpoint {found}")


def _require_beginning(asked: Numbers, away: float, before: Handed | None, stamp: float, most: float) -> None:
    """Check that a new motion starts near the arm, or near the previous setpoint."""
    if away <= LEAD:
        return
    found = f"setpoint: a motion that begins {1e3 * away:.0f} mm from where the arm is"
    if before is None:
        raise SetpointError(f"{found}; at most {1e3 * LEAD:g} mm allowed")
    step, allowed = math.dist(asked.hand, numbers_of(before.setpoint).hand), _longest_step(before, stamp, most)
    if step > allowed:
        raise SetpointError(
            f"{found}, and a step of {1e3 * step:.0f} mm; at most {1e3 * LEAD:g} mm or {1e3 * allowed:.0f} mm allowed"
        )


def _require_posture(asked: Numbers, number: int, arm: ArmState, before: Handed | None, bounds: ArmBounds) -> None:
    """Check that a posture is in the joints' ranges, and that it starts near the joints or continues within their speed limits."""
    if not asked.posture:
        return
    q, last = arm.q.tolist(), None if before is None else before.setpoint.posture
    require_permitted(asked.posture, q, bounds)
    near = [there if k == arm.elbow else at for k, (there, at) in enumerate(zip(asked.posture, q, strict=True))]
    found = _furthest(asked.posture, near, [POSTURE_LEAD] * len(near))
    if before is not None and last is not None and (number == before.setpoint.id or found is not None):
        passed = _time_since(before, arm.stamp)
        allowed = [speed * passed + POSTURE_SLACK for speed in bounds.joint_speeds]
        found = _furthest(asked.posture, last.tolist(), allowed)
    if found is not None:
        joint, step, most = found
        raise SetpointError(
            f"setpoint: posture of joint {joint + 1} moves by {step:.3f} rad; at most {most:.3f} rad allowed"
        )


def _is_same(state: ArmState, other: ArmState) -> bool:
    """Return True if all readings of two states are equal to the last digit."""
    if state.q.tolist() != other.q.tolist() or state.dq.tolist() != other.dq.tolist():
        return False
    same: bool = state.tcp.position.tolist() == other.tcp.position.tolist()
    return same and bool((state.wrench.force == other.wrench.force).all())


def _furthest(posture: list[float], start: list[float], allowed: list[float]) -> tuple[int, float, float] | None:
    """Return the joint that exceeds its permitted step most, its step and its permitted step, rad; None if no joint does."""
    worst, found = 0.0, None
    for joint, (there, was, most) in enumerate(zip(posture, start, allowed, strict=True)):
        step = there - was if there > was else was - there
        if step - most > worst:
            worst, found = step - most, (joint, step, most)
    return found


def _has_same_point(setpoint: ImpedanceSetpoint, before: ImpedanceSetpoint) -> bool:
    """Return True if a setpoint continues the previous motion: same id, and both with a peg or both without."""
    return setpoint.id == before.id and (setpoint.in_hand is None) == (before.in_hand is None)


def _time_since(before: Handed, stamp: float) -> float:
    return min(max(stamp - before.stamp, 0.0), LONGEST_STEP_TIME)


def _longest_step(before: Handed, stamp: float, most: float) -> float:
    """Return the longest permitted step from a setpoint to one at `stamp`, m, for the speed limit `most`, m/s."""
    return most * _time_since(before, stamp) + STEP_SLACK


def _require_inside(asked: Numbers, here: list[float], limits: Limits) -> None:
    """Check that the setpoint of the hand is inside the workspace, or no further outside than the hand is."""
    hand = asked.hand
    worst, axis = 0.0, 0
    for k, (there, low, high) in enumerate(zip(hand, limits.low, limits.high, strict=True)):
        if low <= there <= high:
            continue
        outside = max(low - here[k], here[k] - high, 0.0)
        beyond = max(low - there, there - high) - outside - OUTWARD_SLACK
        if beyond > worst:
            worst, axis = beyond, k
    if worst > 0.0:
        raise SetpointError(
            f"setpoint: hand at {'xyz'[axis]} = {hand[axis]:.3f} m;"
            f" limits: {limits.low[axis]:g} to {limits.high[axis]:g} m allowed"
        )


def _require_step(asked: Numbers, before: Handed, stamp: float, most: float) -> None:
    step, allowed = math.dist(asked.tip, before.setpoint.tip.tolist()), _longest_step(before, stamp, most)
    if step > allowed:
        raise SetpointError(f"setpoint: step of {1e3 * step:.0f} mm; at most {1e3 * allowed:.0f} mm allowed")


class GatedArm:
    """Arm behind the setpoint gate; satisfies `drivers.protocols.Arm`."""

    def __init__(self, arm: Arm, bounds: ArmBounds, limits: Limits) -> None:
        """Store the arm, the bounds of its setpoints, and the limits of force and workspace."""
        self._arm, self._bounds, self._limits = arm, bounds, limits
        self._state: ArmState | None = None
        self._before: Handed | None = None
        self._untaken_since: float | None = None
        """Time of the first setpoint that the arm has not adopted, s; None if it follows the last one sent."""
        self._unchanged: ArmState | None = None
        """First of the newest identical states; None if no setpoint is held."""

    def open(self) -> None:
        """Open the arm."""
        self._arm.open()

    def close(self) -> None:
        """Close the arm."""
        self._arm.close()

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Send a setpoint to the arm if it passes the checks; otherwise halt the arm.

        Raises:
            SetpointError: The setpoint is not finite, outside the workspace, too far, too fast or out of the arm's bounds.
            TrackingError: The arm lags so far behind that the spring would exceed the force limit.
        """
        state = self._state if self._state is not None else self.read()
        try:
            require_sound(setpoint, state, self._before, self._limits, self._bounds)
        except (SetpointError, TrackingError):
            self.halt()
            raise
        self._before = Handed(setpoint, state.stamp)
        self._arm.follow(setpoint)

    def read(self) -> ArmState:
        """Return the newest state.

        Raises:
            NotFiniteError: A reading is not plausible. If the arm follows a setpoint, it is halted once; repeated halts would let it sink
                by the error of its gravity model.
            TrackingError: The arm does not adopt its setpoints; it is halted, once.
            ArmSilentError: The readings do not change while the arm follows a setpoint; it is halted.
            CellError: The arm's own `read` raised it.
        """
        state = self._arm.read()
        try:
            require_readings(state)
        except NotFiniteError:
            if self._before is not None:
                self.halt()
            raise
        self._state = state
        self._require_taken(state)
        self._require_live(state)
        return state

    def _require_taken(self, state: ArmState) -> None:
        """Check that the arm has adopted the last setpoint, while that is valid.

        The lag of the hand is not checked here: a compliant or loaded arm lags although it adopts every setpoint.
        """
        before = self._before
        if before is None or before.setpoint.valid_until < state.stamp:
            self._untaken_since = None
            return
        if state.setpoint_age <= state.stamp - before.stamp + AGE_SLACK:
            self._untaken_since = None
            return
        if self._untaken_since is None:
            self._untaken_since = before.stamp
        untaken = state.stamp - self._untaken_since
        if untaken > LONGEST_UNTAKEN:
            self.halt()
            raise TrackingError(f"arm: takes no setpoint for {untaken:.2f} s; {LONGEST_UNTAKEN:g} s allowed")

    def _require_live(self, state: ArmState) -> None:
        """Check that the readings change while the arm follows a setpoint, at rest too; noise changes at least the last digits."""
        if self._before is None or self._unchanged is None or not _is_same(state, self._unchanged):
            self._unchanged = None if self._before is None else state
            return
        if (time := state.stamp - self._unchanged.stamp) > LONGEST_UNCHANGED:
            self.halt()
            raise ArmSilentError(
                f"arm: readings unchanged to the last digit for {time:.2f} s, while it followed a setpoint"
            )

    def halt(self) -> None:
        """Hold the arm still at its present pose, compliant; the next setpoint is checked as the start of a motion."""
        self._before = self._untaken_since = None
        self._arm.halt()

    def reset(self) -> None:
        """Leave a reflex or a released stop."""
        self._before = self._untaken_since = None
        self._arm.reset()
