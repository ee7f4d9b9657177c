"""Measured and commanded quantities: frozen values in SI units; each docstring names the frame."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

FINGERS = 2
FINGER_NAMES = ("left", "right")
WIDTH_TOLERANCE = 0.0015
"""Largest difference between the pads' distance and the peg's width if the peg is between the pads, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Position and orientation of a frame, written `T_<in>_<of>`."""

    position: Vector
    """Origin of the frame, shape (3,), m."""
    rotation: Vector
    """Axes of the frame as columns, shape (3, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Twist:
    """Velocity of a frame."""

    linear: Vector
    """Linear velocity, shape (3,), m/s, base frame."""
    angular: Vector
    """Angular velocity, shape (3,), rad/s, base frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Wrench:
    """Force and torque, both in the base frame; the torque is about the origin of the named frame."""

    force: Vector
    """Force, shape (3,), N, base frame."""
    torque: Vector
    """Torque about the origin of the named frame, shape (3,), N·m, base frame."""


@dataclass(frozen=True, slots=True, eq=False)
class TaxelFrame:
    """Readings of all taxels of both fingers at one instant, with the baseline removed."""

    values: Vector
    """Readings, signed counts, shape (2, n), left finger first; positive is pressure."""
    trusted: Mask
    """False if a taxel is dead, stuck, saturated or marks an error, shape (2, n)."""
    stamp: float
    """Time of the measurement on the cell's clock, s."""
    sequence: int
    """Number of the frame, counted since the skin was opened."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmState:
    """State of the arm, as the robot controller reports it."""

    stamp: float
    """Time of the state on the cell's clock, s."""
    q: Vector
    """Joint positions, shape (7,), rad."""
    dq: Vector
    """Joint velocities, shape (7,), rad/s."""
    tcp: Pose
    """T_base_tcp, the pose of the finger frame; its origin lies between the pads' centres, x points out of the hand, z
    along the closing axis.
    """
    wrench: Wrench
    """Estimated wrench of the environment on the hand, at the TCP, base frame; when the hand presses down, the force is along +z."""
    elbow: int
    """Index in `q` of the joint that turns the elbow."""
    setpoint_age: float
    """Time since the handover of the held setpoint, s; infinite if none is held."""
    commanded: Vector | None = None
    """Joint torques of the law's last command, without the arm's own gravity compensation, shape (7,), N·m; None if the
    arm does not report them.
    """
    unexplained: Vector | None = None
    """Commanded joint torque that did not become motion of the arm's model, low-passed, shape (7,), N·m: friction, the residual of
    gravity compensation, contact. None if the arm does not report it.
    """

    def posture(self, elbow: float) -> Vector:
        """Return the joint positions with the elbow's joint at `elbow`, rad, shape (7,)."""
        drawn = self.q.copy()
        drawn[self.elbow] = elbow
        return drawn


@dataclass(frozen=True, slots=True)
class InHandTip:
    """Estimated place of the peg's end point in the finger frame, from the skin."""

    theta: float
    """In-hand angle about the closing axis, rad; at 0 the peg points straight out of the hand."""
    length: float
    """Distance from the finger centre to the end point, m."""


@dataclass(frozen=True, slots=True, eq=False)
class ImpedanceSetpoint:
    """Impedance setpoint for the arm, valid until the next one; see `drivers.impedance` for the law."""

    id: int
    """Number of the motion; a new one resets the integral."""
    tip: Vector
    """Setpoint x_p* of the controlled point, shape (3,), m, base frame."""
    axis: Vector
    """Setpoint v* of the peg's axis, from the tip to the finger, unit, shape (3,), base frame."""
    stiffness: Vector
    """Stiffness: three translational values, N/m, and three rotational ones, N·m/rad, shape (6,), base frame."""
    damping_ratio: Vector
    """Damping ratios in the order of the stiffness, shape (6,); 1 is critical for the arm's inertia in its present pose."""
    valid_until: float
    """Time on the cell's clock after which the arm holds still, compliant, s."""
    in_hand: InHandTip | None = None
    """Place of the peg's end point in the hand; None controls the bare TCP, with -x of the finger frame as the axis."""
    roll: Vector | None = None
    """Setpoint of the closing axis, shape (3,), base frame; only its component normal to the peg's axis counts. None leaves
    the rotation about the peg's axis free.
    """
    twist: Twist | None = None
    """Feed-forward twist of the setpoint; None means at rest."""
    integral_gain: float = 0.0
    """Integral gain K_I on the orientation error alone, N·m/(rad·s)."""
    integral_limit: float = 0.0
    """Saturation of each component of the integral's torque, N·m."""
    is_free: bool = False
    """True if nothing touches the hand or the peg, so that the arm may learn its joints' friction from the motion."""
    posture: Vector | None = None
    """Preferred joint positions of the null space, shape (7,), rad; None only damps it."""

    def moved(self, tip: Vector, valid_until: float, twist: Twist | None = None) -> "ImpedanceSetpoint":
        """Return this setpoint with another tip, shape (3,), m, another time of validity, s, and another twist."""
        # `dataclasses.replace` would take nearly twice as long, at every scan.
        return ImpedanceSetpoint(
            id=self.id,
            tip=tip,
            axis=self.axis,
            stiffness=self.stiffness,
            damping_ratio=self.damping_ratio,
            valid_until=valid_until,
            in_hand=self.in_hand,
            roll=self.roll,
            twist=twist,
            integral_gain=self.integral_gain,
            integral_limit=self.integral_limit,
            is_free=self.is_free,
            posture=self.posture,
        )


@dataclass(frozen=True, slots=True)
class GripperState:
    """State of the hand, as the hand reports it."""

    width: float
    """Distance between the pads, m."""
    is_gripping: bool
    """True if the hand holds the set force against something between the pads."""
    is_moving: bool
    """True until the fingers reach the commanded width."""

    def is_open(self, thickness: float) -> bool:
        """Return True if the hand rests at a width that is clear of a peg of this thickness, m."""
        return self.width > thickness + WIDTH_TOLERANCE and not self.is_gripping and not self.is_moving

    def is_around(self, thickness: float) -> bool:
        """Return True if the hand grips, or if its width equals this thickness, m: it may hold a peg and report no grip."""
        return self.is_gripping or abs(self.width - thickness) <= WIDTH_TOLERANCE


class SwitchState(StrEnum):
    """Debounced state of the switch under the hole."""

    OPEN = "open"
    CLOSED = "closed"
    UNKNOWN = "unknown"
