"""What differs from trial to trial: drawn from the trial's seed, and nothing else is."""

from dataclasses import dataclass

import numpy as np

from drivers.arm.model import ArmModel
from drivers.parts import Job
from drivers.quantities import Vector
from sim.arm_truth import ArmTruth
from sim.config import ContactConfig, GripConfig, Spread
from sim.drawn_arm import drawn_arm
from sim.reality import AS_BELIEVED, Drawn

SENSES_STREAM = 6
"""Key of the random stream for the noise of what the arm reads; the keys before it are taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Draw:
    """One trial's world."""

    hole: Vector
    """Middle of the hole's mouth, shape (3,), m, base frame."""
    tilt_direction: float
    """Azimuth towards which the plate's normal leans, rad."""
    yaw: float
    """Of a square hole, rad."""
    friction: float
    """Coulomb coefficient between peg and plate."""
    pad_friction: float
    """Coulomb coefficient between peg and pads."""
    grasp_angle: float
    """In-hand angle at which the peg is found in the rack, rad."""
    skin: np.random.Generator
    """For the skin's gains, dead taxels and noise."""
    tilt: float
    """How far the plate's normal leans, rad."""
    rack: Vector
    """Where the rack stands against where the job says, shape (3,), m, base frame."""
    depth_in_hand: float
    """How much further than believed the peg reaches from the finger centre when it is taken from the rack, m."""
    grip_force: float
    """Force of the fingers over the commanded one, a ratio."""
    arm: ArmTruth
    """The arm as it is."""
    senses: np.random.Generator
    """For the noise of what the arm reads."""


def draw(
    arm: ArmModel,
    job: Job,
    contact: ContactConfig,
    grip: GripConfig,
    seed: int,
    cell: Drawn = AS_BELIEVED,
    part: Drawn = AS_BELIEVED,
) -> Draw:
    """Return the world of the trial with this seed; independent streams, so that no draw shifts another.

    Args:
        arm: The arm as the cell believes it to be.
        job: The part and its believed places.
        contact: Friction of peg and plate.
        grip: Friction of peg and pads, and the angle in the rack.
        seed: Seed of the trial.
        cell: Errors of arm and places, which stay as long as the cell does.
        part: Errors of the peg and its grasp.
    """
    place, feel, skin = np.random.SeedSequence(seed).spawn(3)
    where, how = np.random.default_rng(place), np.random.default_rng(feel)
    half = np.array([*job.hole.area, 0.0]) / 2
    return Draw(
        hole=np.array(job.hole.centre) + where.uniform(-half, half) + [0.0, 0.0, float(cell["place.plate_height"])],
        tilt_direction=float(where.uniform(-np.pi, np.pi)),
        yaw=float(where.uniform(-job.hole.yaw, job.hole.yaw)),
        friction=_one(contact.friction, how),
        pad_friction=_one(grip.friction, how),
        grasp_angle=float(how.uniform(-grip.angle, grip.angle)),
        skin=np.random.default_rng(skin),
        tilt=job.hole.tilt + float(cell["place.plate_tilt"]),
        rack=cell["place.rack"],
        depth_in_hand=float(part["peg.depth_in_hand"]),
        grip_force=float(part["grip.force"]),
        arm=drawn_arm(arm, cell),
        senses=np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SENSES_STREAM,))),
    )


def _one(spread: Spread, rng: np.random.Generator) -> float:
    low, high = spread if isinstance(spread, tuple) else (spread, spread)
    return float(rng.uniform(low, high))
