"""The values that a setpoint may have wherever the arm is: numbers, and no more than the arm may be asked for; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from drivers.errors import NotFiniteError, SetpointError
from drivers.quantities import ImpedanceSetpoint

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
    torques: tuple[float, ...]
    """Largest torque of each joint, N·m."""
    torque_rate: float
    """Largest change of a commanded torque that every joint bears, N·m/s."""
    q_min: tuple[float, ...]
    """Lower end of the permitted joint positions, rad."""
    q_max: tuple[float, ...]
    """Upper end of the permitted joint positions, rad."""
    joint_speeds: tuple[float, ...]
    """Largest speed of each joint, rad/s."""


class Numbers(NamedTuple):
    """A setpoint as plain numbers, because each operation on an array of three costs as much as ten of theirs."""

    tip: list[float]
    axis: list[float]
    pushing: list[float]
    """Translational stiffness, N/m."""
    turning: list[float]
    """Rotational stiffness, N·m/rad."""
    damping_ratio: list[float]
    theta: float
    length: float
    roll: list[float]
    """Closing direction; empty where none is asked for, as twist and posture are."""
    linear: list[float]
    angular: list[float]
    posture: list[float]

    @property
    def hand(self) -> list[float]:
        """Place of the hand, m, base frame."""
        return [at + self.length * along for at, along in zip(self.tip, self.axis, strict=True)]


def numbers_of(setpoint: ImpedanceSetpoint) -> Numbers:
    """Return a setpoint's numbers; those of the peg in the hand are 0 for a bare hand."""
    hand, twist = setpoint.in_hand, setpoint.twist
    stiffness = setpoint.stiffness.tolist()
    return Numbers(
        setpoint.tip.tolist(),
        setpoint.axis.tolist(),
        stiffness[:3],
        stiffness[3:],
        setpoint.damping_ratio.tolist(),
        0.0 if hand is None else hand.theta,
        0.0 if hand is None else hand.length,
        [] if setpoint.roll is None else setpoint.roll.tolist(),
        [] if twist is None else twist.linear.tolist(),
        [] if twist is None else twist.angular.tolist(),
        [] if setpoint.posture is None else setpoint.posture.tolist(),
    )


def require_values(setpoint: ImpedanceSetpoint, numbers: Numbers, stamp: float, bounds: ArmBounds) -> None:
    """Make sure that every value of a setpoint is a number, and that the arm may be asked for it.

    Args:
        setpoint: What a skill asks for.
        numbers: Its numbers.
        stamp: Time of the arm's newest state, s.
        bounds: What the arm may be asked for.

    Raises:
        SetpointError: One line that names the value, what was found and what is allowed.
    """
    _require_numbers(setpoint, numbers)
    if abs(math.hypot(*numbers.axis) - 1.0) > UNIT_TOLERANCE:
        raise SetpointError(f"setpoint: axis of length {math.hypot(*numbers.axis):.3f}; 1 allowed")
    if min(*numbers.pushing, *numbers.turning, *numbers.damping_ratio) < 0.0:
        raise SetpointError("setpoint: negative stiffness or damping ratio; at least 0 allowed")
    valid = setpoint.valid_until - stamp
    for name, value, least, most, unit in (
        ("speed", math.hypot(*numbers.linear), 0.0, bounds.speed, "m/s"),
        ("turning rate", math.hypot(*numbers.angular), 0.0, bounds.turn_speed, "rad/s"),
        ("stiffness", max(numbers.pushing), 0.0, bounds.stiffness, "N/m"),
        ("rotational stiffness", max(numbers.turning), 0.0, bounds.turn_stiffness, "N·m/rad"),
        ("damping ratio", max(numbers.damping_ratio), 0.0, MOST_DAMPING_RATIO, ""),
        # What an integral adds lasts, and the weakest joint has to bear it; it grows no faster than torques may, at an error of 1 rad.
        ("integral_limit", setpoint.integral_limit, 0.0, min(bounds.torques), "N·m"),
        ("integral_gain", setpoint.integral_gain, 0.0, bounds.torque_rate, "N·m/(rad·s)"),
        ("theta in the hand", numbers.theta, -MOST_THETA, MOST_THETA, "rad"),
        ("length in the hand", numbers.length, 0.0, MOST_LENGTH, "m"),
    ):
        if not least <= value <= most:
            raise SetpointError(
                f"setpoint: {name} {value:.4g} {unit}".rstrip() + f"; {least:.4g} to {most:.4g} allowed"
            )
    if valid > LONGEST_VALIDITY + AGE_SLACK:
        raise SetpointError(f"setpoint: valid_until {valid:.2f} s ahead; at most {LONGEST_VALIDITY:g} s allowed")


def require_permitted(posture: Sequence[float], q: Sequence[float], bounds: ArmBounds) -> None:
    """Make sure that a posture lies within the range of every joint, or no further outside than the joint is.

    Args:
        posture: Joint positions that the null space is drawn to, rad.
        q: Joint positions, rad.
        bounds: What the arm may be asked for.

    Raises:
        SetpointError: It does not; one line that names the joint.
    """
    worst, joint = 0.0, -1
    for k, (there, here, low, high) in enumerate(zip(posture, q, bounds.q_min, bounds.q_max, strict=True)):
        if low <= there <= high:
            continue
        further = max(low - there, there - high) - max(low - here, here - high, 0.0)
        if further > worst:
            worst, joint = further, k
    if joint >= 0:
        raise SetpointError(
            f"setpoint: posture of joint {joint + 1} = {posture[joint]:.3f} rad;"
            f" {bounds.q_min[joint]:g} to {bounds.q_max[joint]:g} allowed"
        )


def _require_numbers(setpoint: ImpedanceSetpoint, numbers: Numbers) -> None:
    tip, axis, pushing, turning, damping_ratio, theta, length, roll, linear, angular, posture = numbers
    integral = [setpoint.integral_gain, setpoint.integral_limit]
    all_of_them = [*tip, *axis, *pushing, *turning, *damping_ratio, *integral, theta, length]
    if not math.isfinite(sum(all_of_them + roll + linear + angular + posture)):
        for name, values in (
            ("tip", tip),
            ("axis", axis),
            ("stiffness", pushing + turning),
            ("damping ratio", damping_ratio),
            ("integral", integral),
            ("theta and length in the hand", [theta, length]),
            ("roll", roll),
            ("twist", linear + angular),
            ("posture", posture),
        ):
            require_numbers("setpoint", name, values, SetpointError)
    if math.isnan(setpoint.valid_until):
        raise SetpointError("setpoint: valid_until nan; a number allowed")


def require_numbers(
    of_what: str,
    name: str,
    values: Sequence[float],
    error: type[SetpointError] | type[NotFiniteError],
    most: float = math.inf,
) -> None:
    """Make sure that all values are finite and from -`most` to `most`; `of_what` and `name` say what they are.

    Raises:
        CellError: `error`, with the first that is not.
    """
    for place, value in enumerate(values):
        if not (math.isfinite(value) and abs(value) <= most):
            range_ = "" if math.isinf(most) else f" from {-most:g} to {most:g}"
            raise error(f"{of_what}: {name} {place + 1} of {len(values)}: {value}; a number{range_} needed")
