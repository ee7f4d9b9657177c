"""The values that a setpoint may have wherever the arm is: numbers, and no more than the arm may be asked for; pure."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.errors import NotFiniteError, SetpointError
from drivers.quantities import ImpedanceSetpoint, Vector

UNIT_TOLERANCE = 1e-3
"""Largest difference between the length of an axis and 1."""
MOST_DAMPING_RATIO = 10.0
"""Largest damping ratio. A damping that acts 3.6 ms late, as torques do behind 100 Hz and two cycles of transport, lets a hand of 3 kg on 1500 N/m
swing from 9.7 on, a quarter of pi over rate and delay; a sound skill asks for 7.5 at the most.
"""
LONGEST_VALIDITY = 1.0
"""Longest time from the arm's state for which a setpoint may be valid, s: ten scans at the slowest scan rate, 10 Hz, so that an arm whose program
is gone stands within it.
"""
AGE_SLACK = 1e-3
"""Largest difference between two readings of a clock, s."""
MOST_THETA = math.pi
"""Largest in-hand angle, rad; beyond it the same peg has a smaller one."""
MOST_NUMBER = 1e150
"""Largest number whose square is a number."""
MOST_LENGTH = 0.5
"""Largest distance from the finger centre to the peg's end, m: that of `peg.length`."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmBounds:
    """What an arm may be asked for, by its file of figures."""

    speed: float
    """Largest speed of the tool, m/s."""
    turn_speed: float
    """Largest turning rate of the tool, rad/s."""
    stiffness: float
    """Largest translational stiffness, N/m."""
    turn_stiffness: float
    """Largest rotational stiffness, N·m/rad."""
    torques: Vector
    """Largest torque of each joint, shape (7,), N·m."""
    torque_rate: float
    """Largest change of a commanded torque that every joint bears, N·m/s."""
    q_min: Vector
    """Lower end of the permitted joint positions, shape (7,), rad."""
    q_max: Vector
    """Upper end of the permitted joint positions, shape (7,), rad."""
    joint_speeds: Vector
    """Largest speed of each joint, shape (7,), rad/s."""


def require_values(setpoint: ImpedanceSetpoint, stamp: float, bounds: ArmBounds) -> None:
    """Make sure that every value of a setpoint is a number, and that the arm may be asked for it.

    Args:
        setpoint: What a skill asks for.
        stamp: Time of the arm's newest state, s.
        bounds: What the arm may be asked for.

    Raises:
        SetpointError: One line that names the value, what was found and what is allowed.
    """
    _require_numbers(setpoint)
    if abs(size_of(setpoint.axis) - 1.0) > UNIT_TOLERANCE:
        raise SetpointError(f"setpoint: axis of length {size_of(setpoint.axis):.3f}; 1 allowed")
    if min(setpoint.stiffness.min(), setpoint.damping_ratio.min()) < 0.0:
        raise SetpointError("setpoint: negative stiffness or damping ratio; at least 0 allowed")
    hand, twist = setpoint.in_hand, setpoint.twist
    linear, angular = (0.0, 0.0) if twist is None else (size_of(twist.linear), size_of(twist.angular))
    theta, length = (0.0, 0.0) if hand is None else (hand.theta, hand.length)
    valid = setpoint.valid_until - stamp
    for name, value, least, most, unit in (
        ("speed", linear, 0.0, bounds.speed, "m/s"),
        ("turning rate", angular, 0.0, bounds.turn_speed, "rad/s"),
        ("stiffness", float(setpoint.stiffness[:3].max()), 0.0, bounds.stiffness, "N/m"),
        ("rotational stiffness", float(setpoint.stiffness[3:].max()), 0.0, bounds.turn_stiffness, "N·m/rad"),
        ("damping ratio", float(setpoint.damping_ratio.max()), 0.0, MOST_DAMPING_RATIO, ""),
        # What an integral adds lasts, and the weakest joint has to bear it; it grows no faster than torques may, at an error of 1 rad.
        ("integral_limit", setpoint.integral_limit, 0.0, float(bounds.torques.min()), "N·m"),
        ("integral_gain", setpoint.integral_gain, 0.0, bounds.torque_rate, "N·m/(rad·s)"),
        ("theta in the hand", theta, -MOST_THETA, MOST_THETA, "rad"),
        ("length in the hand", length, 0.0, MOST_LENGTH, "m"),
    ):
        if not least <= value <= most:
            raise SetpointError(
                f"setpoint: {name} {value:.4g} {unit}".rstrip() + f"; {least:.4g} to {most:.4g} allowed"
            )
    if valid > LONGEST_VALIDITY + AGE_SLACK:
        raise SetpointError(f"setpoint: valid_until {valid:.2f} s ahead; at most {LONGEST_VALIDITY:g} s allowed")


def require_permitted(posture: Vector, q: Vector, bounds: ArmBounds) -> None:
    """Make sure that a posture lies within the range of every joint, or no further outside than the joint is.

    Args:
        posture: Joint positions that the null space is drawn to, shape (7,), rad.
        q: Joint positions, shape (7,), rad.
        bounds: What the arm may be asked for.

    Raises:
        SetpointError: It does not; one line that names the joint.
    """

    def beyond(joints: Vector) -> Vector:
        return np.maximum(np.maximum(bounds.q_min - joints, joints - bounds.q_max), 0.0)

    further = beyond(posture) - beyond(q)
    joint = int(further.argmax())
    if further[joint] > 0.0:
        raise SetpointError(
            f"setpoint: posture of joint {joint + 1} = {posture[joint]:.3f} rad;"
            f" {bounds.q_min[joint]:g} to {bounds.q_max[joint]:g} allowed"
        )


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
        require_numbers("setpoint", name, values, SetpointError)
    if math.isnan(setpoint.valid_until):
        raise SetpointError("setpoint: valid_until nan; a number allowed")


def require_numbers(
    of_what: str,
    name: str,
    values: "Vector | tuple[float, ...]",
    error: type[SetpointError] | type[NotFiniteError],
    most: float = MOST_NUMBER,
) -> None:
    """Make sure that all values are numbers from -`most` to `most`; `of_what` and `name` say what they are.

    Raises:
        CellError: `error`, with the first that is none.
    """
    # A sum of squares is at most the square of the bound only if each term is; beyond it a closer look decides.
    if (
        all(abs(value) <= most for value in values)
        if isinstance(values, tuple)
        else np.vdot(values, values) <= most * most
    ):
        return
    flat = np.asarray(values, dtype=float).ravel()
    is_sound = np.abs(flat) <= most
    if not is_sound.all():
        place = int(np.argmin(is_sound))
        range_ = "" if most == MOST_NUMBER else f" from {-most:g} to {most:g}"
        raise error(f"{of_what}: {name} {place + 1} of {flat.size}: {flat[place]}; a number{range_} needed")


def size_of(vector: Vector) -> float:
    """Return the length of a vector."""
    return math.sqrt(float(vector @ vector))
