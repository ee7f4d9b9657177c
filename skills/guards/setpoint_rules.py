"""Rules of the setpoint gate, compiled: one call checks a packed setpoint against a packed state of the arm; pure.

`broken_rule` returns the number of the first broken rule and the figures of its message. `skills.guards.setpoint_gate` composes
the message. A setpoint is packed by `drivers.setpoint_words.pack`; its `STAMP` is the time of the arm's state used to check it.
"""

import math

import numpy as np

from drivers.compiled import njit
from drivers.quantities import ArmState, Vector
from drivers.setpoint_words import (
    AXIS,
    DAMPING_RATIO,
    HAS_HAND,
    HAS_POSTURE,
    HAS_ROLL,
    ID,
    INTEGRAL_GAIN,
    INTEGRAL_LIMIT,
    LENGTH,
    POSTURE,
    ROLL,
    STAMP,
    STIFFNESS,
    THETA,
    TIP,
    TWIST,
    VALID_UNTIL,
)
from skills.guards.setpoint_bounds import (
    AGE_SLACK,
    LEAD,
    LONGEST_STEP_TIME,
    LONGEST_VALIDITY,
    MOST_ASKEW,
    MOST_DAMPING_RATIO,
    MOST_LENGTH,
    MOST_LOAD,
    MOST_THETA,
    OUTWARD_SLACK,
    POSTURE_LEAD,
    POSTURE_SLACK,
    STEP_SLACK,
    TRACKING_LIMIT,
    UNIT_TOLERANCE,
)

Q, DQ, POSITION, ROTATION, FORCE, TORQUE, COMMANDED, UNEXPLAINED, STATE_STAMP, ELBOW = (
    0,
    7,
    14,
    17,
    26,
    29,
    32,
    39,
    46,
    47,
)
STATE_WORDS = 48
"""Number of words of a packed state of the arm; the constants before it are the indices of the state's parts."""
READINGS = (
    ("joint position", Q, 7, 100.0),
    ("joint velocity", DQ, 7, 1000.0),
    ("TCP position", POSITION, 3, 100.0),
    ("TCP orientation", ROTATION, 9, 2.0),
    ("force", FORCE, 3, MOST_LOAD),
    ("torque", TORQUE, 3, MOST_LOAD),
    ("commanded torque", COMMANDED, 7, MOST_LOAD),
    ("unexplained torque", UNEXPLAINED, 7, MOST_LOAD),
    ("stamp", STATE_STAMP, 1, math.inf),
)
"""Name, index, number and largest plausible value of the readings in a packed state."""
_MOST = np.array([most for _, _, count, most in READINGS for _ in range(count)])

SPEED, TURN_SPEED, STIFF, TURN_STIFF, STRONGEST, WEAKEST, TORQUE_RATE, MOST_FORCE = range(8)
LOW, HIGH, Q_MIN, Q_MAX, JOINT_SPEEDS = 8, 11, 14, 21, 28
BOUND_WORDS = 35
"""Number of words of packed bounds; the constants before it are the indices of their parts: largest values, torques of the strongest
and of the weakest joint, corners of the workspace, ranges and speeds of the joints."""

SOUND, NUMBER, UNIT_AXIS, NEGATIVE, VALIDITY, WORKSPACE, ASKEW, ROLLED, TURNING, JOINT_RANGE, POSTURE_STEP, TIP_STEP = (
    range(12)
)
PRESSING, BLOCKED, LAGGING, FIRST_BEGINNING, BEGINNING = range(12, 17)
RANGE = 17
"""Numbers of the rules; the rules of `RANGES` have the numbers from `RANGE` on."""
RANGES = (
    ("speed", "m/s"),
    ("turning rate", "rad/s"),
    ("stiffness", "N/m"),
    ("rotational stiffness", "N·m/rad"),
    ("damping ratio", ""),
    ("integral_limit", "N·m"),
    ("integral_gain", "N·m/(rad·s)"),
    ("theta in the hand", "rad"),
    ("length in the hand", "m"),
)
"""Name and unit of the values with a permitted range, in the order of their checks."""
Broken = tuple[int, float, float, float]
"""Number of a broken rule, or `SOUND`, and the figures of its message."""


def pack_state(arm: ArmState) -> Vector:
    """Return the readings of an arm as words, shape (STATE_WORDS,); a torque that the arm does not report is 0."""
    words = np.zeros(STATE_WORDS)
    words[Q:DQ], words[DQ:POSITION] = arm.q, arm.dq
    words[POSITION:ROTATION] = arm.tcp.position
    words[ROTATION : ROTATION + 3], words[ROTATION + 3 : ROTATION + 6], words[ROTATION + 6 : FORCE] = arm.tcp.rotation
    words[FORCE:TORQUE], words[TORQUE:COMMANDED] = arm.wrench.force, arm.wrench.torque
    if arm.commanded is not None:
        words[COMMANDED:UNEXPLAINED] = arm.commanded
    if arm.unexplained is not None:
        words[UNEXPLAINED:STATE_STAMP] = arm.unexplained
    words[STATE_STAMP], words[ELBOW] = arm.stamp, arm.elbow
    return words


@njit(cache=True)
def is_plausible(state: Vector) -> bool:  # pragma: no cover
    """Return True if every reading of a packed state is finite and within its bound."""
    is_plausible = True
    for k in range(ELBOW):
        is_plausible = is_plausible and math.isfinite(state[k]) and abs(state[k]) <= _MOST[k]
    return is_plausible


@njit(cache=True)
def broken_rule(asked: Vector, state: Vector, before: Vector, bounds: Vector) -> Broken:  # pragma: no cover
    """Return the number of the first rule that a setpoint breaks, or `SOUND`, and the figures of its message.

    Args:
        asked: The packed setpoint.
        state: The packed state of the arm.
        before: The previous setpoint, packed; its id is NaN if there is none.
        bounds: The packed bounds.
    """
    found = np.zeros(3)
    rule = _broken_value(asked, bounds, found)
    if rule == SOUND:
        rule = _broken_place(asked, state, bounds, found)
    if rule == SOUND:
        rule = _broken_direction(asked, state, bounds, found)
    if rule == SOUND and asked[HAS_POSTURE] > 0.0:
        rule = _broken_posture(asked, state, before, bounds, found)
    if rule == SOUND:
        rule = _broken_motion(asked, state, before, bounds, found)
    return int(rule), found[0], found[1], found[2]


@njit(cache=True, inline="always")
def _size(words: Vector, first: int) -> float:  # pragma: no cover
    """Return the length of the vector of three words from `first` on."""
    size: float = math.sqrt(words[first] ** 2 + words[first + 1] ** 2 + words[first + 2] ** 2)
    return size


@njit(cache=True, inline="always")
def _largest(words: Vector, first: int) -> float:  # pragma: no cover
    """Return the largest of the three words from `first` on."""
    largest: float = max(words[first], words[first + 1], words[first + 2])
    return largest


@njit(cache=True, inline="always")
def _broken_value(asked: Vector, bounds: Vector, found: Vector) -> int:  # pragma: no cover
    """Check that every value is finite and within its bounds; return the number of the first broken rule, or `SOUND`."""
    for k in range(STAMP):
        if not (math.isfinite(asked[k]) or (k == VALID_UNTIL and not math.isnan(asked[k]))):
            return NUMBER
    length = _size(asked, AXIS)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        found[0] = length
        return UNIT_AXIS
    for k in range(STIFFNESS, VALID_UNTIL):
        if asked[k] < 0.0:
            return NEGATIVE
    # The torque of the integral persists, so the weakest joint must bear it. At an error of 1 rad, this torque must grow no
    # faster than the permitted torque rate.
    ranges = (
        (_size(asked, TWIST), 0.0, bounds[SPEED]),
        (_size(asked, TWIST + 3), 0.0, bounds[TURN_SPEED]),
        (_largest(asked, STIFFNESS), 0.0, bounds[STIFF]),
        (_largest(asked, STIFFNESS + 3), 0.0, bounds[TURN_STIFF]),
        (max(_largest(asked, DAMPING_RATIO), _largest(asked, DAMPING_RATIO + 3)), 0.0, MOST_DAMPING_RATIO),
        (asked[INTEGRAL_LIMIT], 0.0, bounds[WEAKEST]),
        (asked[INTEGRAL_GAIN], 0.0, bounds[TORQUE_RATE]),
        (asked[THETA], -MOST_THETA, MOST_THETA),
        (asked[LENGTH], 0.0, MOST_LENGTH),
    )
    for k in range(len(ranges)):
        found[0], found[1], found[2] = ranges[k]
        if not found[1] <= found[0] <= found[2]:
            return RANGE + k
    found[0] = asked[VALID_UNTIL] - asked[STAMP]
    return VALIDITY if found[0] > LONGEST_VALIDITY + AGE_SLACK else SOUND


@njit(cache=True, inline="always")
def _broken_place(asked: Vector, state: Vector, bounds: Vector, found: Vector) -> int:  # pragma: no cover
    """Check that the setpoint of the hand is inside the workspace, or no further outside than the hand is."""
    worst, rule = 0.0, SOUND
    for k in range(3):
        there, here, low, high = (
            asked[TIP + k] + asked[LENGTH] * asked[AXIS + k],
            state[POSITION + k],
            bounds[LOW + k],
            bounds[HIGH + k],
        )
        outside = max(low - here, here - high, 0.0)
        beyond = max(low - there, there - high) - outside - OUTWARD_SLACK
        if not low <= there <= high and beyond > worst:
            worst, rule = beyond, WORKSPACE
            found[0], found[1] = k, there
    return rule


@njit(cache=True, inline="always")
def _broken_direction(asked: Vector, state: Vector, bounds: Vector, found: Vector) -> int:  # pragma: no cover
    """Check the angles from the hand to the setpoint's axis and roll, and that their torque is within the joints' limits."""
    # v = -(cos t·x + sin t·y), as in `drivers.frames.end_point`.
    c, s = math.cos(asked[THETA]), math.sin(asked[THETA])
    x = -c * state[ROTATION] - s * state[ROTATION + 1]
    y = -c * state[ROTATION + 3] - s * state[ROTATION + 4]
    z = -c * state[ROTATION + 6] - s * state[ROTATION + 7]
    # Angle between v and v*: atan2(|v × v*|, v·v*).
    ax, ay, az = asked[AXIS], asked[AXIS + 1], asked[AXIS + 2]
    across = math.sqrt((y * az - z * ay) ** 2 + (z * ax - x * az) ** 2 + (x * ay - y * ax) ** 2)
    askew, rolled = math.atan2(across, x * ax + y * ay + z * az), 0.0
    if asked[HAS_ROLL] > 0.0:
        # Angle about v from the closing axis a to the roll b: atan2(v·(a × b), a·b - (v·a)(v·b)).
        ax, ay, az = state[ROTATION + 2], state[ROTATION + 5], state[ROTATION + 8]
        bx, by, bz = asked[ROLL], asked[ROLL + 1], asked[ROLL + 2]
        across = x * (ay * bz - az * by) + y * (az * bx - ax * bz) + z * (ax * by - ay * bx)
        along = ax * bx + ay * by + az * bz - (x * ax + y * ay + z * az) * (x * bx + y * by + z * bz)
        rolled = abs(math.atan2(across, along))
    turn = math.sqrt(askew**2 + rolled**2)
    torque = turn * _largest(asked, STIFFNESS + 3)
    if askew > MOST_ASKEW:
        found[0] = askew
        return ASKEW
    if rolled > MOST_ASKEW:
        found[0] = rolled
        return ROLLED
    found[0], found[1] = turn, torque
    return TURNING if torque > bounds[STRONGEST] else SOUND


@njit(cache=True, inline="always")
def _time_since(asked: Vector, before: Vector) -> float:  # pragma: no cover
    """Return the time since the previous setpoint for the permitted step, s, at most `LONGEST_STEP_TIME`."""
    passed: float = min(max(asked[STAMP] - before[STAMP], 0.0), LONGEST_STEP_TIME)
    return passed


@njit(cache=True, inline="always")
def _broken_posture(
    asked: Vector, state: Vector, before: Vector, bounds: Vector, found: Vector
) -> int:  # pragma: no cover
    """Check the range and the step of a posture.

    Each joint's value must be in the joint's range, or no further outside than the joint is. If the posture continues a motion, it
    must be within the step that the joints' speed limits permit. The first posture of a motion must be near the joint positions, or
    within that step of the previous posture.
    """
    far, far_joint, far_step, fast, fast_joint = 0.0, -1, 0.0, 0.0, -1
    worst, joint = 0.0, -1
    passed = _time_since(asked, before)
    for k in range(STAMP - POSTURE):
        there, here, low, high = asked[POSTURE + k], state[Q + k], bounds[Q_MIN + k], bounds[Q_MAX + k]
        further = max(low - there, there - high) - max(low - here, here - high, 0.0)
        if not low <= there <= high and further > worst:
            worst, joint = further, k
        step = 0.0 if k == state[ELBOW] else abs(there - here)
        if step - POSTURE_LEAD > far:
            far, far_joint, far_step = step - POSTURE_LEAD, k, step
        step = abs(there - before[POSTURE + k])
        if step - (bounds[JOINT_SPEEDS + k] * passed + POSTURE_SLACK) > fast:
            fast, fast_joint = step - (bounds[JOINT_SPEEDS + k] * passed + POSTURE_SLACK), k
    if joint >= 0:
        found[0] = joint
        return JOINT_RANGE
    if before[HAS_POSTURE] > 0.0 and (asked[ID] == before[ID] or far_joint >= 0):
        found[0] = fast_joint
        found[1] = abs(asked[POSTURE + fast_joint] - before[POSTURE + fast_joint])
        found[2] = bounds[JOINT_SPEEDS + fast_joint] * passed + POSTURE_SLACK
        return POSTURE_STEP if fast_joint >= 0 else SOUND
    found[0], found[1], found[2] = far_joint, far_step, POSTURE_LEAD
    return POSTURE_STEP if far_joint >= 0 else SOUND


@njit(cache=True, inline="always")
def _broken_motion(
    asked: Vector, state: Vector, before: Vector, bounds: Vector, found: Vector
) -> int:  # pragma: no cover
    """Check the step from the previous setpoint, the force of the spring, and the distance of a motion's first setpoint from the arm."""
    c, s = math.cos(asked[THETA]), math.sin(asked[THETA])
    away, force, step, moved = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        # v = -(cos t·x + sin t·y),  x_p = x - length·v,  F = |K (x_p* - x_p)|.
        v = -c * state[ROTATION + 3 * k] - s * state[ROTATION + 3 * k + 1]
        error = asked[TIP + k] - (state[POSITION + k] - asked[LENGTH] * v)
        away += error**2
        force += (asked[STIFFNESS + k] * error) ** 2
        step += (asked[TIP + k] - before[TIP + k]) ** 2
        hand, last = (
            asked[TIP + k] + asked[LENGTH] * asked[AXIS + k],
            before[TIP + k] + before[LENGTH] * before[AXIS + k],
        )
        moved += (hand - last) ** 2
    away, force, step, moved = math.sqrt(away), math.sqrt(force), math.sqrt(step), math.sqrt(moved)
    allowed = bounds[SPEED] * _time_since(asked, before) + STEP_SLACK
    # A setpoint continues a motion if both setpoints have the same id, and both state a pose in the hand or neither does.
    goes_on = asked[ID] == before[ID] and asked[HAS_HAND] == before[HAS_HAND]
    found[0], found[1], found[2] = step, allowed, 0.0
    if goes_on and step > allowed:
        return TIP_STEP
    found[0], found[1] = away, force
    if force > bounds[MOST_FORCE]:
        return BLOCKED if goes_on else PRESSING
    if goes_on and away > TRACKING_LIMIT:
        return LAGGING
    found[1], found[2] = moved, allowed
    if goes_on or away <= LEAD:
        return SOUND
    if math.isnan(before[ID]):
        return FIRST_BEGINNING
    return BEGINNING if moved > allowed else SOUND
