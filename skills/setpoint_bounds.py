"""Bounds on the values of a setpoint that do not depend on the arm's pose; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from drivers.errors import NotFiniteError, SetpointError
from drivers.quantities import ImpedanceSetpoint

UNIT_TOLERANCE = 1e-3
"""Largest difference between the length of an axis and 1."""
MOST_DAMPING_RATIO = 10.0
"""Largest damping ratio. With a delay of 3.6 ms, from torques at 100 Hz and two cycles of transport, a hand of 3 kg at 1500 N/m
oscillates from 9.7 on: pi/4 over natural frequency and delay. The skills request at most 7.5.
"""
LONGEST_VALIDITY = 1.0
"""Longest validity of a setpoint after the arm's state, s: ten scans at the slowest scan rate, 10 Hz. If the program ends, the arm stops
within this time.
"""
AGE_SLACK = 1e-3
"""Largest difference between two readings of a clock, s."""
MOST_THETA = math.pi
"""Largest in-hand angle, rad; a larger angle equals a smaller one of the same peg."""
MOST_LENGTH = 0.5
"""Largest distance from the finger centre to the peg's end, m: that of `peg.length`."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmBounds:
    """Bounds of the setpoints of an arm, from its arm file."""

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
    """Largest rate of the commanded torque permitted for every joint, N·m/s."""
    q_min: tuple[float, ...]
    """Lower end of the permitted joint positions, rad."""
    q_max: tuple[float, ...]
    """Upper end of the permitted joint positions, rad."""
    joint_speeds: tuple[float, ...]
    """Largest speed of each joint, rad/s."""


class Numbers(NamedTuple):
    """A setpoint as plain numbers; an operation on an array of three takes as long as ten on plain numbers."""

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
    """Closing direction; empty if not set, as are twist and posture."""
    linear: list[float]
    angular: list[float]
    posture: list[float]

    @property
    def hand(self) -> list[float]:
        """Position of the finger centre, m, base frame: tip + length · axis."""
        return [at + self.length * along for at, along in zip(self.tip, self.axis, strict=True)]


def numbers_of(setpoint: ImpedanceSetpoint) -> Numbers:
    """Return a setpoint's numbers; theta and length are 0 for an empty hand."""
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
    """Check that every value of a setpoint is finite and within its bounds.

    Args:
        setpoint: Setpoint of a skill.
        numbers: The numbers of `setpoint`.
        stamp: Time of the arm's newest state, s.
        bounds: Bounds of the arm's setpoints.

    Raises:
        SetpointError: A value is out of bounds; the message names it, the value found and the permitted values.
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
        # The integral's torque is lasting, so the weakest joint must bear it. At an error of 1 rad it must grow no faster
        # than the permitted torque rate.
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
    """Check that a posture is within the range of every joint, or no further outside than the joint itself.

    Args:
        posture: Goal of the joint positions in the null space, rad.
        q: Joint positions, rad.
        bounds: Bounds of the arm's setpoints.

    Raises:
        SetpointError: The posture of a joint is out of range; the message names the joint.
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
    """Check that all values are finite and from -`most` to `most`; `of_what` and `name` identify them in the message.

    Raises:
        CellError: A value is not; the error has the type `error` and names the first such value.
    """
    for place, value in enumerate(values):
        if not (math.isfinite(value) and abs(value) <= most):
            range_ = "" if math.isinf(most) else f" from {-most:g} to {most:g}"
            raise error(f"{of_what}: {name} {place + 1} of {len(values)}: {value}; a number{range_} needed")
