"""Setpoint gate: it checks every setpoint of a skill before the arm receives it.

`GatedArm` is between the skills and the arm. It refuses only setpoints beyond any that a correct skill requests. Each skill
bounds its own contact forces.
"""

import math
from collections.abc import Sequence

import numpy as np

from drivers import setpoint_words
from drivers.errors import ArmSilentError, NotFiniteError, SetpointError, TrackingError
from drivers.protocols import Arm
from drivers.quantities import ArmState, ImpedanceSetpoint, Vector
from skills.guards import setpoint_rules as rules
from skills.guards.deviation import energy
from skills.guards.limits import Limits
from skills.guards.setpoint_bounds import (
    AGE_SLACK,
    LEAD,
    LONGEST_VALIDITY,
    MOST_ASKEW,
    TRACKING_LIMIT,
    ArmBounds,
    require_numbers,
)

LONGEST_UNTAKEN = 0.2
"""Longest time for which the arm may report that it follows an older setpoint than the last one sent, or no setpoint, s; its control loop
takes milliseconds. Source: chosen, not measured; reason in decision 0013.
"""


LONGEST_UNCHANGED = 0.15
"""Longest time for which readings of an arm may be identical to the last digit, s: 15 scans at 100 Hz, and a fault within 0.2 s. If the force
has noise, only the force counts. If it has none, all readings count while the setpoint moves. A force of exactly zero has no noise: libfranka#25.
Source: chosen, not measured.
"""
MOVED, TURNED = 5e-4, 5e-3
"""Distance, m, and angle, rad, above which a setpoint has moved since an earlier one. The spring then pushes the hand with 0.2 N or turns it with
0.2 N·m more, so that a live arm reports another position or force. At rest, readings can be identical: the makers publish neither resolution nor
noise of joint positions (franka_ros#112). Source: chosen, not measured.
"""


NOTHING = np.full(setpoint_words.WORDS, math.nan)
"""Words of the previous setpoint if there is none."""
_NUMBERS = (
    ("tip", setpoint_words.TIP, 3),
    ("axis", setpoint_words.AXIS, 3),
    ("stiffness", setpoint_words.STIFFNESS, 6),
    ("damping ratio", setpoint_words.DAMPING_RATIO, 6),
    ("integral", setpoint_words.INTEGRAL_GAIN, 2),
    ("theta and length in the hand", setpoint_words.THETA, 2),
    ("roll", setpoint_words.ROLL, 3),
    ("twist", setpoint_words.TWIST, 6),
    ("posture", setpoint_words.POSTURE, 7),
)
"""Name, index and number of the values of a packed setpoint that must be finite."""


def pack_bounds(bounds: ArmBounds, limits: Limits) -> Vector:
    """Return the bounds of an arm's setpoints and the limits of force and workspace as words, shape (BOUND_WORDS,)."""
    single = bounds.speed, bounds.turn_speed, bounds.stiffness, bounds.turn_stiffness
    torques = max(bounds.torques), min(bounds.torques), bounds.torque_rate
    joints = *bounds.q_min, *bounds.q_max, *bounds.joint_speeds
    return np.array([*single, *torques, limits.force, *limits.low, *limits.high, *joints])


def require_readings(state: Vector) -> None:
    """Check that every reading of an arm is plausible; `state` is packed by `pack_state`.

    Raises:
        NotFiniteError: A reading is not plausible; the message names the first one.
    """
    for name, first, count, most in rules.READINGS:
        require_numbers("arm", name, state[first : first + count].tolist(), NotFiniteError, most)


def require_sound(asked: Vector, state: Vector, before: Vector, bounds: Vector) -> None:
    """Check that a setpoint may be sent to the arm.

    Args:
        asked: Setpoint of a skill, packed by `drivers.setpoint_words.pack` with the stamp of the arm's state.
        state: The newest state of the arm, packed by `pack_state`.
        before: The previous setpoint, packed at its time; `NOTHING` if there is none.
        bounds: Bounds of the arm's setpoints, packed by `pack_bounds`.

    Raises:
        SetpointError: The setpoint is not finite, outside the workspace, too far, too fast or out of the arm's bounds.
        TrackingError: The arm lags too far behind, or so far that the spring would exceed the force limit.
    """
    rule, *found = rules.broken_rule(asked, state, before, bounds)
    if rule:
        if rule == rules.NUMBER:
            _require_numbers(asked)
        message = _message(rule, asked, bounds, found)
        if rule in (rules.BLOCKED, rules.LAGGING):
            raise TrackingError(f"arm: blocked, or its setpoint cannot be reached: a setpoint {message}")
        raise SetpointError(f"setpoint: {message}")


def _require_numbers(asked: Vector) -> None:
    for name, first, count in _NUMBERS:
        require_numbers("setpoint", name, asked[first : first + count].tolist(), SetpointError)


def _message(rule: int, asked: Vector, bounds: Vector, found: Sequence[float]) -> str:
    """Return the message for a broken rule: the requested value and the permitted values."""
    if rule >= rules.RANGE:
        (name, unit), (value, least, most) = rules.RANGES[rule - rules.RANGE], found
        return f"{name} {value:.4g} {unit}".rstrip() + f"; {least:.4g} to {most:.4g} allowed"
    a, b, c = found
    force, strongest = bounds[rules.MOST_FORCE], bounds[rules.STRONGEST]
    pressing = f"{1e3 * a:.0f} mm away presses with {b:.0f} N; limits.force = {force:g} N allowed"
    begins = f"a motion that begins {1e3 * a:.0f} mm from where the arm is"
    # In these rules the first figure is the index of an axis or a joint.
    k = int(a) if rule in (rules.WORKSPACE, rules.JOINT_RANGE, rules.POSTURE_STEP) else 0
    low, high = bounds[rules.LOW + k % 3], bounds[rules.HIGH + k % 3]
    least, most = bounds[rules.Q_MIN + k], bounds[rules.Q_MAX + k]
    messages: dict[int, str] = {
        rules.NUMBER: "valid_until nan; a number allowed",
        rules.UNIT_AXIS: f"axis of length {a:.3f}; 1 allowed",
        rules.NEGATIVE: "negative stiffness or damping ratio; at least 0 allowed",
        rules.VALIDITY: f"valid_until {a:.2f} s ahead; at most {LONGEST_VALIDITY:g} s allowed",
        rules.WORKSPACE: f"hand at {'xyz'[k % 3]} = {b:.3f} m; limits: {low:g} to {high:g} m allowed",
        rules.ASKEW: f"axis {a:.2f} rad from where it points; at most {MOST_ASKEW} rad allowed",
        rules.ROLLED: f"roll {a:.2f} rad from the closing axis; at most {MOST_ASKEW} rad allowed",
        rules.TURNING: f"{a:.2f} rad askew turns with {b:.0f} N·m; at most {strongest:g} N·m allowed",
        rules.JOINT_RANGE: f"posture of joint {k + 1} = {asked[setpoint_words.POSTURE + k]:.3f} rad; {least:g} to {most:g} allowed",
        rules.POSTURE_STEP: f"posture of joint {k + 1} moves by {b:.3f} rad; at most {c:.3f} rad allowed",
        rules.TIP_STEP: f"step of {1e3 * a:.0f} mm; at most {1e3 * b:.0f} mm allowed",
        rules.PRESSING: pressing,
        rules.BLOCKED: pressing,
        rules.LAGGING: f"{1e3 * a:.0f} mm from the controlled point; at most {1e3 * TRACKING_LIMIT:.0f} mm allowed",
        rules.FIRST_BEGINNING: f"{begins}; at most {1e3 * LEAD:g} mm allowed",
        rules.BEGINNING: f"{begins}, and a step of {1e3 * b:.0f} mm; at most {1e3 * LEAD:g} mm or {1e3 * c:.0f} mm allowed",
    }
    return messages[rule]


def _has_moved(first: Vector, held: Vector) -> bool:
    """Return True if a setpoint differs from an earlier one by more than `MOVED` or `TURNED`."""
    tip, axis, roll = (
        held[k : k + 3] - first[k : k + 3] for k in (setpoint_words.TIP, setpoint_words.AXIS, setpoint_words.ROLL)
    )
    return bool(np.linalg.norm(tip) > MOVED or np.linalg.norm(axis) > TURNED or np.linalg.norm(roll) > TURNED)


class GatedArm:
    """Arm behind the setpoint gate; satisfies `drivers.protocols.Arm`."""

    def __init__(self, arm: Arm, bounds: ArmBounds, limits: Limits) -> None:
        """Store the arm, the bounds of its setpoints, and the limits of force and workspace."""
        self._arm, self._bounds = arm, pack_bounds(bounds, limits)
        self._state: Vector | None = None
        """Words of the newest state; None before the first."""
        self._before = NOTHING
        """Words of the last setpoint sent, with the time of the arm's state used to check it."""
        self._untaken_since: float | None = None
        """Time of the first setpoint that the arm has not adopted, s; None if the arm follows the last setpoint sent."""
        self._unchanged: tuple[list[float], float, Vector] | None = None
        """Readings, time, s, and setpoint of the first state with the present readings; None if they are not compared yet."""
        self._is_noisy: bool | None = None
        """True if the force differed between the first two readings, which shows noise of torque sensors; None before the second."""
        # The first calls of a process compile code, which must not happen while the arm moves.
        rules.is_plausible(np.zeros(rules.STATE_WORDS))
        rules.broken_rule(NOTHING, np.zeros(rules.STATE_WORDS), NOTHING, self._bounds)
        still = np.zeros(3), np.eye(3)
        energy(np.zeros(6), np.zeros(3), np.zeros(3), 0.0, 0.0, *still, *still, 1.0, limits.force)

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
            TrackingError: The arm lags too far behind, or so far that the spring would exceed the force limit.
        """
        state = self._state
        if state is None:
            state = rules.pack_state(self.read())
        asked = setpoint_words.pack(setpoint, state[rules.STATE_STAMP])
        try:
            require_sound(asked, state, self._before, self._bounds)
        except (SetpointError, TrackingError):
            self.halt()
            raise
        self._before = asked
        self._arm.follow(setpoint)

    def read(self) -> ArmState:
        """Return the newest state.

        Raises:
            NotFiniteError: A reading is not plausible; the gate halts the arm, once.
            TrackingError: The arm does not adopt its setpoints; the gate halts the arm, once.
            ArmSilentError: The force is unchanged although it has noise, or all readings are unchanged although the setpoint moves;
                the gate halts the arm, once.
            CellError: The `read` of the arm itself raised it.
        """
        state = self._arm.read()
        words = rules.pack_state(state)
        if not rules.is_plausible(words):
            self._halt_once()
            require_readings(words)
        if self._is_noisy is None and self._state is not None and state.stamp > self._state[rules.STATE_STAMP]:
            force = slice(rules.FORCE, rules.TORQUE)
            self._is_noisy = bool((words[force] != self._state[force]).any())
        self._state = words
        self._require_taken(state)
        self._require_live(words, state.stamp)
        return state

    def _require_taken(self, state: ArmState) -> None:
        """Check that the arm has adopted the last setpoint, as long as this setpoint is valid.

        The lag of the hand is not checked here: a compliant or loaded arm lags although it adopts every setpoint.
        """
        before, handed = self._before, self._before[setpoint_words.STAMP]
        if before is NOTHING or before[setpoint_words.VALID_UNTIL] < state.stamp:
            self._untaken_since = None
            return
        if state.setpoint_age <= state.stamp - handed + AGE_SLACK:
            self._untaken_since = None
            return
        if self._untaken_since is None:
            self._untaken_since = handed
        untaken = state.stamp - self._untaken_since
        if untaken > LONGEST_UNTAKEN:
            self.halt()
            raise TrackingError(f"arm: adopted no setpoint for {untaken:.2f} s; {LONGEST_UNTAKEN:g} s allowed")

    def _require_live(self, words: Vector, stamp: float) -> None:
        """Check that the readings change: the force if it has noise, even at rest; otherwise all readings while the setpoint moves."""
        held, force = self._before, words[rules.FORCE : rules.TORQUE].tolist()
        is_noisy = self._is_noisy and force != [0.0, 0.0, 0.0]
        if held is NOTHING and not is_noisy:
            self._unchanged = None
            return
        readings = force if is_noisy else words[: rules.TORQUE].tolist()
        if self._unchanged is None or readings != self._unchanged[0]:
            self._unchanged = readings, stamp, held
            return
        _, since, first = self._unchanged
        if (time := stamp - since) > LONGEST_UNCHANGED and (is_noisy or _has_moved(first, held)):
            self._halt_once()
            raise ArmSilentError(f"arm: readings unchanged to the last digit for {time:.2f} s")

    def _halt_once(self) -> None:
        """Halt the arm only if it follows a setpoint; repeated halts would let it sink by the error of its gravity model."""
        if self._before is not NOTHING:
            self.halt()

    def halt(self) -> None:
        """Hold the arm still at its present pose, compliant; the next setpoint is checked as the start of a motion."""
        self._before, self._untaken_since = NOTHING, None
        self._arm.halt()

    def reset(self) -> None:
        """Leave a reflex or a released stop."""
        self._before, self._untaken_since = NOTHING, None
        self._arm.reset()
