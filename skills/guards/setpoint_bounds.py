"""Bounds of the setpoints of an arm, and checks of single numbers; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.errors import NotFiniteError, SetpointError

UNIT_TOLERANCE = 1e-3
"""Largest difference between the length of an axis and 1."""
MOST_DAMPING_RATIO = 10.0
"""Largest damping ratio. A hand of 3 kg at 1500 N/m oscillates from 9.7 on: pi/4 divided by natural frequency and delay. The delay of
3.6 ms is that of a 100 Hz low-pass and two cycles of transport. The skills request at most 7.5. Source: derived for that delay.
"""
LONGEST_VALIDITY = 1.0
"""Longest validity of a setpoint, s, counted from the time of the arm's state: ten scans at the slowest scan rate, 10 Hz. If the program ends,
the arm stops within this time. Source: chosen, not measured.
"""
AGE_SLACK = 1e-3
"""Largest difference between two readings of a clock, s. Source: chosen, not measured."""
MOST_THETA = math.pi
"""Largest magnitude of an in-hand angle, rad; this range covers every direction of the peg."""
MOST_LENGTH = 0.5
"""Largest distance from the finger centre to the peg's end, m; more than the largest `peg.length`. Source: derived for `peg.length`."""
MOST_ASKEW = 1.0
"""Largest angle between the axis of a setpoint and the axis of the peg or hand, rad; a correct skill stays below 0.6. Source: chosen, not measured."""
LONGEST_STEP_TIME = 0.1
"""Upper bound of the time since the previous setpoint in the permitted step, s; a longer pause does not permit a larger step. Source: chosen, not measured."""
STEP_SLACK = 1e-3
"""Addition to the longest step, m, because an integral or a new frame of the skin can move a setpoint at rest. Source: chosen, not measured."""
LEAD = 0.02
"""Largest distance between a motion's first setpoint and the arm, m; a correct skill starts a push at most 13 mm ahead. Source: chosen, not measured."""
TRACKING_LIMIT = 0.1
"""Largest distance between the controlled point and its setpoint, m; the skills' pushes lead by less than half of it. Source: chosen, not measured."""
POSTURE_SLACK = 0.02
"""Addition to the longest step of a posture, rad. Source: chosen, not measured."""
POSTURE_LEAD = 0.2
"""Largest difference between a motion's first posture and the joint positions, rad: the null-space torque is then 2 N·m, a sixth of a
wrist joint's limit. After a halt, a correct posture differs by 0.1 rad. The elbow's joint has its own goal and no such limit. Source: chosen, not measured.
"""
OUTWARD_SLACK = 1e-3
"""Tolerance for setpoints outside the workspace while the hand returns, m. Source: chosen, not measured."""
MOST_LOAD = 1e4
"""Largest force, N, or torque, N·m, that a sensor of an arm can report; more than ten times the load of arms of this size. Source: chosen, not measured."""


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


def require_numbers(
    of_what: str,
    name: str,
    values: Sequence[float],
    error: type[SetpointError] | type[NotFiniteError],
    most: float = math.inf,
) -> None:
    """Check that all values are finite and from -`most` to `most`; `of_what` and `name` identify them in the message.

    Raises:
        CellError: A value is not finite or is out of range. The error is of the class `error` and names the first such value.
    """
    for place, value in enumerate(values):
        if not (math.isfinite(value) and abs(value) <= most):
            range_ = "" if math.isinf(most) else f" from {-most:g} to {most:g}"
            raise error(f"{of_what}: {name} {place + 1} of {len(values)}: {value}; a number{range_} needed")
