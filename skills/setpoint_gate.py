"""The one gate for what is commanded: every setpoint of a skill passes it before the arm sees it.

`GatedArm` stands between the skills and the arm. What it refuses is beyond anything that a sound skill asks for; the
forces that a skill means to press with are bounded by the skill itself.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.errors import NotFiniteError, SetpointError, TrackingError
from drivers.frames import angle_between, end_point
from drivers.parts import Point
from drivers.protocols import Arm
from drivers.quantities import ArmState, ImpedanceSetpoint, Vector

MOST_ASKEW = 1.0
"""Largest angle between the axis of a setpoint and that of the peg or hand, rad; a sound skill stays below 0.6."""
LONGEST_STEP_TIME = 0.1
"""A step after a longer pause is judged as one after this time, s."""
STEP_SLACK = 1e-3
"""Addition to the longest step, m: an integral or a new frame of the skin may move a setpoint at rest."""
OUTWARD_SLACK = 1e-3
"""A setpoint outside the workspace may be so much further out than the hand, m, on the way back in."""
LONGEST_UNTAKEN = 0.2
"""Longest time for which the arm may report that it follows an older setpoint than it was given, or none, s; its loop takes one in milliseconds.
Source: chosen, not measured; reason in decision 0092.
"""
AGE_SLACK = 1e-3
"""Largest age of the followed setpoint beyond that of the given one, s: two readings of a clock."""
UNIT_TOLERANCE = 1e-3
"""Largest difference between the length of an axis and 1."""


class Limits(ConfigModel):
    """What ends a skill at once; no defaults.

    Source: set for each cell.
    """

    force: Annotated[float, Field(gt=0.0, le=500.0)]
    """Largest estimated external force at the TCP, N."""
    low: Point
    """Lower corner of the workspace that the TCP must stay in, m, base frame."""
    high: Point
    """Upper corner of the workspace that the TCP must stay in, m, base frame."""


@dataclass(frozen=True, slots=True)
class Handed:
    """A setpoint that the arm was given, and when."""

    setpoint: ImpedanceSetpoint
    stamp: float
    """Time of the arm's state that it was judged by, s."""


def require_finite(arm: ArmState) -> None:
    """Make sure that every reading of an arm is finite.

    Raises:
        NotFiniteError: A reading is not finite; one line that names it.
    """
    for name, values in (
        ("joint position", arm.q),
        ("joint velocity", arm.dq),
        ("TCP position", arm.tcp.position),
        ("TCP orientation", arm.tcp.rotation),
        ("force", arm.wrench.force),
        ("torque", arm.wrench.torque),
    ):
        _require_finite("arm", name, values, NotFiniteError)


def require_sound(
    setpoint: ImpedanceSetpoint, arm: ArmState, before: Handed | None, limits: Limits, most: float
) -> None:
    """Make sure that the arm may be given a setpoint.

    Args:
        setpoint: What a skill asks for.
        arm: The newest state of the arm.
        before: The setpoint before it, if any.
        limits: Limits of force and workspace.
        most: Largest speed of the arm's tool, m/s.

    Raises:
        SetpointError: It is no number, outside the workspace, too far or too fast.
        TrackingError: The arm stays so far behind it that it would press with more than the force limit.
    """
    _require_numbers(setpoint)
    _require_inside(setpoint, arm, limits)
    twist = setpoint.twist
    if twist is not None and (speed := _size(twist.linear)) > most:
        raise SetpointError(f"setpoint: speed {speed:.2f} m/s; at most {most:g} m/s allowed")
    theta, length = (0.0, 0.0) if setpoint.in_hand is None else (setpoint.in_hand.theta, setpoint.in_hand.length)
    tip, axis = end_point(arm.tcp, theta, length)
    if (askew := angle_between(axis, setpoint.axis)) > MOST_ASKEW:
        raise SetpointError(f"setpoint: axis {askew:.2f} rad from where it points; at most {MOST_ASKEW} rad allowed")
    goes_on = before is not None and _has_same_point(setpoint, before.setpoint)
    if before is not None and goes_on:
        _require_step(setpoint, before, arm.stamp, most)
    force = _size(setpoint.stiffness[:3] * (setpoint.tip - tip))
    if force > limits.force:
        away = 1e3 * _size(setpoint.tip - tip)
        found = f"{away:.0f} mm away presses with {force:.0f} N; limits.force = {limits.force:g} N allowed"
        if not goes_on:
            raise SetpointError(f"setpoint: {found}")
        raise TrackingError(f"arm: blocked, or its setpoint cannot be reached: a setpoint {found}")


def _has_same_point(setpoint: ImpedanceSetpoint, before: ImpedanceSetpoint) -> bool:
    """Whether a setpoint goes on from the one before it: of the same id, and of peg or bare hand as that was."""
    return setpoint.id == before.id and (setpoint.in_hand is None) == (before.in_hand is None)


def _require_numbers(setpoint: ImpedanceSetpoint) -> None:
    hand, twist = setpoint.in_hand, setpoint.twist
    for name, values in (
        ("tip", setpoint.tip),
        ("axis", setpoint.axis),
        ("stiffness", setpoint.stiffness),
        ("damping ratio", setpoint.damping_ratio),
        ("integral", (setpoint.integral_gain, setpoint.integral_limit)),
        ("theta and length in the hand", () if hand is None else (hand.theta, hand.length)),
        ("roll", () if setpoint.roll is None else setpoint.roll),
        ("twist", () if twist is None else (*twist.linear, *twist.angular)),
        ("posture", () if setpoint.posture is None else setpoint.posture),
    ):
        _require_finite("setpoint", name, values, SetpointError)
    if math.isnan(setpoint.valid_until):
        raise SetpointError("setpoint: valid_until nan; a number allowed")
    if abs(_size(setpoint.axis) - 1.0) > UNIT_TOLERANCE:
        raise SetpointError(f"setpoint: axis of length {_size(setpoint.axis):.3f}; 1 allowed")
    if min(setpoint.stiffness.min(), setpoint.damping_ratio.min()) < 0.0:
        raise SetpointError("setpoint: negative stiffness or damping ratio; at least 0 allowed")


def _require_inside(setpoint: ImpedanceSetpoint, arm: ArmState, limits: Limits) -> None:
    """Make sure that the hand's place is inside the workspace, or on its way back from where the hand is outside."""
    length = 0.0 if setpoint.in_hand is None else setpoint.in_hand.length
    asked = (setpoint.tip + length * setpoint.axis).tolist()
    worst, axis = 0.0, 0
    for k, (there, here, low, high) in enumerate(
        zip(asked, arm.tcp.position.tolist(), limits.low, limits.high, strict=True)
    ):
        beyond = max(low - there, there - high, 0.0) - max(low - here, here - high, 0.0) - OUTWARD_SLACK
        if beyond > worst:
            worst, axis = beyond, k
    if worst > 0.0:
        raise SetpointError(
            f"setpoint: hand at {'xyz'[axis]} = {asked[axis]:.3f} m;"
            f" limits: {limits.low[axis]:g} to {limits.high[axis]:g} m allowed"
        )


def _require_step(setpoint: ImpedanceSetpoint, before: Handed, stamp: float, most: float) -> None:
    step = _size(setpoint.tip - before.setpoint.tip)
    allowed = most * min(max(stamp - before.stamp, 0.0), LONGEST_STEP_TIME) + STEP_SLACK
    if step > allowed:
        raise SetpointError(f"setpoint: step of {1e3 * step:.0f} mm; at most {1e3 * allowed:.0f} mm allowed")


def _require_finite(
    of_what: str, name: str, values: "Vector | tuple[float, ...]", error: type[SetpointError] | type[NotFiniteError]
) -> None:
    # A sum of squares is a number where all its terms are; where it is none a closer look decides, as numbers may be too large for it.
    if all(map(math.isfinite, values)) if isinstance(values, tuple) else math.isfinite(np.vdot(values, values)):
        return
    flat = np.asarray(values, dtype=float).ravel()
    is_finite = np.isfinite(flat)
    if not is_finite.all():
        place = int(np.argmin(is_finite))
        raise error(f"{of_what}: {name} {place + 1} of {flat.size}: {flat[place]}; a number needed")


def _size(vector: Vector) -> float:
    return math.sqrt(float(vector @ vector))


class GatedArm:
    """An arm behind the gate; satisfies `drivers.protocols.Arm`."""

    def __init__(self, arm: Arm, most: float, limits: Limits) -> None:
        """Keep the arm, the largest speed of its tool, m/s, and the limits of force and workspace."""
        self._arm, self._most, self._limits = arm, most, limits
        self._state: ArmState | None = None
        self._before: Handed | None = None
        self._untaken_since: float | None = None
        """Time of the first setpoint that the arm has not taken, s; None where it follows the one that it was given."""

    def open(self) -> None:
        """Open the arm."""
        self._arm.open()

    def close(self) -> None:
        """Close the arm."""
        self._arm.close()

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Hand over a sound setpoint; halt the arm at any other.

        Raises:
            SetpointError: It is no number, outside the workspace, too far or too fast.
            TrackingError: The arm stays so far behind it that it would press with more than the force limit.
        """
        state = self._state if self._state is not None else self.read()
        try:
            require_sound(setpoint, state, self._before, self._limits, self._most)
        except (SetpointError, TrackingError):
            self.halt()
            raise
        self._before = Handed(setpoint, state.stamp)
        self._arm.follow(setpoint)

    def read(self) -> ArmState:
        """Return the newest state.

        Raises:
            NotFiniteError: Something in it is no number; an arm that follows a setpoint is halted, once, for one that is halted
                at every reading sinks by what its model of gravity lacks.
            TrackingError: The arm does not take its setpoints; it is halted, once.
            CellError: The arm's own `read` raised it.
        """
        state = self._arm.read()
        try:
            require_finite(state)
        except NotFiniteError:
            if self._before is not None:
                self.halt()
            raise
        self._state = state
        self._require_taken(state)
        return state

    def _require_taken(self, state: ArmState) -> None:
        """Make sure that the arm follows the setpoint that it was given last, as long as that is valid.

        How far the hand is behind it does not count: a soft, slow or pressed arm lags, and takes every setpoint.
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

    def halt(self) -> None:
        """Hold still where the arm is, compliant; the next setpoint is judged as a new one."""
        self._before = self._untaken_since = None
        self._arm.halt()

    def reset(self) -> None:
        """Leave a reflex or a released stop."""
        self._before = self._untaken_since = None
        self._arm.reset()
