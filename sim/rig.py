"""A rig for measuring models of the hole: a peg at a fixed attitude on three slides, pushed in, dragged, or dropped.

The slides are a rigid mover: nothing but the contacts gives way. The same work for every model.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers.compiled import njit
from drivers.quantities import Vector
from sim import contact, cylinder, engine, native
from sim.config import ModelConfig
from sim.plate import EXACT, Plate, flags, geoms, words

HOLE_DEPTH = 0.03
MASS = 0.5
"""Of the peg and what moves it, kg."""
DAMPING = 5.0
"""Of the slides while the peg is pushed, N·s/m."""
SERVO_STIFFNESS, SERVO_DAMPING = 5e4, 300.0
"""Of the slides while the peg is dragged, N/m and N·s/m."""


def tilted_peg(
    diameter: float,
    hole: float,
    tilt: float,
    azimuth: float,
    friction: float,
    timestep: float,
    model: ModelConfig = EXACT,
    is_judged: bool = True,
) -> mujoco.MjModel:
    """Return a peg whose end's middle is at the slides' origin, leaning by `tilt` towards `azimuth`, over a hole there.

    Args:
        diameter: Of the peg, m.
        hole: Diameter of the hole, m.
        tilt: rad.
        azimuth: rad.
        friction: Coulomb coefficient.
        timestep: s.
        model: Of the hole.
        is_judged: Whether the penetration is told also for facets.
    """
    cylinder.install()
    length = 0.05
    axis = lean(tilt, azimuth)
    plate = Plate(np.zeros(3), np.eye(3), (hole / 2, hole / 2), HOLE_DEPTH)
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{timestep}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-14" iterations="60">
        <flag autoreset="disable" {flags(model)}/></option>
        <size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}"/>
        <worldbody>{"".join(geoms("plate", plate, friction, timestep, model, is_judged))}
        <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
        <geom name="peg" type="cylinder" size="{diameter / 2} {length / 2}" pos="{words(axis * length / 2)}"
        zaxis="{words(axis)}" mass="{MASS}" contype="0" conaffinity="1"/></body></worldbody></mujoco>"""
    )


def lean(tilt: float, azimuth: float) -> Vector:
    """Return the peg's axis, from its end upward."""
    return np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])


@dataclass(frozen=True, slots=True)
class Pushed:
    """A peg after it was pushed."""

    depth: float
    """Of its lowest point below the surface, m; NaN when the state is no longer finite."""
    penetration: float
    """Deepest in the bore or at its rim that lasted longer than 2 ms, m."""
    speed: float
    """Largest in the last tenth, m/s: what should be at rest."""


def push(model: mujoco.MjModel, radius: float, tilt: float, azimuth: float, force: float, seconds: float) -> Pushed:
    """Push the peg down, free to move sideways, from above the hole.

    Args:
        model: From `tilted_peg`.
        radius: Of the peg, m.
        tilt: Of the peg, rad.
        azimuth: rad.
        force: N.
        seconds: How long, s.
    """
    data = mujoco.MjData(model)
    data.qpos[:2] = -0.3 * radius * math.cos(tilt) * np.array([math.cos(azimuth), math.sin(azimuth)])
    data.qpos[2] = radius * math.sin(tilt) + 1e-4
    meters, steps = engine.new_meters(), round(seconds / model.opt.timestep)
    speed = _push(model._address, engine.state_of(data), force, steps, engine.window(model.opt.timestep), meters)
    depth = radius * math.sin(tilt) - float(data.qpos[2])
    if not math.isfinite(depth + speed):
        depth = speed = math.nan
    return Pushed(depth, float(meters[engine.SUSTAINED]), speed)


@njit(cache=True)
def _push(
    model: int, state: engine.State, force: float, steps: int, window: int, meters: Vector
) -> float:  # pragma: no cover
    qpos, qvel, qfrc = state.qpos, state.qvel, state.qfrc
    speed = 0.0
    for step in range(steps):
        for i in range(3):
            qfrc[i] = -DAMPING * qvel[i]
        qfrc[2] -= force
        engine.judged_step(model, state, meters, window)
        if not abs(qpos[2]) < 10.0:
            return math.nan
        if step >= 0.9 * steps:
            for i in range(3):
                speed = max(speed, abs(qvel[i]))
    return speed


def drag(model: mujoco.MjModel, radius: float, tilt: float, direction: float, beside: float) -> float:
    """Drag a leaning peg past the hole over solid plate, and return the lateral force's swing, peak to peak, N.

    On a smooth plate without friction nothing holds it back: what is felt are seams.

    Args:
        model: From `tilted_peg`, leaning towards azimuth 0.
        radius: Of the peg, m.
        tilt: Of the peg, rad.
        direction: Of the path, rad.
        beside: Distance of the path of the lowest point from the hole's axis, m.
    """
    data, dt, speed, push_force = mujoco.MjData(model), model.opt.timestep, 0.05, 5.0
    way = np.array([math.cos(direction), math.sin(direction)])
    across = np.array([-way[1], way[0]])
    # The edge that slides is ahead of the end's middle by r cos t.
    start = beside * across - 0.015 * way - np.array([radius * math.cos(tilt), 0.0])
    data.qpos[:] = [*start, radius * math.sin(tilt)]
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    steps = round(0.030 / speed / dt)
    _drag(model._address, engine.state_of(data), start, way * speed, push_force, steps, dt, low, high)
    return float((high - low).max())


@njit(cache=True)
def _drag(
    model: int,
    state: engine.State,
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
