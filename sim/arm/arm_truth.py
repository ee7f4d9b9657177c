"""The true arm of one trial: data for the physics, never for skills.

The cell assumes an `ArmModel`, and that commanded torques act without delay on joints with dry friction. `ideal` returns
the arm for which these assumptions hold. Every deviation from it is an error that a trial may draw.

Processing of torques in the maker's client, from its source (frankarobotics/libfranka 0.21.2): `Robot::control` with a
callback has a low-pass of 100 Hz (`kDefaultCutoffFrequency`) and a rate limiter, off by default (control_loop.cpp).
`startTorqueControl` and `writeOnce` send commands unchanged (active_torque_control.cpp). pylibfranka offers both calls
and this cell's driver uses them, so neither filter nor limiter lies between the law and the network. The effect of the
arm's own controller and motors is not published. The protocol adds one cycle of transport in each direction: a state is
one cycle old when its torque is computed, and the torque acts in the next cycle.
"""

import math
from dataclasses import dataclass, field
from operator import attrgetter

import numpy as np

from drivers import frames
from drivers.arm.model import ArmModel, Joints
from drivers.errors import ConfigError
from drivers.quantities import Pose

Seven = tuple[float, float, float, float, float, float, float]
Three = tuple[float, float, float]
NONE: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NOWHERE: Three = (0.0, 0.0, 0.0)
LONGEST_DELAY = 50
"""Longest delay of torques, control cycles."""


@dataclass(frozen=True, slots=True)
class JointFriction:
    """Friction of the joints: dry friction, which can hold a joint at rest, plus a smooth curve and a viscous part.

    The smooth curve is that of Gaz et al. 2019 (marcocognetti/FrankaEmikaPandaDynModel): span / (1 + exp(-slope (dq +
    shift))) - span / (1 + exp(-slope shift)). It is 0 at rest and approaches about half its span at high speed in
    either direction.
    """

    dry: Seven = NONE
    """Coulomb level of each joint's dry friction, N·m."""
    span: Seven = NONE
    """Full span of the smooth curve, N·m."""
    slope: Seven = NONE
    """Slope parameter of the smooth curve, s/rad."""
    shift: Seven = NONE
    """Offset of the velocity in the smooth curve, rad/s."""
    viscous: Seven = NONE
    """Coefficient of each joint's viscous friction, N·m·s/rad."""

    @classmethod
    def published_curve(cls, joints: Joints) -> "JointFriction | None":
        """Return the smooth friction of an arm's file with its viscous part; None if the file has no curve."""
        curve = joints.smooth_friction
        if curve is None:
            return None
        return cls(span=curve.span, slope=curve.slope, shift=curve.shift, viscous=joints.viscous_friction or NONE)

    def scaled(self, factors: Seven) -> "JointFriction":
        """Return the friction with each joint's torque multiplied by its own factor."""
        return JointFriction(
            _product(self.dry, factors),
            _product(self.span, factors),
            self.slope,
            self.shift,
            _product(self.viscous, factors),
        )

    def steepest(self) -> Seven:
        """Return the largest slope of the smooth friction, N·m·s/rad.

        A logistic curve rises by span·slope/4 at its middle.
        """
        a, b, c, d, e, f, g = (
            span * slope / 4 + viscous for span, slope, viscous in zip(self.span, self.slope, self.viscous, strict=True)
        )
        return a, b, c, d, e, f, g


@dataclass(frozen=True, slots=True)
class TorquePath:
    """Path of a torque between the law's output and the joint."""

    delay: int = 0
    """Delay between the state used for a torque and the action of that torque, control cycles."""
    cutoff: float = math.inf
    """Corner frequency of a first-order low-pass, Hz."""


@dataclass(frozen=True, slots=True)
class StateReading:
    """Errors of the joint states that the arm's controller and the cell read."""

    zero: Seven = NONE
    """Error of each joint's zero, reading minus true position, rad."""
    noise: float = 0.0
    """Standard deviation of a position, white noise, rad."""
    rate_noise: Seven = NONE
    """Standard deviation of each joint's velocity, white noise, rad/s."""
    backlash: float = 0.0
    """Play between encoder and link of the joints 5 to 7, rad."""


@dataclass(frozen=True, slots=True)
class WrenchReading:
    """Errors of the external wrench, which the arm estimates from unexplained torques on the joints' link side.

    Residual gravity torque is such a torque and appears in the wrench without an entry here. Friction on the motors' side
    does not appear.
    """

    force: Three = NOWHERE
    """Force that the arm reports without contact, base frame, N."""
    joint_torque: Seven = NONE
    """Further error of the modelled joint torques, N·m; the arm reports it as a wrench that changes with posture."""
    force_noise: float = 0.0
    """Standard deviation of each component before the low-pass, white noise, N."""
    torque_noise: float = 0.0
    """Standard deviation of each component before the low-pass, white noise, N·m."""
    cutoff: float = math.inf
    """Corner frequency of a first-order low-pass after the 5 ms filter of the meters, Hz."""


NEVER_NEGATIVE = (
    *("rotor_inertia", "friction.dry", "friction.span", "friction.slope", "friction.viscous"),
    *("reading.noise", "reading.backlash", "reading.rate_noise", "wrench.force_noise", "wrench.torque_noise"),
)
"""Figures of an arm, single ones or one per joint, that must be 0 or more."""


@dataclass(frozen=True, slots=True)
class ArmTruth:
    """The true arm of one trial."""

    model: ArmModel
    """True kinematics, limits and masses."""
    friction: JointFriction
    rotor_inertia: Seven = NONE
    """Inertia that the rotors add at each joint, kg·m². An arm with torque control on the link side shows less than the
    rotor's reflected inertia."""
    path: TorquePath = field(default_factory=TorquePath)
    reading: StateReading = field(default_factory=StateReading)
    wrench: WrenchReading = field(default_factory=WrenchReading)
    gravity: Seven = NONE
    """Residual torque on each joint after gravity compensation, N·m."""
    tcp_offset: Three = NOWHERE
    """Offset of the true midpoint of the pads from its assumed position, m, in the assumed hand frame."""
    tcp_turn: Three = NOWHERE
    """Rotation of the true fingers about the midpoint of the pads, rotation vector, rad, in the assumed hand frame."""

    def __post_init__(self) -> None:
        """Reject figures outside their physical bounds.

        Raises:
            ConfigError: A figure is outside its bounds; one line with the figure and the allowed range.
        """
        if not 0 <= self.path.delay <= LONGEST_DELAY:
            raise ConfigError(f"arm truth: path.delay = {self.path.delay}: 0 to {LONGEST_DELAY} control cycles allowed")
        for name, figure in (("path.cutoff", self.path.cutoff), ("wrench.cutoff", self.wrench.cutoff)):
            if not figure > 0.0:
                raise ConfigError(f"arm truth: {name} = {figure}: more than 0 allowed")
        for name in NEVER_NEGATIVE:
            for figure in np.ravel(attrgetter(name)(self)).tolist():
                if not 0.0 <= figure < math.inf:
                    raise ConfigError(f"arm truth: {name} = {figure}: 0 or more allowed")

    def displaced(self, tcp: Pose) -> Pose:
        """Return the true pose of the midpoint of the pads, T_base_tcp, from the pose of the arm's kinematics."""
        if self.tcp_offset == NOWHERE == self.tcp_turn:
            return tcp
        # The hand's axes are y, z and x of the finger frame.
        hand = np.column_stack([tcp.rotation[:, 1], tcp.rotation[:, 2], tcp.rotation[:, 0]])
        turn = hand @ frames.rotation_by(np.array(self.tcp_turn)) @ hand.T
        return Pose(tcp.position + hand @ self.tcp_offset, turn @ tcp.rotation)


def ideal(arm: ArmModel) -> ArmTruth:
    """Return the arm for which the cell's assumptions hold: dry friction from its file, all else exact and without
    delay.
    """
    return ArmTruth(model=arm, friction=JointFriction(dry=arm.joints.friction))


def _product(values: Seven, factors: Seven) -> Seven:
    a, b, c, d, e, f, g = (value * factor for value, factor in zip(values, factors, strict=True))
    return a, b, c, d, e, f, g
