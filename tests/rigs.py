"""Rigs for the contact gates: a peg at a fixed attitude on three slides above one hole, or moved by springs."""

import math
from typing import Any

import mujoco
import numpy as np

from drivers.frames import UP, rotation_about
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round
from sim.contact import rectangular, rig
from sim.contact import table as contact
from sim.contact.plate import Plate, geoms, words
from sim.contact.rig import HOLE_DEPTH as HOLE_DEPTH
from sim.contact.section import section_depth as section_depth
from sim.world import metering, native


def tilted_peg(diameter: float, hole: float, *how: Any, **more: Any) -> mujoco.MjModel:
    """Return a round peg over a round hole; see `sim.contact.rig.tilted_peg` for what follows their diameters, m."""
    return rig.tilted_peg(Round(diameter), Round(hole), *how, **more)


def pushed_depth(
    model: mujoco.MjModel, radius: float, tilt: float, azimuth: float, push: float, steps: int
) -> tuple[float, float]:
    """Push the peg down, free to move sideways, from above the hole until it rests.

    Returns:
        Depth of its lowest point below the surface, m, and the deepest penetration in the bore or at its rim, m.
    """
    data = mujoco.MjData(model)
    data.qpos[:2] = -0.3 * radius * math.cos(tilt) * np.array([math.cos(azimuth), math.sin(azimuth)])
    data.qpos[2] = radius * math.sin(tilt) + 1e-4
    for _ in range(steps):
        data.qfrc_applied[:] = np.array([0.0, 0.0, -push]) - 5.0 * data.qvel
        mujoco.mj_step(model, data)
    return float(radius * math.sin(tilt) - data.qpos[2]), float(data.userdata[contact.PENETRATION])


SIGNS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def leaning(tilt: float, azimuth: float) -> np.ndarray:
    """Return the axes of a square peg whose faces look along x and y until it leans towards `azimuth`."""
    return rotation_about(np.array([-math.sin(azimuth), math.cos(azimuth), 0.0]), tilt)


def square_peg(
    side: float, hole: float, axes: np.ndarray, yaw: float, friction: float, timestep: float, joints: str = ""
) -> mujoco.MjModel:
    """Return a square peg whose end's middle is at its body's origin, over a square hole turned by `yaw`."""
    return rectangular_peg(Rectangular(side, side), Rectangular(hole, hole), axes, yaw, friction, timestep, joints)


def rectangular_peg(
    peg: Rectangular,
    hole: Rectangular,
    axes: np.ndarray,
    yaw: float,
    friction: float,
    timestep: float,
    joints: str = "",
) -> mujoco.MjModel:
    """Return a rectangular peg whose end's middle is at its body's origin, over a rectangular hole turned by `yaw`."""
    rectangular.install()
    slides = "".join(f'<joint type="slide" axis="{words(axis)}"/>' for axis in np.eye(3))
    quat, length = np.empty(4), 0.05
    mujoco.mju_mat2Quat(quat, axes.flatten())
    plate = Plate(np.zeros(3), rotation_about(UP, yaw), hole.half, HOLE_DEPTH)
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{timestep}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-14" iterations="60">
        <flag autoreset="disable"/></option><size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}"/>
        <worldbody>{"".join(geoms("plate", plate, friction, timestep))}
        <body name="peg">{joints or slides}<geom name="peg" type="box" size="{peg.half[0]} {peg.half[1]} {length / 2}"
        pos="{words(axes[:, 2] * length / 2)}" quat="{words(quat)}" mass="0.5" contype="0" conaffinity="1"/></body></worldbody></mujoco>"""
    )


def square_section_depth(side: float, hole: float, axes: np.ndarray, yaw: float) -> float:
    """Return how deep the lowest corner can go, m: what of the peg is below the surface must fit between the walls."""
    corners = np.array([side / 2 * (s * axes[:, 0] + t * axes[:, 1]) for s, t in SIGNS])
    ends = np.concatenate([np.roll(corners, -1, axis=0), corners + 0.2 * axes[:, 2]])
    starts, along = np.concatenate([corners, corners]), rotation_about(UP, yaw)[:, :2]

    def fits(depth: float) -> bool:
        surface = corners[:, 2].min() + depth
        crosses = (starts[:, 2] - surface) * (ends[:, 2] - surface) < 0.0
        a, b = starts[crosses], ends[crosses]
        cut = a + (b - a) * ((surface - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
        below = np.concatenate([corners[corners[:, 2] <= surface], cut]) @ along
        return bool((np.ptp(below, axis=0) <= hole).all())

    low, high = 0.0, HOLE_DEPTH
    for _ in range(40):
        depth = (low + high) / 2
        low, high = (depth, high) if fits(depth) else (low, depth)
    return low


def pushed_square_depth(
    model: mujoco.MjModel, side: float, axes: np.ndarray, beside: np.ndarray, push: float, steps: int
) -> tuple[float, float]:
    """Push a square peg down from `beside` the hole's middle; see `pushed_depth`."""
    return pushed_rectangle_depth(model, Rectangular(side, side), axes, beside, push, steps)


def pushed_rectangle_depth(
    model: mujoco.MjModel, peg: Rectangular, axes: np.ndarray, beside: np.ndarray, push: float, steps: int
) -> tuple[float, float]:
    """Push a rectangular peg down from `beside` the hole's middle; see `pushed_depth`."""
    data = mujoco.MjData(model)
    lowest = peg.half[0] * abs(axes[2, 0]) + peg.half[1] * abs(axes[2, 1])
    data.qpos[:] = [*beside, lowest + 1e-4]
    for _ in range(steps):
        data.qfrc_applied[:] = np.array([0.0, 0.0, -push]) - 5.0 * data.qvel
        mujoco.mj_step(model, data)
    return float(lowest - data.qpos[2]), float(data.userdata[contact.PENETRATION])


def worked_in(yaw: float, friction: float, seconds: float, timestep: float) -> tuple[float, float]:
    """Work a square peg into the hole with an arm's inertia and springs: circles, tilting, turning, 10 N down.

    Returns:
        Depth of the end's middle, m, and the deepest penetration that lasted longer than 2 ms, m.
    """
    joints = '<freejoint/><inertial pos="0 0 0.03" mass="3" diaginertia="0.03 0.03 0.03"/>'
    model = square_peg(0.008, 0.0081, np.eye(3), yaw, friction, timestep, joints)
    data, meters = mujoco.MjData(model), metering.new_meters()
    axes, middle = data.body("peg").xmat.reshape(3, 3), data.body("peg").xipos
    data.qpos[2] = 0.003
    for step in range(round(seconds / timestep)):
        t = step * timestep
        mujoco.mj_kinematics(model, data)
        turn, lever = axes @ data.qvel[3:], -0.03 * axes[:, 2]
        away = middle + lever - 0.6e-3 * np.array([math.sin(7.0 * t), math.cos(9.0 * t), 0.0])
        speed = data.qvel[:3]
        force = -np.array([1500.0, 1500.0, 0.0]) * away - np.array([90.0, 90.0, 250.0]) * speed - 10.0 * UP
        goal = np.array([0.3 * math.exp(-t) * math.cos(6.3 * t), 0.3 * math.exp(-t) * math.sin(6.3 * t), 1.0])
        torque = 40.0 * np.cross(axes[:, 2], goal) - np.array([5.0, 5.0, 1.0]) * turn + np.cross(lever, force)
        torque[2] += 8.0 * (0.12 * math.sin(5.0 * t) - math.atan2(axes[1, 0], axes[0, 0]))
        data.xfrc_applied[1] = [*force, *torque]
        data.userdata[contact.PENETRATION] = 0.0
        mujoco.mj_step(model, data)
        metering.judge(meters, data.userdata, metering.window(timestep))
    return -float((middle + lever)[2]), float(meters[metering.SUSTAINED])


def left_after_a_drop(model: mujoco.MjModel, steps: int) -> tuple[float, float]:
    """Drop a peg into the bore at 0.3 m/s, let it settle, and return how far it moves in so many steps, m and rad, and its
    speed at their end, m/s and rad/s."""
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[2] = 0.001, -0.3
    for _ in range(4000):
        data.qfrc_applied[:] = [0.0, 0.0, -2.0]
        mujoco.mj_step(model, data)
    rest = data.qpos.copy()
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return float(np.abs(data.qpos - rest).max()), float(np.abs(data.qvel).max())
