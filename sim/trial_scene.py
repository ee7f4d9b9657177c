"""What one trial is made of: plate, rack and peg as drawn, and the compiled models that move them."""

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from drivers import frames
from drivers.errors import ConfigError
from drivers.parts import Job
from drivers.quantities import Pose, Vector
from sim import contact, engine, joint_drive, scene
from sim.arm_truth import ArmTruth, JointFriction
from sim.config import SimConfig
from sim.disturb import Draw
from sim.plate import Plate

GRAVITY = 9.81
FLOOR_MARGIN = 0.5e-3
"""The hole's floor lies so far below the depth at which the switch closes, m."""


class Mechanism:
    """One model of the scene with its state."""

    def __init__(self, model: mujoco.MjModel, twin: mujoco.MjModel | None, pivot: str, plates: int) -> None:
        """Make the state of a compiled model.

        Args:
            model: The model.
            twin: The same with a time step `engine.COARSE` times as long, for the same state, if there is one.
            pivot: Body at the finger centre.
            plates: How many of the first geoms are plates that the net force counts.
        """
        self.model, self.twin, self.plates = model, twin, plates
        self.data = mujoco.MjData(model)
        self.peg_body, self.peg_geom = int(model.body("peg").id), int(model.geom("peg").id)
        self.pivot = int(model.body(pivot).id)


@dataclass(frozen=True, slots=True)
class PegSize:
    """The peg's size as contacts and meters need it."""

    reach: float
    """Furthest that a point of the end is from the axis, m."""
    half: float
    """Half the length, overhang included, m."""
    weight: float
    """N."""


class TrialScene:
    """One trial's plate, rack and models."""

    def __init__(self, sim: SimConfig, job: Job, drawn: Draw, pad: tuple[float, float], has_twins: bool) -> None:
        """Compile what was drawn.

        Args:
            sim: Config of the simulated world.
            job: The part, its rack and its hole.
            drawn: What the trial's seed gave.
            pad: Length and width of a pad, m.
            has_twins: Whether longer steps are taken where nothing can touch the hole, if the joints' friction bears them.

        Raises:
            ConfigError: The joints' smooth friction is too steep for the time step.
        """
        self.job = job
        self.arm = drawn.arm if sim.model.arm == "full" else replace(drawn.arm, friction=JointFriction())
        """The arm as it is."""
        has_twins = has_twins and _can_step(self.arm, sim.timestep)
        self.plate, self.rack = _plate(job, drawn), _rack(job, drawn)
        dt, how = sim.timestep, sim.model
        held = scene.held_model(self.arm, job, self.plate, drawn.friction, dt, how)
        free = scene.free_model(self.arm, job, self.plate, self.rack, drawn.friction, drawn.pad_friction, pad, dt)
        twins: tuple[mujoco.MjModel | None, mujoco.MjModel | None] = (None, None)
        if has_twins:
            twins = (
                scene.held_model(self.arm, job, self.plate, drawn.friction, engine.COARSE * dt, how),
                scene.without_peg(free, engine.COARSE),
            )
        self.held = Mechanism(held, twins[0], "peg", int(held.geom("peg").id))
        self.free = Mechanism(free, twins[1], "left", 2)
        """The twin of the free model knows no peg."""
        self.pads = (int(free.geom("left").id), int(free.geom("right").id))
        """The pads' geoms in the free model."""
        self.pivot_dof = int(held.joint("pivot").dofadr[0])
        """The hinge's degree of freedom in the held model."""
        self.size = PegSize(
            reach=job.peg.part.reach,
            half=(job.peg.length + job.peg.overhang) / 2,
            weight=float(held.body("peg").mass[0] * GRAVITY),
        )
        reach = job.hole.part.reach if job.hole.present else contact.SOLID
        self.hole: Vector = np.array([*self.plate.position, *self.plate.rotation[:, 2], reach])
        """Middle of the mouth, outward axis and reach of the hole, see `engine.is_far`."""

    def racked(self) -> Pose:
        """Return the pose of the peg's middle in its slot."""
        up = self.rack.rotation[:, 2]
        return Pose(self.rack.position + up * (self.size.half - self.rack.depth), self.rack.rotation)


def _can_step(arm: ArmTruth, timestep: float) -> bool:
    """Whether long steps are short enough for the smooth friction of the joints.

    Raises:
        ConfigError: Even a single tick is too long.
    """
    if not any(arm.friction.steepest()):
        return True
    share = joint_drive.stiffest(arm, np.array(arm.model.home), timestep)
    if share > 1.0:
        raise ConfigError(
            f"sim.timestep = {timestep}: too long for the slope of the joints' friction; at most {timestep / share:.2g} allowed"
        )
    return engine.COARSE * share <= 1.0


def _plate(job: Job, drawn: Draw) -> Plate:
    hole = job.hole
    lean = frames.rotation_about(
        np.array([-math.sin(drawn.tilt_direction), math.cos(drawn.tilt_direction), 0.0]), drawn.tilt
    )
    if hole.part.symmetry > 0.0:
        lean = lean @ frames.rotation_about(frames.UP, drawn.yaw)
    half = hole.part.half if hole.present else (contact.SOLID, contact.SOLID)
    return Plate(drawn.hole, lean, half, hole.depth + FLOOR_MARGIN)


def _rack(job: Job, drawn: Draw) -> Plate:
    rack = job.rack
    slot = np.array(rack.first) + np.array([0.0, rack.pitch * (job.slot % rack.slots), 0.0]) + drawn.rack
    # The hand comes with its closing axis along y, so the slot leans about y and its first side lies along y.
    lean = frames.rotation_about(np.array([0.0, 1.0, 0.0]), -drawn.grasp_angle)
    return Plate(
        slot,
        lean @ frames.rotation_about(frames.UP, job.peg.part.least_turn(math.pi / 2)),
        job.peg.part.grown(scene.RACK_CLEARANCE).half,
        # The deeper the slot, the closer to its back end the peg is taken.
        rack.depth + drawn.depth_in_hand,
    )
