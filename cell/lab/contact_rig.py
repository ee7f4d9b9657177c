"""Test rig for models of the hole: a peg at a fixed attitude on three slides is pushed in, dragged, or dropped.

The slides are rigid, so that only the contacts are compliant. The computation is the same for every model.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from cell.lab.hole_models import HoleModel, geoms
from drivers.compiled import njit
from drivers.frames import rotation_about
from drivers.part.contract import Part
from drivers.quantities import Vector
from sim.contact import shapes
from sim.contact import table as contact
from sim.contact.plate import Plate, words
from sim.world import engine, metering, native

SHIPPED = HoleModel()
HOLE_DEPTH = 0.03
SLIDES = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
MASS = 0.5
"""Mass of the peg and its carrier, kg."""
SERVO_STIFFNESS, SERVO_DAMPING = 5e4, 300.0
"""Stiffness, N/m, and damping, N·s/m, of the slides during a drag."""


def tilted_peg(
    peg: Part,
    hole: Part,
    tilt: float,
    azimuth: float,
    friction: float,
    timestep: float,
    model: HoleModel = SHIPPED,
    is_judged: bool = True,
) -> mujoco.MjModel:
    """Return the model of a peg over a hole, tilted by `tilt` towards `azimuth`; the centre of the peg's end is the origin of
    the slides.

    Args:
        peg: Cross-section of the peg.
        hole: Cross-section of the hole, aligned with an upright peg.
        tilt: Tilt of the peg from the hole's axis, rad.
        azimuth: Tilt azimuth, rad.
        friction: Coulomb coefficient.
        timestep: Time step of the physics, s.
        model: Model of the hole.
        is_judged: True to meter the penetration even if facets make the contacts.
    """
    plate = Plate(np.zeros(3), np.eye(3), hole.half, HOLE_DEPTH, chamfer=hole.chamfer)
    around = geoms(plate, friction, timestep, model, is_judged)
    return peg_above(around, peg, attitude(tilt, azimuth), timestep, flags=model.flags())


def peg_above(
    plate: Sequence[str], peg: Part, axes: Vector, timestep: float, joints: str = SLIDES, flags: str = ""
) -> mujoco.MjModel:
    """Return the model of a peg with these axes, shape (3, 3), above the geoms of a plate.

    The geoms, the joints and the flags are MuJoCo's XML. The centre of the peg's end is the origin of the joints.
    """
    shapes.install(peg)
    length, turn = 0.05, np.empty(4)
    mujoco.mju_mat2Quat(turn, axes.flatten())
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{timestep}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-14" iterations="60">
        <flag autoreset="disable" {flags}/></option>
        <size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}"/><worldbody>{"".join(plate)}
        <body>{joints}<geom name="peg" {shapes.peg_geom(peg, length / 2)} pos="{words(axes[:, 2] * length / 2)}"
        quat="{words(turn)}" mass="{MASS}" contype="0" conaffinity="1"/></body></worldbody></mujoco>"""
    )


def attitude(tilt: float, azimuth: float) -> Vector:
    """Return the axes of a peg tilted by `tilt` towards `azimuth`, rad, shape (3, 3); x the closing axis, z upward."""
    return rotation_about(np.array([-math.sin(azimuth), math.cos(azimuth), 0.0]), tilt)


def lowest(peg: Part, tilt: float, azimuth: float) -> Vector:
    """Return the vector from the centre of a tilted peg's end to its lowest point, shape (3,), m."""
    axes = attitude(tilt, azimuth)
    return peg.lowest(np.zeros(3), axes[:, 2], axes[:, 0])


@dataclass(frozen=True, slots=True)
class Pushed:
    """Result of a push."""

    depth: float
    """Depth of the peg's lowest point below the surface, m; NaN if the state is no longer finite."""
    penetration: float
    """Deepest penetration in the bore or at its rim that lasted longer than 2 ms, m."""
    speed: float
    """Largest speed in the last tenth of the time, m/s; with a stable contact the peg is then at rest."""


def push(model: mujoco.MjModel, peg: Part, tilt: float, azimuth: float, force: float, seconds: float) -> Pushed:
    """Push the peg down from above the hole; sideways it is free.

    Args:
        model: Model from `tilted_peg`.
        peg: Cross-section of the peg.
        tilt: Tilt of the peg, rad.
        azimuth: Tilt azimuth, rad.
        force: Downward force, N.
        seconds: Duration, s.
    """
    data = mujoco.MjData(model)
    edge = lowest(peg, tilt, azimuth)
    data.qpos[:2] = -0.3 * edge[:2]
    data.qpos[2] = 1e-4 - edge[2]
    meters, steps = metering.new_meters(), round(seconds / model.opt.timestep)
    speed = _push(model._address, engine.state_of(data), force, steps, metering.window(model.opt.timestep), meters)
    depth = -float(edge[2] + data.qpos[2])
    if not math.isfinite(depth + speed):
        depth = speed = math.nan
    return Pushed(depth, float(meters[metering.SUSTAINED]), speed)


@njit(cache=True)
def _push(
    model: int, state: engine.Bodies, force: float, steps: int, window: int, meters: Vector
) -> float:  # pragma: no cover
    qpos, qvel, qfrc = state.qpos, state.qvel, state.qfrc
    speed = 0.0
    for step in range(steps):
        for i in range(3):
            # Damping of the slides during a push, N·s/m.
            qfrc[i] = -5.0 * qvel[i]
        qfrc[2] -= force
        metering.clear(state.userdata)
        native.step(model, state.data)
        metering.judge(meters, state.userdata, window)
        if not abs(qpos[2]) < 10.0:
            return math.nan
        if step >= 0.9 * steps:
            for i in range(3):
                speed = max(speed, abs(qvel[i]))
    return speed


def drag(model: mujoco.MjModel, peg: Part, tilt: float, direction: float, beside: float) -> float:
    """Drag a tilted peg past the hole over solid plate, and return the peak-to-peak lateral force, N.

    A smooth plate without friction exerts no lateral force, so that any variation is caused by seams.

    Args:
        model: Model from `tilted_peg`, tilted towards azimuth 0.
        peg: Cross-section of the peg.
        tilt: Tilt of the peg, rad.
        direction: Azimuth of the path, rad.
        beside: Distance between the path of the peg's lowest point and the hole's axis, m.
    """
    data, dt, speed, push_force = mujoco.MjData(model), model.opt.timestep, 0.05, 5.0
    way = np.array([math.cos(direction), math.sin(direction)])
    across = np.array([-way[1], way[0]])
    edge = lowest(peg, tilt, 0.0)
    start = beside * across - 0.015 * way - edge[:2]
    data.qpos[:] = [*start, -edge[2]]
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    steps = round(0.030 / speed / dt)
    _drag(model._address, engine.state_of(data), start, way * speed, push_force, steps, dt, low, high)
    return float((high - low).max())


@njit(cache=True)
def _drag(
    model: int,
    state: engine.Bodies,
    start: Vector,
    speed: Vector,
    force: float,
    steps: int,
    timestep: float,
    low: Vector,
    high: Vector,
) -> None:  # pragma: no cover
    qpos, qvel, qfrc = state.qpos, state.qvel, state.qfrc
    for step in range(steps):
        for i in range(2):
            target = start[i] + speed[i] * step * timestep
            qfrc[i] = SERVO_STIFFNESS * (target - qpos[i]) + SERVO_DAMPING * (speed[i] - qvel[i])
            if step * timestep > 0.05:
                low[i], high[i] = min(low[i], qfrc[i]), max(high[i], qfrc[i])
        qfrc[2] = -force
        native.step(model, state.data)
