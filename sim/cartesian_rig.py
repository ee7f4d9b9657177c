"""A peg on its hinge, carried by an inertia at the tool instead of an arm, and pushed into the hole at a tilt."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from drivers.compiled import njit
from drivers.parts import Job
from drivers.quantities import Vector
from sim import contact, engine, metering, native, rig, shapes
from sim.plate import Plate, geoms, words

STIFFNESS, SIDEWAYS, TURNING = 1000.0, 1500.0, 40.0
"""Stiffness, vertical and sideways, N/m, and rotational, N·m/rad; of the order of the insertion's stiffness."""
DAMPING, TURN_DAMPING = 100.0, 6.0
"""Damping, N·s/m, and rotational damping, N·m·s/rad."""
RATE = 1.0
"""Frequency of the setpoint's circular motion, Hz."""
HINGE = 6
"""Index of the peg's hinge, after three slides and three hinges of the hand."""


class Views(NamedTuple):
    """Arrays that the compiled loop reads and writes."""

    state: engine.Bodies
    tip: Vector
    """Position of the tip, shape (3,), m."""
    axes: Vector
    """Axes of the peg, shape (3, 3), z from the tip upward."""
    centre: Vector
    """Position of the finger centre, shape (3,), m."""


@dataclass(frozen=True, slots=True, eq=False)
class Pressed:
    """Record of a push."""

    path: Vector
    """Position of the tip, m, and tilt, rad, after every step, shape (n, 4)."""
    penetration: float
    """Deepest penetration in the bore or at its rim that lasted longer than 2 ms, m."""


class CartesianRig:
    """A peg on its hinge in a hand that has an inertia and no arm."""

    def __init__(self, job: Job, tilt: float, inertia: Vector, breakaway: float, timestep: float) -> None:
        """Hold the peg over a frictionless hole at the origin.

        Args:
            job: The part and its hole.
            tilt: Tilt of the peg towards x, rad.
            inertia: Inertia at the finger centre along and about each axis, shape (6,), kg and kg·m².
            breakaway: Torque above which the hinge slips, N·m.
            timestep: Time step of the physics, s.
        """
        self._model = _model(job, rig.tilted_axis(tilt, 0.0), inertia, breakaway, timestep)
        self._data = mujoco.MjData(self._model)
        self.tip: Vector = self._data.site_xpos[0]
        """Position of the tip, shape (3,), m; a view."""
        self._views = Views(
            engine.state_of(self._data), self.tip, self._data.site_xmat[0].reshape(3, 3), self._data.xpos[1]
        )

    @property
    def turn(self) -> float:
        """Rotation of the peg in the hand, rad."""
        return float(self._data.qpos[HINGE])

    def put(self, tip: Vector) -> None:
        """Move the tip to a position, shape (3,), m."""
        self._data.qpos[:3] = tip

    def press(self, down: float, sweep: float, steps: int) -> Pressed:
        """Hold the tip at the height `down`, m, on a circle of radius `sweep`, m, for a number of steps."""
        meters, path = metering.new_meters(), np.zeros((steps, 4))
        _press(self._model._address, self._views, down, sweep, self._model.opt.timestep, meters, path)
        return Pressed(path, float(meters[metering.SUSTAINED]))


def _model(job: Job, axis: Vector, inertia: Vector, breakaway: float, timestep: float) -> mujoco.MjModel:
    shapes.install(job.peg.part)
    half = (job.peg.length + job.peg.overhang) / 2
    plate = Plate(np.zeros(3), np.eye(3), job.hole.part.half, job.hole.depth, chamfer=job.hole.chamfer)
    slides = "".join(
        f'<joint type="{kind}" axis="{int(i == 0)} {int(i == 1)} {int(i == 2)}" armature="{inertia[3 * j + i]}"/>'
        for j, kind in enumerate(("slide", "hinge"))
        for i in range(3)
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/>
        <option timestep="{timestep}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-12" ls_tolerance="0.1" iterations="60">
        <flag autoreset="disable"/></option>
        <size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}"/>
        <worldbody>{"".join(geoms("plate", plate, 0.0, timestep))}
        <body name="hand" pos="{words(job.peg.length * axis)}">{slides}
        <inertial mass="1e-6" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/>
        <body name="peg"><joint name="pivot" type="hinge" axis="0 1 0" frictionloss="{breakaway}"
        solreffriction="{2 * timestep} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
        <geom name="peg" {shapes.peg_geom(job.peg.part, half)} pos="{words((half - job.peg.length) * axis)}"
        zaxis="{words(axis)}" mass="{job.peg.mass}" contype="0" conaffinity="1"/>
        <site name="tip" pos="{words(-job.peg.length * axis)}" zaxis="{words(axis)}"/></body></body></worldbody></mujoco>"""
    )


@njit(cache=True)
def _press(
    model: int, views: Views, down: float, sweep: float, timestep: float, meters: Vector, path: Vector
) -> None:  # pragma: no cover
    """Hold the tip by springs and the hand's rotation by separate ones; record the tip's path."""
    state, tip, axes, centre = views.state, views.tip, views.axes, views.centre
    qpos, qvel, qfrc, window = state.qpos, state.qvel, state.qfrc, metering.window(timestep)
    F = np.empty(3)
    for step in range(path.shape[0]):
        angle = 2.0 * math.pi * RATE * step * timestep
        lx, ly, lz = tip[0] - centre[0], tip[1] - centre[1], tip[2] - centre[2]
        wx, wy, wz = qvel[3], qvel[4], qvel[5]
        vx, vy, vz = qvel[0] + wy * lz - wz * ly, qvel[1] + wz * lx - wx * lz, qvel[2] + wx * ly - wy * lx
        # Tip: f = k (x_d - x) - c v. Rotation of the hand: moment = -k_r q - c_r dq + lever × f.
        F[0] = SIDEWAYS * (sweep * math.cos(angle) - tip[0]) - DAMPING * vx
        F[1] = SIDEWAYS * (sweep * math.sin(angle) - tip[1]) - DAMPING * vy
        F[2] = STIFFNESS * (down - tip[2]) - DAMPING * vz
        for i in range(3):
            qfrc[i] = F[i]
            qfrc[3 + i] = -TURNING * qpos[3 + i] - TURN_DAMPING * qvel[3 + i]
        qfrc[3] += ly * F[2] - lz * F[1]
        qfrc[4] += lz * F[0] - lx * F[2]
        qfrc[5] += lx * F[1] - ly * F[0]
        engine.judged_step(model, state, meters, window)
        path[step, 0], path[step, 1], path[step, 2] = tip[0], tip[1], tip[2]
        path[step, 3] = math.atan2(math.sqrt(axes[0, 2] ** 2 + axes[1, 2] ** 2), axes[2, 2])
