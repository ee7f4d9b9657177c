"""Contents of one trial: plate, rack and peg as drawn, and the compiled models that move them."""

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from drivers import frames
from drivers.arm.model import JOINTS
from drivers.errors import ConfigError
from drivers.parts import Job
from drivers.quantities import Pose, Vector
from sim.arm import joint_drive
from sim.arm.arm_truth import ArmTruth
from sim.config import PlateConfig, SimConfig
from sim.contact import latch
from sim.contact import table as contact
from sim.contact.decoys import with_decoys
from sim.contact.plate import Plate, outline_of
from sim.world import engine, scene
from sim.world.disturb import Draw


class Mechanism:
    """One model of the scene with its state."""

    def __init__(self, model: mujoco.MjModel, twin: mujoco.MjModel | None, sides: tuple[str, str], plates: int) -> None:
        """Make the state of a compiled model.

        Args:
            model: The model.
            twin: The same model with a time step `engine.COARSE` times as long, for the same state, or None.
            sides: Bodies on either side of the finger centre; the first one is the reference point of the plates'
                torque.
            plates: Number of plates; their geoms come first and the net force includes them.
        """
        self.model, self.twin, self.plates = model, twin, plates
        self.data = mujoco.MjData(model)
        self.peg_body, self.peg_geom = int(model.body("peg").id), int(model.geom("peg").id)
        self.hand = int(model.body(f"link{JOINTS}").id)
        self.sides = tuple(int(model.body(name).id) for name in sides)


@dataclass(frozen=True, slots=True)
class PegSize:
    """Sizes of the peg that contacts and meters need."""

    reach: float
    """Largest distance of a point of the end from the axis, m."""
    chamfer: float
    """Width and height of the chamfer at the end, m."""
    half: float
    """Half the length, overhang included, m."""
    weight: float
    """Weight of the peg, N."""
    thickness: float
    """Thickness of the peg between the pads, m."""
    flat: float
    """Width of the flat face in a pad, m; 0 for a round peg."""


class TrialScene:
    """Plate, rack and models of one trial."""

    def __init__(self, sim: SimConfig, job: Job, drawn: Draw, pad: tuple[float, float], has_twins: bool) -> None:
        """Compile the models of the drawn plate, rack, peg and arm.

        Args:
            sim: Config of the simulation.
            job: The part, its rack and its hole.
            drawn: Draw of the trial's seed.
            pad: Length and width of a pad, m.
            has_twins: True for longer steps while nothing can touch the hole, if the joints' friction permits them.

        Raises:
            ConfigError: The joints' smooth friction is too steep for the time step, or the plate is too small for its
                decoys.
        """
        self.job = job
        self.arm = replace(drawn.arm, reading=replace(drawn.arm.reading, backlash=sim.model.wrist_backlash))
        """The true arm."""
        has_twins = has_twins and _can_step(self.arm, sim.timestep)
        true = sim.plate
        self.plate, self.rack = _plate(job, drawn, true), _rack(job, drawn)
        if true.decoys.number[1] > 0:
            self.plate = with_decoys(self.plate, job.hole, true.decoys, drawn.seed)
        force = drawn.latch_force * (1.0 - true.latch_wear)
        self.latch = latch.words_of(job.hole.latch, self.plate, job.hole.depth, force, drawn.latch_place)
        """Latch near the bottom, see `sim.contact.latch`."""
        self.shear_stiffness = drawn.shear_stiffness
        """Stiffness of both pads in their plane, N/m."""
        dt = sim.timestep
        held = scene.held_model(self.arm, job, self.plate, drawn.friction, dt)
        free = scene.free_model(self.arm, job, self.plate, self.rack, drawn.friction, drawn.pad_friction, pad, dt)
        twins: tuple[mujoco.MjModel | None, mujoco.MjModel | None] = (None, None)
        if has_twins:
            twins = (
                scene.held_model(self.arm, job, self.plate, drawn.friction, engine.COARSE * dt),
                scene.without_peg(free, engine.COARSE),
            )
        self.held = Mechanism(held, twins[0], (scene.GRIP, scene.GRIP), int(held.geom("peg").id))
        self.free = Mechanism(free, twins[1], ("left", "right"), int(free.geom("left").id))
        """Free model with its twin, which omits the peg."""
        self.pads = (int(free.geom("left").id), int(free.geom("right").id))
        """Geoms of the pads in the free model."""
        self.size = PegSize(
            reach=job.peg.part.reach,
            chamfer=job.peg.chamfer,
            half=(job.peg.length + job.peg.overhang) / 2,
            # Standard gravity, m/s².
            weight=float(held.body("peg").mass[0] * 9.81),
            thickness=job.peg.part.thickness,
            flat=job.peg.part.face.flat_width,
        )
        reach = job.hole.part.reach + job.hole.chamfer if true.present else contact.SOLID
        if self.plate.tiles:
            # Every position of the plate is near one of its holes.
            reach = 2.0 * math.hypot(*self.plate.outline[2:])
        self.hole: Vector = np.array([*self.plate.position, *self.plate.rotation[:, 2], reach])
        """Centre of the mouth, outward axis and reach of the hole with its chamfer, see `peg_distances.is_far`."""

    def racked(self) -> Pose:
        """Return the pose of the peg's centre in its slot."""
        up = self.rack.rotation[:, 2]
        return Pose(self.rack.position + up * (self.size.half - self.rack.depth), self.rack.rotation)


def _can_step(arm: ArmTruth, timestep: float) -> bool:
    """Return True if long steps are short enough for the smooth friction of the joints.

    Raises:
        ConfigError: A single tick is already too long.
    """
    if not any(arm.friction.steepest()):
        return True
    share = joint_drive.stiffest(arm, np.array(arm.model.home), timestep)
    if share > 1.0:
        raise ConfigError(
            f"sim.timestep = {timestep}: too long for the slope of the joints' friction; at most {timestep / share:.2g} allowed"
        )
    return engine.COARSE * share <= 1.0


def _plate(job: Job, drawn: Draw, true: PlateConfig) -> Plate:
    hole = job.hole
    lean = frames.rotation_about(
        np.array([-math.sin(drawn.tilt_direction), math.cos(drawn.tilt_direction), 0.0]), drawn.tilt + true.tilt
    )
    if hole.part.symmetry > 0.0:
        lean = lean @ frames.rotation_about(frames.UP, drawn.yaw)
    half = hole.part.half if true.present else (contact.SOLID, contact.SOLID)
    # A switch needs some travel to close; without a switch the bottom is the seated depth.
    # Distance of the hole's floor below the depth at which the switch closes, m.
    floor = hole.depth - true.shallow + (0.5e-3 if hole.evidence == "switch" else 0.0)
    chamfer = hole.chamfer if true.present else 0.0
    rubbing = contact.Rubbing(true.stick, true.stick_speed, true.ripple, true.ripple_length)
    return Plate(drawn.hole, lean, half, floor, outline_of(drawn.hole, lean, *hole.plate_bounds), chamfer, rubbing)


def _rack(job: Job, drawn: Draw) -> Plate:
    rack = job.rack
    slot = np.array(rack.first) + np.array([0.0, rack.pitch * (job.slot % rack.slots), 0.0]) + drawn.rack
    # The hand arrives with its closing axis along y, so the slot is tilted about y and its first side lies along y.
    lean = frames.rotation_about(np.array([0.0, 1.0, 0.0]), -drawn.grasp_angle)
    turned = lean @ frames.rotation_about(frames.UP, job.peg.part.least_turn(math.pi / 2))
    return Plate(
        slot,
        turned,
        job.peg.part.grown(scene.RACK_CLEARANCE).half,
        # In a deeper slot the hand grasps the peg closer to its back end.
        rack.depth + drawn.depth_in_hand,
        outline_of(slot - drawn.rack, turned, *rack.bounds),
    )
