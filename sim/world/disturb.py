"""Differences from trial to trial, all drawn from the trial's seed."""

from dataclasses import dataclass, replace

import numpy as np

from drivers.arm.model import ArmModel
from drivers.parts import Job
from drivers.quantities import Vector
from sim.arm.arm_truth import ArmTruth
from sim.arm.drawn_arm import drawn_arm
from sim.config import ContactConfig, FixtureConfig, GripConfig, Spread
from sim.world.reality import AS_BELIEVED, Drawn

SENSES_STREAM = 6
"""Key of the random stream of the noise in the arm's readings; lower keys are in use."""

FIXTURE_STREAM = 7
"""Key of the random stream of a fixture's position and of its variation from part to part."""


@dataclass(frozen=True, slots=True, eq=False)
class Draw:
    """True properties of the cell in one trial."""

    seed: int
    """Seed of the trial."""
    hole: Vector
    """Centre of the hole's mouth, shape (3,), m, base frame."""
    tilt_direction: float
    """Azimuth of the tilt of the plate's normal, rad."""
    yaw: float
    """Yaw of the hole if it is not round, rad."""
    friction: float
    """Coulomb coefficient between peg and plate."""
    pad_friction: float
    """Coulomb coefficient between peg and pads."""
    shear_stiffness: float
    """Stiffness of both pads in their plane, N/m."""
    grasp_angle: float
    """In-hand angle of the peg in the rack, rad."""
    skin: np.random.Generator
    """Random generator of the skin's gains, dead taxels and noise."""
    tilt: float
    """Tilt of the plate's normal from the vertical, rad; `sim.plate.tilt` is added."""
    rack: Vector
    """Offset of the rack from its stated position, shape (3,), m, base frame."""
    depth_in_hand: float
    """Error of the peg's length beyond the finger centre after the grasp, true minus assumed, m."""
    grip_force: float
    """True finger force divided by the commanded force, ratio."""
    latch_force: float
    """True latch force divided by the stated force, ratio."""
    latch_place: float
    """Height of the latch above its stated height, m."""
    arm: ArmTruth
    """The true arm."""
    senses: np.random.Generator
    """Random generator of the noise in the arm's readings."""


def draw(
    arm: ArmModel,
    job: Job,
    contact: ContactConfig,
    grip: GripConfig,
    seed: int,
    cell: Drawn = AS_BELIEVED,
    part: Drawn = AS_BELIEVED,
) -> Draw:
    """Return the draw of the trial with this seed; random streams are independent, so that no draw shifts another.

    Args:
        arm: The arm that the cell assumes.
        job: The part and its assumed positions.
        contact: Friction of peg and plate.
        grip: Friction and shear of the pads, and the angle in the rack.
        seed: Seed of the trial.
        cell: Errors of arm, pads and positions, constant over the life of the cell.
        part: Errors of the peg and its grasp.
    """
    place, feel, skin = np.random.SeedSequence(seed).spawn(3)
    where, how = np.random.default_rng(place), np.random.default_rng(feel)
    half = np.array([*job.hole.area, 0.0]) / 2
    return Draw(
        seed=seed,
        hole=np.array(job.hole.centre) + where.uniform(-half, half) + [0.0, 0.0, float(cell["place.plate_height"])],
        tilt_direction=float(where.uniform(-np.pi, np.pi)),
        yaw=float(where.uniform(-job.hole.yaw, job.hole.yaw)),
        friction=_one(contact.friction, how),
        pad_friction=_one(grip.friction, how) * float(part["grip.pad_friction"]),
        shear_stiffness=grip.shear_stiffness * float(cell["grip.shear_stiffness"]),
        grasp_angle=float(how.uniform(-grip.angle, grip.angle)),
        skin=np.random.default_rng(skin),
        tilt=float(cell["place.plate_tilt"]),
        rack=cell["place.rack"],
        depth_in_hand=float(part["peg.depth_in_hand"]),
        grip_force=float(part["grip.force"]),
        latch_force=float(part["latch.force"]),
        latch_place=float(part["latch.place"]),
        arm=drawn_arm(arm, cell),
        senses=np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SENSES_STREAM,))),
    )


def in_fixture(drawn: Draw, fixture: FixtureConfig, job: Job, first_seed: int, seed: int) -> Draw:
    """Return the draw of a trial whose plate lies in a fixture.

    Args:
        drawn: The draw of the trial without a fixture.
        fixture: Distribution of the plate's position from part to part.
        job: The part and its assumed positions.
        first_seed: Seed of the cell's first run; it determines the position of a fixture if the config states none.
        seed: Seed of the trial.
    """
    half, centre = np.array(job.hole.area) / 2, np.array(job.hole.centre[:2])
    standing = np.random.default_rng(np.random.SeedSequence(first_seed, spawn_key=(FIXTURE_STREAM, 0)))
    moved = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(FIXTURE_STREAM, 1)))
    mean = standing.uniform(-half, half) if fixture.mean is None else np.array(fixture.mean) - centre
    place = np.clip(mean + moved.normal(0.0, fixture.deviation, 2), -half, half)
    return replace(drawn, hole=np.array([*(centre + place), drawn.hole[2]]))


def _one(spread: Spread, rng: np.random.Generator) -> float:
    low, high = spread if isinstance(spread, tuple) else (spread, spread)
    return float(rng.uniform(low, high))
