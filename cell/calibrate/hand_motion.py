"""Motion of an arm by a person: guided by hand, or jogged by held keys; pure except `moved_by_keys`."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cell.calibrate.keys import END, Keys
from cell.devices.assembly import Cell, bounds_of
from drivers.errors import TrackingError
from drivers.frames import quaternion, rotation_by
from drivers.quantities import ArmState, ImpedanceSetpoint, Pose, Twist, Vector
from skills.catalogue import GRASP
from skills.guards.limits import Limits
from skills.guards.setpoint_gate import GatedArm
from skills.motion import VALIDITY

DIRECTIONS = {
    sign(axis): sense * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sense, sign in ((1, str.lower), (-1, str.upper))
}
"""Direction of motion of each key, base frame."""
GRIP, OPEN = "g", "o"
"""Keys that close and open the fingers."""
JOG_SPEED = 0.02
"""Speed of the tool while a key is held, m/s."""
DEAD_MAN = 0.2
"""Time after a key press during which the tool moves, s; a held key repeats faster."""
GUIDE_SPEED = 0.15
"""Largest speed of the setpoint as it follows the hand, m/s; above it, the arm resists."""
MOST_FORCE = 30.0
"""Largest force between setpoint and hand, N."""
STIFFNESS, TURN_STIFFNESS = 1000.0, 25.0
"""Stiffness between setpoint and hand, N/m and N·m/rad."""
YIELD, TURN_YIELD = 6.0, 1.0
"""Force, N, and torque, N·m, above which the setpoint follows; they must exceed friction and gravity residual, or the arm sinks."""


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Commanded pose of the hand."""

    pose: Pose
    velocity: Vector
    """Velocity of the pose's origin, shape (3,), m/s."""

    def setpoint(self, number: int, stamp: float, until: float) -> ImpedanceSetpoint:
        """Return the setpoint of a motion, valid until the time `until`, s."""
        return ImpedanceSetpoint(
            id=number,
            tip=self.pose.position,
            axis=-self.pose.rotation[:, 0],
            roll=self.pose.rotation[:, 2],
            stiffness=np.array([STIFFNESS] * 3 + [TURN_STIFFNESS] * 3),
            damping_ratio=np.ones(6),
            valid_until=min(until, stamp + VALIDITY),
            twist=Twist(self.velocity, np.zeros(3)),
        )


def guided(held: Held, hand: Pose, step: float, limits: Limits) -> Held:
    """Return the commanded pose after guiding for `step`, s; above the yield force it follows the hand, within speed and workspace.

    dx = min(|e| - F/K, v_max dt) e/|e|, e = x_hand - x_held; the same for the rotation vector between the two.
    """
    e = hand.position - held.pose.position
    moved = _beyond(e, YIELD / STIFFNESS, GUIDE_SPEED * step)
    position = _inside(held.pose.position + moved, held.pose.position, limits)
    w, *v = quaternion(hand.rotation @ held.pose.rotation.T)
    sine = math.hypot(*v)
    turn = 2.0 * math.atan2(sine, w) / sine * np.array(v) if sine > 0.0 else np.zeros(3)
    # Largest angular rate of the setpoint as it follows the hand, rad/s.
    rotation = rotation_by(_beyond(turn, TURN_YIELD / TURN_STIFFNESS, 0.5 * step)) @ held.pose.rotation
    return Held(Pose(position, rotation), (position - held.pose.position) / step)


def jogged(held: Held, hand: Pose, direction: Vector, step: float, limits: Limits) -> Held:
    """Return the commanded pose after a key was held for `step`, s; the force limit bounds its distance from the hand."""
    position = _inside(held.pose.position + JOG_SPEED * step * direction, held.pose.position, limits)
    if float(np.linalg.norm(position - hand.position)) * STIFFNESS > 0.5 * MOST_FORCE:
        position = held.pose.position
    return Held(Pose(position, held.pose.rotation), (position - held.pose.position) / step)


def _beyond(error: Vector, slack: float, most: float) -> Vector:
    """Return the part of an error that exceeds `slack`, with a length of at most `most`."""
    size = float(np.linalg.norm(error))
    if size <= slack:
        return np.zeros(3)
    part: Vector = min(size - slack, most) / size * error
    return part


def _inside(position: Vector, before: Vector, limits: Limits) -> Vector:
    """Return the point of the workspace nearest to a position; if `before` is outside, the point is no further outside than `before`."""
    inside: Vector = np.clip(position, np.minimum(limits.low, before), np.maximum(limits.high, before))
    return inside


def moved_by_keys(cell: Cell, keys: Keys, act: Callable[[str, ArmState], bool], is_guided: bool) -> None:
    """Let a person move the arm until a key ends the motion; then halt the arm.

    Args:
        cell: The cell, with arm and gripper open.
        keys: Keys of the person.
        act: Function called with every key that is not a direction; returns False to end.
        is_guided: True if the arm follows the guiding hand while no key is pressed; else it holds its pose.

    Raises:
        TrackingError: The person moves the hand too fast, or against too much force.
        CellError: The arm times out or is stopped.
    """
    config, clock = cell.config, cell.clock
    limits = config.limits.model_copy(update={"force": min(config.limits.force, MOST_FORCE)})
    arm, period = GatedArm(cell.arm, bounds_of(config.arm_model()), limits), 1.0 / config.scan_rate
    held, number, until, direction, before = None, 0, -math.inf, np.zeros(3), None
    try:
        while True:  # one scan per turn; long, so that all that moves the arm is in one place
            state = arm.read()
            now = clock.now()
            _require_slow(state, before)
            before = state
            key = keys.next(now > until)
            if key in DIRECTIONS:
                direction, until = DIRECTIONS[key], now + DEAD_MAN
            elif not _pressed(key, cell, state, act):
                return
            if now > until and not is_guided:
                held = None
            else:
                if held is None:
                    held, number = Held(state.tcp, np.zeros(3)), number + 1
                if now <= until:
                    held = jogged(held, state.tcp, direction, period, limits)
                    arm.follow(held.setpoint(number, now, until))
                else:
                    held = guided(held, state.tcp, period, limits)
                    arm.follow(held.setpoint(number, now, math.inf))
            clock.wait_until(now + period)
    finally:
        arm.halt()


def _pressed(key: str, cell: Cell, state: ArmState, act: Callable[[str, ArmState], bool]) -> bool:
    """Carry out a key that is not a direction; return False if it ends the motion."""
    grasp = cell.config.params(GRASP)
    if key == GRIP:
        cell.gripper.grip(grasp.force)
    elif key == OPEN:
        cell.gripper.release(grasp.opening)
    else:
        return key != END and (not key or act(key, state))
    return True


def _require_slow(state: ArmState, before: ArmState | None) -> None:
    most_speed = 0.4  # Speed of the tool above which guiding ends, m/s.
    if before is None or state.stamp <= before.stamp:
        return
    speed = float(np.linalg.norm(state.tcp.position - before.tcp.position)) / (state.stamp - before.stamp)
    if speed > most_speed:
        raise TrackingError(f"arm: the tool is moved at {speed:.2f} m/s by hand; {most_speed:g} m/s allowed")
