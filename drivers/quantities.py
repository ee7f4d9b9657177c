"""Measured and commanded quantities: frozen values, SI units, the frame in each docstring."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

FINGERS = 2
FINGER_NAMES = ("left", "right")
TAXELS = 20
"""Taxels on one finger: two modules of ten."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where a frame is: `T_<in>_<of>`."""

    position: Vector
    """Origin, shape (3,), m."""
    rotation: Vector
    """Axes as columns, shape (3, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Twist:
    """Velocity of a frame."""

    linear: Vector
    """Shape (3,), m/s, base frame."""
    angular: Vector
    """Shape (3,), rad/s, base frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Wrench:
    """Force and torque, both in the base frame, the torque about the origin of the named frame."""

    force: Vector
    """Shape (3,), N."""
    torque: Vector
    """Shape (3,), N·m."""


@dataclass(frozen=True, slots=True, eq=False)
class TaxelFrame:
    """All taxels of both fingers at one instant, baseline removed."""

    values: Vector
    """Signed counts, shape (2, 20), left finger first; positive is pressure."""
    trusted: Mask
    """False where a taxel is dead, stuck, saturated or marks an error, shape (2, 20)."""
    stamp: float
    """Time of the measurement on the cell's clock, s."""
    sequence: int
    """Counts the frames since the skin was opened."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmState:
    """What the robot controller reports."""

    stamp: float
    """Time on the cell's clock, s."""
    q: Vector
    """Joint positions, shape (7,), rad."""
    dq: Vector
    """Joint velocities, shape (7,), rad/s."""
    tcp: Pose
    """T_base_tcp: the finger frame, whose origin lies between the pads' centres; x points out of the hand, z along the closing axis."""
    wrench: Wrench
    """Estimated external wrench on the arm at the TCP, base frame."""
    elbow: int
    """Index in `q` of the joint that turns the elbow."""
    setpoint_age: float
    """Time since the held setpoint was handed over, s; infinite when nothing is held."""

    def posture(self, elbow: float) -> Vector:
        """Return the joint positions with the elbow's joint at `elbow`, rad, shape (7,)."""
        drawn = self.q.copy()
        drawn[self.elbow] = elbow
        return drawn


@dataclass(frozen=True, slots=True)
class InHandTip:
    """Where the peg's end point is in the finger frame, as far as the skin knows."""

    theta: float
    """In-hand angle about the closing axis, rad; 0 points the peg straight out of the hand."""
    length: float
    """Distance from the finger centre to the end point, m."""
    stamp: float
    """When theta was measured, s."""


@dataclass(frozen=True, slots=True, eq=False)
class ImpedanceSetpoint:
    """What the arm shall realise until the next one comes; see `drivers.impedance` for the law."""

    id: int
    """A new id resets the integral."""
    tip: Vector
    """x_p*: setpoint of the controlled point, shape (3,), m, base frame."""
    axis: Vector
    """v*: setpoint of the peg's axis, from the tip to the finger, unit, shape (3,), base frame."""
    stiffness: Vector
    """Three translational, N/m, and three rotational values, N·m/rad, shape (6,), base frame."""
    damping: Vector
    """As stiffness, N·s/m and N·m·s/rad, shape (6,)."""
    valid_until: float
    """Past this time on the cell's clock the arm holds still, compliant, s."""
    in_hand: InHandTip | None = None
    """None controls the bare TCP, with -x of the finger frame as the axis."""
    roll: Vector | None = None
    """Where the closing axis shall point as far as v* allows, shape (3,), base frame; None leaves it free."""
    twist: Twist | None = None
    """Feed-forward twist of the setpoint; None is at rest."""
    integral_gain: float = 0.0
    """K_I on the orientation error alone, N·m/(rad·s)."""
    integral_limit: float = 0.0
    """Saturation of each component of the integral's torque, N·m."""
    posture: Vector | None = None
    """Joint positions that the null space is drawn to, shape (7,), rad; None damps it only."""


@dataclass(frozen=True, slots=True)
class GripperState:
    """What the hand reports."""

    width: float
    """Distance between the pads, m."""
    is_gripping: bool
    """The set force is held against something between the pads."""
    is_moving: bool
    """The fingers have not reached what was commanded."""


class SwitchState(StrEnum):
    """What is known of the switch under the hole."""

    OPEN = "open"
    CLOSED = "closed"
    UNKNOWN = "unknown"
