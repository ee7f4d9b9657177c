"""A rig for measuring models of arm and grip: the peg is pushed into the hole at a tilt by the arm's own law.

The hole is in closed form each time. What carries the peg goes from a rigid mover over the arm's inertia at the tool
to the whole arm, and the grip from a hinge to pads in contact. The depth is held against the exact one at the tilt
that the peg has at that instant, and the deepest relative to it counts: less is friction, more is a peg in the wall.
"""

import math
import time
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from drivers import impedance
from drivers.arm.model import ArmModel
from drivers.compiled import njit
from drivers.parts import Job
from drivers.quantities import ImpedanceSetpoint, InHandTip, Vector
from sim import contact, cylinder, engine, native, rig
from sim.arm import SimArm
from sim.config import ContactConfig, GripConfig, ModelConfig, SimConfig
from sim.plate import Plate, geoms, words
from sim.section import section_depth
from sim.world import World

KINDS = ("rigid mover", "Cartesian inertia, hinge", "full arm, hinge", "full arm, pads in contact")
TILTS = (5, 15)
"""Degrees."""
TIMESTEP = 5e-4
PUSH, STIFFNESS, SIDEWAYS, TURNING = 10.0, 1000.0, 1500.0, 40.0
"""Force, N; stiffness down and sideways, N/m, and of turning, N·m/rad: of the order of the insertion's."""
DAMPING, TURN_DAMPING = 100.0, 6.0
SWEEP, RATE = 2e-3, 1.0
"""The setpoint goes round on a circle of this radius, m, so often a second: friction must not keep the peg out."""
SECONDS, WAY = 3.0, 2.0
"""Of the push, and of the way to the hole, s."""
GRIP = 30.0
"""N."""
STEP = 5e-3
"""Sideways, in the air, m: how far from it the tip stays."""


@dataclass(frozen=True, slots=True)
class HandRow:
    """What one model of arm and grip did; a row of arm_and_grip.csv."""

    name: str
    real_time: float
    """Multiples of real time, the torque law included, one core."""
    error: float
    """Deepest relative to the exact depth at the tilt of that instant, less 1."""
    penetration: float
    """Deepest that lasted longer than 2 ms, m."""
    left: float
    """How far from its setpoint the tip stays after a step of 5 mm in the air, m."""
    turned: float
    """How far the peg turned in the hand, rad."""
    fault: str = ""


def measure(kind: str, arm: ArmModel, job: Job) -> HandRow:
    """Measure one model of arm and grip; one that cannot work is told in its row."""
    try:
        with native.quiet():
            if kind == "rigid mover":
                return _rigid(job)
            if kind.startswith("Cartesian"):
                return _cartesian(arm, job)
            return _whole(kind, arm, job, "pads" if "pads" in kind else "hinge")
    except Exception as error:
        return HandRow(kind, math.nan, math.inf, math.inf, math.inf, math.inf, f"{type(error).__name__}: {error}")


def _rigid(job: Job) -> HandRow:
    peg, hole = job.peg.diameter, job.hole.diameter
    worst, penetration, spent = -1.0, 0.0, 0.0
    for degrees in TILTS:
        tilt = math.radians(degrees)
        model = rig.tilted_peg(peg, hole, tilt, 0.0, 0.0, TIMESTEP)
        # Once before the clock runs: the first call loads or compiles.
        rig.push(model, peg / 2, tilt, 0.0, PUSH, TIMESTEP)
        started = time.thread_time()
        pushed = rig.push(model, peg / 2, tilt, 0.0, PUSH, SECONDS)
        spent += time.thread_time() - started
        worst = max(worst, pushed.depth / section_depth(peg, hole, tilt, 4001) - 1.0)
        penetration = max(penetration, pushed.penetration)
    return HandRow(KINDS[0], len(TILTS) * SECONDS / spent, worst, penetration, 0.0, 0.0)


def _whole(kind: str, model: ArmModel, job: Job, grip: str) -> HandRow:
    worst, penetration, spent, turned, left = -1.0, 0.0, 0.0, 0.0, 0.0
    for degrees in TILTS:
        world, arm = _holding(model, job, grip)
        tilt = math.radians(degrees)
        left = _lead(world, arm, tilt)
        before, began = _angle(world), world.now()
        world.meters[engine.SUSTAINED] = 0.0
        while world.now() - began < SECONDS:
            where = _circle(world.now() - began)
            goal = world.plate.position + np.array([*where, -PUSH / STIFFNESS])
            arm.follow(_setpoint(world, goal, rig.lean(tilt, 0.0), STIFFNESS))
            started = time.thread_time()
            world.wait_until(world.now() + 0.01)
            spent += time.thread_time() - started
            pose = world.peg_pose()
            axis = pose.rotation[:, 2]
            lean = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
            end = pose.position - (job.peg.length + job.peg.overhang) / 2 * axis - world.plate.position
            worst = max(worst, _excess(job, end, lean))
        turned = max(turned, abs(_angle(world) - before))
        penetration = max(penetration, float(world.meters[engine.SUSTAINED]))
    return HandRow(kind, len(TILTS) * SECONDS / spent, worst, penetration, left, turned)


def _holding(model: ArmModel, job: Job, grip: str) -> tuple[World, SimArm]:
    """Return a world whose hand has the peg, pointing down, and whose hole is frictionless."""
    sim = SimConfig(timestep=TIMESTEP, pace="max", model=ModelConfig(grip=grip))
    world = World(model, sim, ContactConfig(friction=0.0), GripConfig(friction=1.0, angle=0.0), "parallelogram", job)
    arm = SimArm(world)
    arm.halt()
    world.control.drive[engine.DRIVE_FORCE] = GRIP
    world.stepper.hold(0.0)
    world.wait_until(0.5)
    return world, arm


def _lead(world: World, arm: SimArm, tilt: float) -> float:
    """Bring the tip above the hole, leaning; return how far it stays from its setpoint after a step, m."""
    tip, axis = _tip(world)
    above = world.plate.position + np.array([0.0, 0.0, 0.02])
    began, offset = world.now(), np.zeros(3)
    while (elapsed := world.now() - began) < WAY + 1.5:
        share = min(elapsed / WAY, 1.0)
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        way = axis + share * (rig.lean(tilt, 0.0) - axis)
        offset = np.array([STEP, 0.0, 0.0]) if elapsed > WAY + 0.5 else np.zeros(3)
        arm.follow(_setpoint(world, tip + share * (above - tip) + offset, way / np.linalg.norm(way), SIDEWAYS))
        world.wait_until(world.now() + 0.01)
    return float(np.linalg.norm(_tip(world)[0] - above - offset))


def _setpoint(world: World, goal: Vector, axis: Vector, down: float) -> ImpedanceSetpoint:
    stiffness = np.array([SIDEWAYS, SIDEWAYS, down, *[TURNING] * 3])
    damping = np.array([*[DAMPING] * 3, *[TURN_DAMPING] * 3])
    posture = world.q
    posture[2] = 0.05
    return ImpedanceSetpoint(
        id=1,
        tip=goal,
        axis=axis,
        roll=np.array([0.0, -1.0, 0.0]),
        stiffness=stiffness,
        damping=damping,
        valid_until=world.now() + 0.1,
        in_hand=InHandTip(_angle(world), world.job.peg.length, world.now()),
        posture=posture,
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
def _depths(peg: float, hole: float) -> tuple[Vector, Vector]:
    """Return tilts, rad, and the exact depths there, m, as logarithms: between them the depth goes by a power."""
    tilts = np.radians(np.geomspace(0.5, 40.0, 48))
    return np.log(tilts), np.log([section_depth(peg, hole, float(t), 1001) for t in tilts])


def _excess(job: Job, end: Vector, lean: float) -> float:
    """Return how much deeper the peg is than it can be at its tilt, relative; -1 where it is not at the hole."""
    if math.hypot(end[0], end[1]) > job.hole.diameter:
        return -1.0
    depth = job.peg.diameter / 2 * math.sin(lean) - float(end[2])
    return depth / math.exp(np.interp(math.log(lean), *_depths(job.peg.diameter, job.hole.diameter))) - 1.0


def _cartesian(arm_model: ArmModel, job: Job) -> HandRow:
    """Push with the arm's inertia at the tool, taken where the whole arm would push; no joints, and no friction in them."""
    worst, penetration, spent, turned, left = -1.0, 0.0, 0.0, 0.0, 0.0
    for degrees in TILTS:
        tilt = math.radians(degrees)
        world, arm = _holding(arm_model, job, "hinge")
        _lead(world, arm, tilt)
        inertia = np.diag(_inertia(world))
        model = _cartesian_model(job, tilt, inertia, world.stepper.breakaway())
        data = mujoco.MjData(model)
        data.qpos[2] = 2e-3
        meters, log = engine.new_meters(), np.zeros((round(SECONDS / TIMESTEP), 4))
        # In the air first: nothing keeps the tip from its setpoint.
        data.qpos[0] = -STEP
        data.qpos[2] = 0.02
        tip = model.site("tip").id
        _press(
            model._address,
            data._address,
            _views(data, tip),
            0.02,
            0.0,
            2000,
            TIMESTEP,
            engine.window(TIMESTEP),
            meters,
            log,
        )
        left = max(left, float(np.linalg.norm(data.site_xpos[tip] - np.array([0.0, 0.0, 0.02]))))
        meters[:] = 0.0
        started = time.thread_time()
        _press(
            model._address,
            data._address,
            _views(data, tip),
            -PUSH / STIFFNESS,
            SWEEP,
            len(log),
            TIMESTEP,
            engine.window(TIMESTEP),
            meters,
            log,
        )
        spent += time.thread_time() - started
        for x, y, z, lean in log[::20]:
            worst = max(worst, _excess(job, np.array([x, y, z]), lean))
        turned = max(turned, abs(float(data.qpos[6])))
        penetration = max(penetration, float(meters[engine.SUSTAINED]))
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


def _cartesian_model(job: Job, tilt: float, inertia: Vector, breakaway: float) -> mujoco.MjModel:
    cylinder.install()
    half = (job.peg.length + job.peg.overhang) / 2
    plate = Plate(np.zeros(3), np.eye(3), job.hole.diameter / 2, job.hole.depth)
    axis = rig.lean(tilt, 0.0)
    slides = "".join(
        f'<joint type="{kind}" axis="{int(i == 0)} {int(i == 1)} {int(i == 2)}" armature="{inertia[3 * j + i]}"/>'
        for j, kind in enumerate(("slide", "hinge"))
        for i in range(3)
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/>
        <option timestep="{TIMESTEP}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-12" ls_tolerance="0.1" iterations="60">
        <flag autoreset="disable"/></option>
        <size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}"/>
        <worldbody>{"".join(geoms("plate", plate, 0.0, TIMESTEP))}
        <body name="hand" pos="{words(job.peg.length * axis)}">{slides}
        <inertial mass="1e-6" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/>
        <body name="peg"><joint name="pivot" type="hinge" axis="0 1 0" frictionloss="{breakaway}"
        solreffriction="{2 * TIMESTEP} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
        <geom name="peg" type="cylinder" size="{job.peg.diameter / 2} {half}" pos="{words((half - job.peg.length) * axis)}"
        zaxis="{words(axis)}" mass="{job.peg.mass}" contype="0" conaffinity="1"/>
        <site name="tip" pos="{words(-job.peg.length * axis)}" zaxis="{words(axis)}"/></body></body></worldbody></mujoco>"""
    )


def _views(data: mujoco.MjData, tip: int) -> tuple[Vector, ...]:
    return (
        data.qpos,
        data.qvel,
        data.qfrc_applied,
        data.userdata,
        data.site_xpos[tip],
        data.site_xmat[tip].reshape(3, 3),
        data.xpos[1],
    )


@njit(cache=True)
def _press(  # type: ignore[no-untyped-def]
    model, data, views, down, sweep, steps, timestep, window, meters, log
):  # pragma: no cover
    """Hold the tip, turning about the finger centre apart, at `down` on a circle of the radius `sweep`."""
    qpos, qvel, qfrc, userdata, tip, axes, centre = views
    F = np.empty(3)
    for step in range(steps):
        angle = 2.0 * math.pi * RATE * step * timestep
        lx, ly, lz = tip[0] - centre[0], tip[1] - centre[1], tip[2] - centre[2]
        wx, wy, wz = qvel[3], qvel[4], qvel[5]
        vx, vy, vz = qvel[0] + wy * lz - wz * ly, qvel[1] + wz * lx - wx * lz, qvel[2] + wx * ly - wy * lx
        F[0] = SIDEWAYS * (sweep * math.cos(angle) - tip[0]) - DAMPING * vx
        F[1] = SIDEWAYS * (sweep * math.sin(angle) - tip[1]) - DAMPING * vy
        F[2] = STIFFNESS * (down - tip[2]) - DAMPING * vz
        for i in range(3):
            qfrc[i] = F[i]
            qfrc[3 + i] = -TURNING * qpos[3 + i] - TURN_DAMPING * qvel[3 + i]
        qfrc[3] += ly * F[2] - lz * F[1]
        qfrc[4] += lz * F[0] - lx * F[2]
        qfrc[5] += lx * F[1] - ly * F[0]
        userdata[contact.PENETRATION] = 0.0
        native.step(model, data)
        engine.judge(meters, userdata[contact.PENETRATION], window)
        if step < log.shape[0]:
            log[step, 0], log[step, 1], log[step, 2] = tip[0], tip[1], tip[2]
            log[step, 3] = math.atan2(math.sqrt(axes[0, 2] ** 2 + axes[1, 2] ** 2), axes[2, 2])
