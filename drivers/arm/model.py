"""Model of an arm: kinematics, limits, masses, friction and hand, as data read from a file of figures.

The law, the margins and the simulation take an `ArmModel` and hold no figures of their own. Each arm is one file of
figures with their sources, as in `config/arms/`; `arm.model` of a cell's config names it.
"""

import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, model_validator

from drivers.config_model import ConfigModel, beside_config
from drivers.figures_file import read_figures
from drivers.parts import HandShape
from drivers.quantities import Vector

JOINTS = 7
"""Number of joints of every supported arm: six for the pose of the tip, one for the elbow."""


def _file_beside_config(name: str, info: ValidationInfo) -> str:
    return str(beside_config(Path(name), info)) if name.endswith(".toml") else name


ArmName = Annotated[str, Field(min_length=1), AfterValidator(_file_beside_config)]
"""Name of an arm that ships with the program, or a file of figures, `*.toml`, relative to the folder of the config file."""

T = TypeVar("T")
PerJoint = tuple[T, T, T, T, T, T, T]
"""One figure, or one body, for each joint."""
Angle = Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi)]
Distance = Annotated[float, Field(ge=-2.0, le=2.0)]
Friction = Annotated[float, Field(ge=0.0, le=50.0)]
Moment = Annotated[float, Field(ge=-10.0, le=10.0)]


class Inertial(ConfigModel):
    """Mass of one rigid body, in the body's own frame."""

    mass: Annotated[float, Field(gt=0.0, le=50.0)]
    """Mass, kg."""
    com: tuple[Distance, Distance, Distance]
    """Centre of mass, m."""
    inertia: tuple[Moment, Moment, Moment, Moment, Moment, Moment]
    """Inertia about the centre of mass: xx, yy, zz, xy, xz, yz, kg·m²."""

    def tensor(self) -> Vector:
        """Return the inertia about the centre of mass, shape (3, 3), kg·m²."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def turned(self) -> "Inertial":
        """Return the same body after half a turn about z."""
        (x, y, z), (xx, yy, zz, xy, xz, yz) = self.com, self.inertia
        return Inertial(mass=self.mass, com=(-x, -y, z), inertia=(xx, yy, zz, xy, -xz, -yz))

    @model_validator(mode="after")
    def _is_positive(self) -> Self:
        if np.linalg.eigvalsh(self.tensor())[0] <= 0.0:
            raise ValueError("inertia: not positive definite; xx, yy, zz, xy, xz, yz about the centre of mass allowed")
        return self


class Kinematics(ConfigModel):
    """Modified Denavit-Hartenberg figures (Craig's convention), joints 1 to 7, and the flange behind them."""

    a: PerJoint[Distance]
    """Length of the link before the joint, m."""
    d: PerJoint[Distance]
    """Offset along the joint's axis, m."""
    alpha: PerJoint[Angle]
    """Twist of the link before the joint, rad."""
    flange: Distance
    """Distance from the frame of the last joint to the flange, along z, m."""
    elbow: Annotated[int, Field(ge=1, le=JOINTS)]
    """Number of the joint that turns the elbow about the line from shoulder to wrist; the null space moves it."""


class SmoothFriction(ConfigModel):
    """Friction without stiction, joints 1 to 7: span / (1 + exp(-slope (dq + shift))), minus its value at rest."""

    span: PerJoint[Friction]
    """Full span of each joint's curve, N·m."""
    slope: PerJoint[Annotated[float, Field(gt=0.0, le=1000.0)]]
    """Slope parameter of each joint's curve, s/rad."""
    shift: PerJoint[Annotated[float, Field(ge=-1.0, le=1.0)]]
    """Offset of the velocity in each joint's curve, rad/s."""


class Joints(ConfigModel):
    """Limits and friction, joints 1 to 7."""

    q_min: PerJoint[Angle]
    """Lower end of the permitted positions, rad."""
    q_max: PerJoint[Angle]
    """Upper end of the permitted positions, rad."""
    speed: PerJoint[Annotated[float, Field(gt=0.0, le=20.0)]]
    """Largest speed, rad/s; no change of posture is faster."""
    torque: PerJoint[Annotated[float, Field(gt=0.0, le=1000.0)]]
    """Largest torque, N·m."""
    torque_rate: PerJoint[Annotated[float, Field(gt=0.0, le=1e5)]]
    """Largest change of a commanded torque, N·m/s; above it the arm ends the motion with a reflex."""
    friction: PerJoint[Friction]
    """Dry friction of the simulated joints, N·m."""
    smooth_friction: SmoothFriction | None = None
    """Smooth friction curve of the joints, if one is published."""
    viscous_friction: PerJoint[Friction] | None = None
    """Coefficient of each joint's viscous friction, N·m·s/rad, if one is published."""
    offset: PerJoint[Friction]
    """Standard deviation of the residual of the arm's gravity compensation, N·m."""
    rotor_inertia: PerJoint[Annotated[float, Field(ge=0.0, le=2.0)]]
    """Rotor inertia at each joint, kg·m², published or assumed."""

    @model_validator(mode="after")
    def _is_in_order(self) -> Self:
        for number, (low, high) in enumerate(zip(self.q_min, self.q_max, strict=True), 1):
            if low >= high:
                raise ValueError(f"q_min of joint {number} = {low}: less than its q_max = {high} allowed")
        return self


class TorquePathModel(ConfigModel):
    """Delay and low-pass between the computed torque and the joint; gains must be stable with them."""

    transport: Annotated[float, Field(ge=0.0, le=0.01)] = 0.002
    """Time from the state to the action of the torque computed from it, s."""
    cutoff: Annotated[float, Field(ge=10.0, le=1e4)] = 100.0
    """Corner frequency of the low-pass after the delay, Hz."""
    rotor_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Least share of `joints.rotor_inertia` that acts at the joints, fraction; a lighter joint oscillates earlier."""


class Hand(HandShape):
    """The parallel hand on the flange."""

    turn: Angle
    """Rotation of the hand about the flange's z, rad."""
    finger_centre: Annotated[float, Field(gt=0.0, le=0.5)]
    """Distance from the flange to the middle between the pads, along z, m."""
    finger_speed: Annotated[float, Field(gt=0.0, le=1.0)]
    """Largest speed of one finger, m/s."""
    finger_force: Annotated[float, Field(gt=0.0, le=500.0)]
    """Force with which the drive opens a finger, N."""
    body: Inertial
    """Masses of the hand without its fingers; its frame lies at the flange, turned by `turn`."""
    finger: Inertial
    """Masses of the finger that opens along y; its frame lies in the middle between the pads. The other finger is the same after half a turn about z."""


class ArmModel(ConfigModel):
    """One type of arm with its hand, as published."""

    name: Annotated[str, Field(min_length=1)]
    control_period: Annotated[float, Field(ge=1e-4, le=1e-2)]
    """Period of the torque loop, s."""
    tool_speed: Annotated[float, Field(gt=0.0, le=10.0)]
    """Largest speed of the tool, m/s; no setpoint moves faster."""
    tool_turn_speed: Annotated[float, Field(gt=0.0, le=20.0)]
    """Largest turning rate of the tool, rad/s; no setpoint turns faster."""
    stiffness: Annotated[float, Field(gt=0.0, le=1e5)]
    """Largest stiffness of the tool, N/m; no setpoint is stiffer."""
    turn_stiffness: Annotated[float, Field(gt=0.0, le=1e4)]
    """Largest rotational stiffness of the tool, N·m/rad; no setpoint is stiffer."""
    home: PerJoint[Angle]
    """Joint positions at which the simulation starts, rad."""
    kinematics: Kinematics
    joints: Joints
    torque_path: TorquePathModel = TorquePathModel()
    hand: Hand
    link: PerJoint[Inertial]
    """Links 1 to 7, each in the frame of its joint."""

    def shoulder(self) -> Vector:
        """Return the fixed origin of the first joint's frame, shape (3,), m, base frame."""
        dh = self.kinematics
        a, d, alpha = dh.a[0], dh.d[0], dh.alpha[0]
        return np.array([a, -math.sin(alpha) * d, math.cos(alpha) * d])

    def reach(self) -> float:
        """Return the reach: largest distance of the finger centre from the shoulder, m, the sum of all lengths between them."""
        dh = self.kinematics
        links = sum(math.hypot(a, d) for a, d in zip(dh.a[1:], dh.d[1:], strict=True))
        return links + abs(dh.flange + self.hand.finger_centre)

    @model_validator(mode="after")
    def _is_home_permitted(self) -> Self:
        limits = zip(self.home, self.joints.q_min, self.joints.q_max, strict=True)
        for number, (q, low, high) in enumerate(limits, 1):
            if not low <= q <= high:
                raise ValueError(f"home of joint {number} = {q}: {low} to {high} allowed")
        return self


@lru_cache
def read_arm(path: Path) -> ArmModel:
    """Return the arm of a file of figures, read once: later changes of the file have no effect.

    Raises:
        ConfigError: The file is missing, is not TOML, or holds figures outside their bounds.
    """
    return read_figures(path, ArmModel)
