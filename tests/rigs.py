"""Rigs for the gates of the stand-in: a peg at a fixed attitude on three slides above plates, and a whole world."""

from collections.abc import Callable

import mujoco
import numpy as np

from cell.config.load import load
from cell.lab.contact_rig import HOLE_DEPTH, SLIDES, peg_above
from drivers.frames import UP, rotation_about
from drivers.part.contract import Part
from sim.contact.plate import Plate, geoms
from sim.world import metering
from sim.world.physics import World
from skills.search.surface import SurfaceEstimate

DT = 0.0005
"""Time step of the gates, s."""
Drive = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""Force on the peg at a time, s, from its place, m, and speed, m/s."""


def plate_with(hole: Part, yaw: float = 0.0) -> Plate:
    """Return a plate with a hole at its origin, turned by `yaw` about its normal."""
    return Plate(np.zeros(3), rotation_about(UP, yaw), hole.half, HOLE_DEPTH, chamfer=hole.chamfer)


def over(
    plate: Plate, peg: Part, axes: np.ndarray, friction: float = 0.0, joints: str = SLIDES
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a peg with these axes over a plate, and the data; the centre of its end is the slides' origin."""
    model = peg_above(geoms("plate", plate, friction, DT), peg, axes, DT, joints)
    return model, mujoco.MjData(model)


def driven(model: mujoco.MjModel, data: mujoco.MjData, drive: Drive, steps: int) -> float:
    """Move the peg by a force, and return the deepest lasting penetration in the bore or at its rim, m."""
    meters = metering.new_meters()
    for step in range(steps):
        data.qfrc_applied[:] = drive(step * DT, data.qpos, data.qvel)
        metering.clear(data.userdata)
        mujoco.mj_step(model, data)
        metering.judge(meters, data.userdata, metering.window(DT))
    return float(meters[metering.SUSTAINED])


def pushed(
    plate: Plate, peg: Part, axes: np.ndarray, start: np.ndarray, friction: float = 0.0, steps: int = 3000
) -> tuple[float, float]:
    """Push a peg down with 10 N from above a place, free to move sideways, until it rests.

    Returns:
        Depth of its lowest point below the surface, m, and the deepest penetration that lasted, m.
    """
    model, data = over(plate, peg, axes, friction)
    edge = peg.lowest(np.zeros(3), axes[:, 2], axes[:, 0])
    data.qpos[:] = [*start, 1e-4 - edge[2]]
    lasted = driven(model, data, lambda time, place, speed: np.array([0.0, 0.0, -10.0]) - 5.0 * speed, steps)
    return -float(edge[2] + data.qpos[2]), lasted


def dragged(plate: Plate, peg: Part, axes: np.ndarray, degrees: float, beside: float) -> tuple[float, float]:
    """Drag the lowest point of a leaning peg past a hole at a distance from its axis, m, in a direction.

    Returns:
        Change of the lateral force on the way, N, and the deepest dip that the search would see, m.
    """
    push, speed, direction = 5.0, 0.05, np.radians(degrees)
    way = np.array([np.cos(direction), np.sin(direction)])
    model, data = over(plate, peg, axes, 0.2)
    edge = peg.lowest(np.zeros(3), axes[:, 2], axes[:, 0])
    start = beside * np.array([-way[1], way[0]]) - 0.015 * way - edge[:2]
    data.qpos[:] = [*start, -edge[2]]
    surface, forces, dip = SurfaceEstimate(), [], 0.0
    for step in range(int(0.030 / speed / DT)):
        servo = 5e4 * (start + way * speed * step * DT - data.qpos[:2]) + 300.0 * (way * speed - data.qvel[:2])
        data.qfrc_applied[:] = [*servo, -push]
        mujoco.mj_step(model, data)
        if step * DT > 0.05:
            forces.append(servo.copy())
        if step % 20 == 0:
            depth, deviation = surface.below(data.qpos[:3])
            dip = max(dip, depth - deviation)
            surface.learn(data.qpos[:3].copy())
    return float(np.ptp(np.array(forces), axis=0).max()), dip


def world_of(*sets: str) -> World:
    """Return the world of an ideal cell with these settings."""
    config = load(sets=("sim.pace=max", "reality.scale=0.0", *sets)).cell
    assert config.sim is not None
    assert config.contact is not None
    assert config.grip is not None
    return World(config.arm_model(), config.sim, config.contact, config.grip, config.skin.layout, config.job())
