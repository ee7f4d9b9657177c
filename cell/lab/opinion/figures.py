"""Agreement of an external arm description with the cell's assumptions: kinematics, masses, joints."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.arm.inertia import joint_inertia
from drivers.arm.kinematics import jacobian, links
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import Pose, Vector
from sim.described_arm import GRAVITY, DescribedArm, apart

POSTURES = 1000
"""Number of postures for the comparison, drawn uniformly over the range that both permit."""
SEED = 1
"""Seed of the postures."""
NOTHING = 1e-10
"""Mass of an absent hand, kg, and its inertia, kg·m²: the description ends at the flange."""
NEGLIGIBLE = {"kinematics": 1e-5, "inertia": 1e-3}
"""Differences too small for any trial: of the flange's position, m and rad, and of the mass matrix, ratio."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Difference of one quantity between the description and the cell's assumption over the postures."""

    quantity: str
    unit: str
    median: float
    worst: float


@dataclass(frozen=True, slots=True)
class JointFigure:
    """One figure of the seven joints in the cell and in the description; SI."""

    name: str
    ours: tuple[float, ...]
    theirs: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of a description with the cell's arm."""

    agreements: list[Agreement]
    joints: list[JointFigure]
    differs: tuple[str, ...]
    """Parts with a difference that trials can show, of `kinematics`, `inertia`, `friction` and `rotors`."""


def compare(arm: ArmModel, described: DescribedArm, postures: int = POSTURES) -> Comparison:
    """Return the agreement of a description with the cell's assumptions, at this number of postures."""
    model = described.model
    low = np.maximum(arm.joints.q_min, model.jnt_range[:, 0])
    high = np.minimum(arm.joints.q_max, model.jnt_range[:, 1])
    bare = without_hand(arm)
    away, angle, mass, weight = [], [], [], []
    for q in np.random.default_rng(SEED).uniform(low, high, (postures, JOINTS)):
        rotations, origins = links(arm, q)
        flange = Pose(origins[-1] + arm.kinematics.flange * rotations[-1][:, 2], rotations[-1])
        apart_by = apart(described.pose_of_flange(q), flange)
        away.append(apart_by[0])
        angle.append(apart_by[1])
        M, held = described.inertia(q)
        ours = joint_inertia(bare, q)
        mass.append(float(np.linalg.norm(M - ours) / np.linalg.norm(ours)))
        weight.append(float(np.abs(held - gravity_torque(bare, q)).max()))
    agreements = [
        _agreement("place of the flange", "mm", away, 1000.0),
        _agreement("angle of the flange", "degrees", angle, math.degrees(1.0)),
        _agreement("mass matrix of the links, relative", "%", mass, 100.0),
        _agreement("torque of gravity, the joint that differs most", "N·m", weight, 1.0),
    ]
    joints = joint_figures(arm, described)
    is_other = {
        "kinematics": max(*away, *angle) > NEGLIGIBLE["kinematics"],
        "inertia": max(mass) > NEGLIGIBLE["inertia"],
        # The cell's own arm has drawn friction, whatever its file contains.
        "friction": True,
        "rotors": bool(model.dof_armature.any()),
    }
    return Comparison(agreements, joints, tuple(name for name, differs in is_other.items() if differs))


def joint_figures(arm: ArmModel, described: DescribedArm) -> list[JointFigure]:
    """Return friction, rotors and limits of the joints in both."""
    joints, model = arm.joints, described.model
    pairs = (
        ("dry friction, N·m", joints.friction, model.dof_frictionloss),
        ("viscous friction, N·m·s/rad", joints.viscous_friction or np.zeros(JOINTS), model.dof_damping),
        ("rotor inertia, kg·m²", joints.rotor_inertia, model.dof_armature),
        ("lower limit, rad", joints.q_min, model.jnt_range[:, 0]),
        ("upper limit, rad", joints.q_max, model.jnt_range[:, 1]),
        ("largest torque, N·m", joints.torque, model.jnt_actfrcrange[:, 1]),
    )
    return [
        JointFigure(name, tuple(float(x) for x in ours), tuple(float(x) for x in theirs))
        for name, ours, theirs in pairs
    ]


def without_hand(arm: ArmModel) -> ArmModel:
    """Return the arm with a hand of no mass."""
    nothing = {"mass": NOTHING, "inertia": (NOTHING, NOTHING, NOTHING, 0.0, 0.0, 0.0)}
    hand = arm.hand.model_copy(
        update={"body": arm.hand.body.model_copy(update=nothing), "finger": arm.hand.finger.model_copy(update=nothing)}
    )
    return arm.model_copy(update={"hand": hand})


def gravity_torque(arm: ArmModel, q: Vector) -> Vector:
    """Return the torques that hold the links against gravity by the cell's figures, shape (7,), N·m."""
    rotations, origins = links(arm, q)
    axes = np.array([R[:, 2] for R in rotations])
    torque = np.zeros(JOINTS)
    for i, (R, link) in enumerate(zip(rotations, arm.link, strict=True)):
        torque += link.mass * GRAVITY * jacobian(origins[i] + R @ link.com, axes, origins, i + 1)[2]
    return torque


def _agreement(quantity: str, unit: str, values: list[float], factor: float) -> Agreement:
    return Agreement(quantity, unit, factor * float(np.median(values)), factor * float(np.max(values)))
