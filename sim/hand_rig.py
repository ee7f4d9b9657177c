"""Test rig for models of arm and grip: the peg is pushed into the hole at a tilt by the arm's own law.

The hole is always in closed form. The peg's carrier is a rigid mover, the arm's inertia at the tool, or the whole arm;
the grip is a hinge or pads in contact. The error compares the depth with the exact depth at the instantaneous tilt and
takes the largest ratio. Friction reduces it, and penetration of the wall increases it.
"""

import math
import time
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from drivers import impedance
from drivers.arm.model import ArmModel
from drivers.parts import Job
from drivers.quantities import ImpedanceSetpoint, InHandTip, Vector
from sim import engine, metering, native, rig
from sim.arm import SimArm
from sim.cartesian_rig import RATE, SIDEWAYS, STIFFNESS, TURNING, CartesianRig
from sim.config import ContactConfig, GripConfig, ModelConfig, SimConfig
from sim.section import chamfered_depth, section_depth
from sim.shapes import exact_depth
from sim.world import World

KINDS = ("rigid mover", "Cartesian inertia, hinge", "full arm, hinge", "full arm, pads in contact")
TILTS = (5, 15)
"""Tilts of the peg, degrees."""
TIMESTEP = 5e-4
PUSH = 10.0
"""Force on the peg, N."""
SWEEP = 2e-3
"""Radius of the setpoint's circle, m; its motion prevents friction from holding the peg out."""
SECONDS, WAY = 3.0, 2.0
"""Duration of the push, and of the motion to the hole, s."""
GRIP = 30.0
"""Grip force, N."""
ELBOW = 0.05
"""Position to which the law draws the elbow, rad."""
STEP = 5e-3
"""Sideways setpoint step in the air, m; the tip's remaining distance is measured after it."""


NOT_ROUND = (
    "not measured: the arm's rigs know the exact depth at any attitude of pegs that look the same however turned"
)
"""Reason why a peg with corners is pushed by the rigid mover alone."""


@dataclass(frozen=True, slots=True)
class HandRow:
    """Result of one model of arm and grip; a row of arm_and_grip.csv."""

    name: str
    real_time: float
    """Speed as a multiple of real time, torque law included, one core."""
    error: float
    """Largest ratio of the depth to the exact depth at the tilt of that instant, minus 1, ratio."""
    penetration: float
    """Deepest penetration that lasted longer than 2 ms, m."""
    left: float
    """Distance of the tip from its setpoint after a step of 5 mm in the air, m."""
    turned: float
    """Rotation of the peg in the hand, rad."""
    fault: str = ""


def measure(kind: str, arm: ArmModel, job: Job) -> HandRow:
    """Measure one model of arm and grip; if it cannot work, its row gives the reason."""
    try:
        with native.quiet():
            if kind == KINDS[0]:
                return _rigid(job)
            if job.peg.part.symmetry > 0.0:
                return HandRow(kind, math.nan, math.nan, math.nan, math.nan, math.nan, NOT_ROUND)
            if kind.startswith("Cartesian"):
                return _cartesian(arm, job)
            return _whole(kind, arm, job, "pads" if "pads" in kind else "hinge")
    except Exception as error:  # any failure of a model is a row of the table, not the end of the study
        return HandRow(kind, math.nan, math.inf, math.inf, math.inf, math.inf, f"{type(error).__name__}: {error}")


def _rigid(job: Job) -> HandRow:
    peg, hole = job.peg.part, job.hole.part
    worst, penetration, spent = -1.0, 0.0, 0.0
    for degrees in TILTS:
        tilt = math.radians(degrees)
        model = rig.tilted_peg(peg, hole, tilt, 0.0, 0.0, TIMESTEP)
        # The first call loads or compiles code and must not be timed.
        rig.push(model, peg, tilt, 0.0, PUSH, TIMESTEP)
        started = time.thread_time()
        pushed = rig.push(model, peg, tilt, 0.0, PUSH, SECONDS)
        spent += time.thread_time() - started
        worst = max(worst, pushed.depth / exact_depth(peg, hole, rig.attitude(tilt, 0.0)) - 1.0)
        penetration = max(penetration, pushed.penetration)
    return HandRow(KINDS[0], len(TILTS) * SECONDS / spent, worst, penetration, 0.0, 0.0)


def _whole(kind: str, model: ArmModel, job: Job, grip: str) -> HandRow:
    worst, penetration, spent, turned, left = -1.0, 0.0, 0.0, 0.0, 0.0
    for degrees in TILTS:
        world, arm = _holding(model, job, grip)
        tilt = math.radians(degrees)
        left = _lead(world, arm, tilt)
        before, began = _angle(world), world.now()
        world.meters[metering.SUSTAINED] = 0.0
        while world.now() - began < SECONDS:
            where = _circle(world.now() - began)
            goal = world.plate.position + np.array([*where, -PUSH / STIFFNESS])
            arm.follow(_setpoint(world, goal, rig.tilted_axis(tilt, 0.0), STIFFNESS))
            started = time.thread_time()
            world.wait_until(world.now() + 0.01)
            spent += time.thread_time() - started
            pose = world.peg_pose()
            axis = pose.rotation[:, 2]
            lean = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
            end = pose.position - (job.peg.length + job.peg.overhang) / 2 * axis - world.plate.position
            worst = max(worst, _excess(job, end, lean))
        turned = max(turned, abs(_angle(world) - before))
        penetration = max(penetration, float(world.meters[metering.SUSTAINED]))
    return HandRow(kind, len(TILTS) * SECONDS / spent, worst, penetration, left, turned)


def _holding(model: ArmModel, job: Job, grip: str) -> tuple[World, SimArm]:
    """Return a world with the peg in its hand, pointing down, over a frictionless hole."""
    sim = SimConfig(timestep=TIMESTEP, pace="max", model=ModelConfig(grip=grip))
    world = World(model, sim, ContactConfig(friction=0.0), GripConfig(friction=1.0, angle=0.0), "parallelogram", job)
    arm = SimArm(world)
    arm.halt()
    world.control.drive[engine.DRIVE_FORCE] = GRIP
    world.stepper.hold(0.0)
    world.wait_until(0.5)
    return world, arm


def _lead(world: World, arm: SimArm, tilt: float) -> float:
    """Move the tilted peg's tip above the hole; return its distance from the setpoint after a step, m."""
    tip, axis = _tip(world)
    above = world.plate.position + np.array([0.0, 0.0, 0.02])
    began, offset = world.now(), np.zeros(3)
    while (elapsed := world.now() - began) < WAY + 1.5:
        share = min(elapsed / WAY, 1.0)
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        way = axis + share * (rig.tilted_axis(tilt, 0.0) - axis)
        offset = np.array([STEP, 0.0, 0.0]) if elapsed > WAY + 0.5 else np.zeros(3)
        arm.follow(_setpoint(world, tip + share * (above - tip) + offset, way / np.linalg.norm(way), SIDEWAYS))
        world.wait_until(world.now() + 0.01)
    return float(np.linalg.norm(_tip(world)[0] - above - offset))


def _setpoint(world: World, goal: Vector, axis: Vector, down: float) -> ImpedanceSetpoint:
    stiffness = np.array([SIDEWAYS, SIDEWAYS, down, *[TURNING] * 3])
    return ImpedanceSetpoint(
        id=1,
        tip=goal,
        axis=axis,
        roll=np.array([0.0, -1.0, 0.0]),
        stiffness=stiffness,
        damping_ratio=np.ones(6),
        valid_until=world.now() + 0.1,
        in_hand=InHandTip(_angle(world), world.job.peg.length, world.now()),
        posture=world.arm.posture(world.q, ELBOW),
    )


def _angle(world: World) -> float:
    axis = world.tcp().rotation.T @ world.peg_pose().rotation[:, 2]
    return math.atan2(-axis[1], -axis[0])


def _tip(world: World) -> tuple[Vector, Vector]:
    pose, peg = world.peg_pose(), world.job.peg
    axis = pose.rotation[:, 2].copy()
    return pose.position - (peg.length + peg.overhang) / 2 * axis, axis


def _circle(elapsed: float) -> Vector:
    angle = 2.0 * math.pi * RATE * elapsed
    return SWEEP * np.array([math.cos(angle), math.sin(angle)])


@cache
def _depths(job: Job) -> tuple[Vector, Vector]:
    """Return tilts, rad, and their exact depths, m, as logarithms: between tilts the depth follows a power law."""
    tilts = np.radians(np.geomspace(0.5, 40.0, 48))
    peg, hole = job.peg.part, job.hole.part
    if peg.chamfer > 0.0 or hole.chamfer > 0.0:
        return np.log(tilts), np.log([chamfered_depth(peg, hole, float(t), 501) for t in tilts])
    return np.log(tilts), np.log([section_depth(peg.thickness, hole.thickness, float(t), 1001) for t in tilts])


def _excess(job: Job, end: Vector, lean: float) -> float:
    """Return the excess of the depth over the exact depth at this tilt, relative; -1 if the peg is not at the hole."""
    if math.hypot(end[0], end[1]) > job.hole.part.thickness:
        return -1.0
    depth = (job.peg.part.thickness / 2 - job.peg.chamfer) * math.sin(lean) - float(end[2])
    return depth / math.exp(np.interp(math.log(lean), *_depths(job))) - 1.0


def _cartesian(arm_model: ArmModel, job: Job) -> HandRow:
    """Push with the arm's inertia at the tool, taken at the pose of the push, without joints and their friction."""
    worst, penetration, spent, turned, left = -1.0, 0.0, 0.0, 0.0, 0.0
    for degrees in TILTS:
        tilt = math.radians(degrees)
        world, arm = _holding(arm_model, job, "hinge")
        _lead(world, arm, tilt)
        carried = CartesianRig(job, tilt, np.diag(_inertia(world)), world.stepper.grip_limits().torque, TIMESTEP)
        # In the air the tip follows its setpoint without resistance.
        carried.put(np.array([-STEP, 0.0, 0.02]))
        carried.press(0.02, 0.0, 2000)
        left = max(left, float(np.linalg.norm(carried.tip - np.array([0.0, 0.0, 0.02]))))
        started = time.thread_time()
        pressed = carried.press(-PUSH / STIFFNESS, SWEEP, round(SECONDS / TIMESTEP))
        spent += time.thread_time() - started
        for x, y, z, lean in pressed.path[::20]:
            worst = max(worst, _excess(job, np.array([x, y, z]), lean))
        turned = max(turned, abs(carried.turn))
        penetration = max(penetration, pressed.penetration)
    return HandRow(KINDS[1], len(TILTS) * SECONDS / spent, worst, penetration, left, turned)


def _inertia(world: World) -> Vector:
    """Return the arm's inertia at the finger centre, (J M^-1 J^T)^-1, shape (6, 6)."""
    model, data = world.physics()
    M = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    position, _, axes, origins = impedance.forward(impedance.figures(world.arm), world.q)
    J = np.vstack([np.cross(axes, position - origins).T, axes.T])
    inertia: Vector = np.linalg.inv(J @ np.linalg.solve(M[:7, :7], J.T))
    return inertia
