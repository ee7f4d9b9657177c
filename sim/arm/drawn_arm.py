"""The true arm of a trial, made from the drawn errors."""

import math
from dataclasses import replace

from drivers.arm.model import ArmModel
from drivers.quantities import Vector
from sim.arm.arm_truth import ArmTruth, JointFriction, Seven, StateReading, Three, TorquePath, WrenchReading, ideal
from sim.world.reality import Drawn


def drawn_arm(arm: ArmModel, drawn: Drawn) -> ArmTruth:
    """Return the true arm for the assumed `arm` and drawn errors; without errors both agree."""
    lag = float(drawn["arm.torque_lag"])
    return replace(
        ideal(arm),
        friction=_friction(arm, drawn),
        rotor_inertia=_seven(drawn["arm.rotor_inertia"]),
        path=TorquePath(
            delay=round(float(drawn["arm.transport"]) / arm.control_period),
            cutoff=1.0 / (2.0 * math.pi * lag) if lag > 0.0 else math.inf,
        ),
        reading=StateReading(zero=_seven(drawn["arm.joint_offsets"]), rate_noise=_seven(drawn["arm.velocity_noise"])),
        wrench=WrenchReading(
            joint_torque=_seven(drawn["arm.wrench_torque"]), force_noise=float(drawn["arm.wrench_noise"])
        ),
        gravity=_seven(drawn["arm.gravity"]),
        tcp_offset=_three(drawn["arm.tcp_place"]),
    )


def _friction(arm: ArmModel, drawn: Drawn) -> JointFriction:
    """Return dry friction at the published level, or the published curve if it was drawn and the arm has one."""
    curve = JointFriction.published_curve(arm.joints) if drawn["arm.sigmoid_friction"] > 0.0 else None
    law = curve or JointFriction(dry=arm.joints.friction)
    return replace(law.scaled(_seven(drawn["arm.friction_level"])), viscous=_seven(drawn["arm.viscous_friction"]))


def _seven(values: Vector) -> Seven:
    a, b, c, d, e, f, g = (float(value) for value in values)
    return a, b, c, d, e, f, g


def _three(values: Vector) -> Three:
    x, y, z = (float(value) for value in values)
    return x, y, z
