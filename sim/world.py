"""Owns model and data, steps the physics, and is the cell's Clock.

The peg is at every time in one of three situations: a body of its own (`FREE`: in the rack, between the
pads, in the hole), on the hinge of the hand (`HELD`), or out of play (`GONE`). The world passes from FREE to
HELD when the pads hold the peg clear of the rack, and back when the fingers open; positions and velocities
go along.
"""

import math
import time
from dataclasses import dataclass
from enum import Enum

import mujoco
import numpy as np

from drivers import frames, impedance
from drivers.arm.model import JOINTS, ArmModel
from drivers.errors import SimulationUnstableError
from drivers.parts import Job
from drivers.quantities import Pose, Vector
from drivers.skin.layout import Layout, pad_size
from sim import contact, cylinder, engine, scene, square
from sim.config import ContactConfig, GripConfig, SimConfig
from sim.disturb import Draw, draw
from sim.pads import PadLoad, breakaway_torque_of
from sim.plate import Plate

GRAVITY = 9.81
SETTLED_GRIP = 0.05
"""The pads must have held the peg clear of the rack for so long before it is taken for held, s."""
FLOOR_MARGIN = 0.5e-3
"""The hole's floor lies so far below the depth at which the switch closes, m."""
SETTLING = 0.02
"""A peg in nobody's hand must have had so much time to settle before it is left at rest, s."""
AT_REST = (1e-4, 1e-2)
"""Speeds of a peg that lies still, m/s and rad/s; one that fell would be at 0.2 m/s by then."""
OUT_OF_REACH = 0.01
"""Gap between pads and peg that no hand closes in the 10 ms until it is looked at again, m."""
NOWHERE: Vector = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -math.inf])
"""A hole that nothing is near."""
LOST_TURN = scene.HINGE_RANGE - math.radians(2.0)
"""Hinge angle at which the peg meets the palm and drops out, rad."""
VOID_PENETRATION = 10e-6
VOID_SHARE = 0.2
"""A trial is void when the peg penetrates by more than 10 um, or this share of the radial clearance, for longer than 2 ms."""


class Peg(Enum):
    """Where the peg is."""

    FREE = "free"
    HELD = "held"
    GONE = "gone"


@dataclass(frozen=True, slots=True)
class Truth:
    """What no sensor tells: for records and tests, never for skills."""

    stamp: float
    peg: Peg
    theta: float
    """In-hand angle, rad; NaN when the peg is not held."""
    tip: tuple[float, float, float]
    """Middle of the peg's end face, m, base frame."""
    hole: tuple[float, float, float]
    """Middle of the hole's mouth, m, base frame."""
    depth: float
    """Of the tip below the hole's mouth along its axis, m; negative above."""
    is_in_hole: bool
    """The tip is below the surface and within the hole's radius of its axis."""
    switch_closed: bool
    peak_contact_force: float
    """Largest net force of the plates on the peg, 5 ms low-pass, N."""
    max_penetration: float
    """Deepest that lasted longer than 2 ms, in a bore or at its rim, m."""
    is_void: bool
    max_in_hand_rotation: float
    """Since the grasp, rad."""


class World:
    """One cell's physics."""

    def __init__(
        self, arm: ArmModel, sim: SimConfig, friction: ContactConfig, grip: GripConfig, layout: Layout, job: Job
    ) -> None:
        """Keep the configuration and build the scene of the first run; the skin's layout tells the pads' size."""
        self.arm, self._figures = arm, impedance.figures(arm)
        self._sim, self._contact, self._grip = sim, friction, grip
        self._pad = pad_size(layout)
        self._law_every = round(arm.control_period / sim.timestep)
        self._ticks = 0
        self._wall: float | None = None
        self.words = np.zeros(impedance.WORDS)
        self.law_state = np.zeros(impedance.STATE_WORDS)
        self.drive = engine.new_drive(arm.hand)
        self._held_since = self._loose_since = self._load = 0.0
        self._is_resting, self._peg_body = False, 0
        self._q, self._dq = np.array(arm.home), np.zeros(JOINTS)
        self._data: mujoco.MjData = None
        cylinder.install()
        square.install()
        self.restock(job, sim.seed)

    def restock(self, job: Job, seed: int) -> None:
        """Stand a fresh peg in the rack and draw the trial's world from `seed`; the arm stays where it is."""
        self.job, self.draw = job, draw(job, self._contact, self._grip, seed)
        self._build(self.draw)
        self.meters = engine.new_meters()
        self._enter_free(width=self.finger_width, peg=self._racked())

    def _build(self, drawn: Draw) -> None:
        lean = frames.rotation_about(
            np.array([-math.sin(drawn.tilt_direction), math.cos(drawn.tilt_direction), 0.0]), self.job.hole.tilt
        )
        hole, rack = self.job.hole, self.job.rack
        is_square = self.job.peg.shape == "square"
        if is_square:
            lean = lean @ frames.rotation_about(frames.UP, drawn.yaw)
        radius = hole.diameter / 2 if hole.present else contact.SOLID
        self.plate = Plate(drawn.hole, lean, radius, hole.depth + FLOOR_MARGIN)
        slot = np.array(rack.first) + np.array([0.0, rack.pitch * (self.job.slot % rack.slots), 0.0])
        # The hand comes with its closing axis along y, so the slot leans about y.
        self.rack = Plate(
            slot,
            frames.rotation_about(np.array([0.0, 1.0, 0.0]), -drawn.grasp_angle),
            self.job.peg.diameter / 2 + scene.RACK_CLEARANCE,
            rack.depth,
        )
        dt = self._sim.timestep
        self._models = {
            Peg.HELD: scene.held_model(self.arm, self.job, self.plate, drawn.friction, dt, self._sim.model),
            Peg.FREE: scene.free_model(
                self.arm,
                self.job,
                self.plate,
                self.rack,
                drawn.friction,
                drawn.pad_friction,
                self._pad,
                dt,
                self._sim.model,
            ),
        }
        # The held model once more with a longer step; both step the same data.
        self._coarse = None
        self._resting = None
        if self._sim.model.long_steps and self._law_every % engine.COARSE == 0:
            self._coarse = scene.held_model(
                self.arm, self.job, self.plate, drawn.friction, engine.COARSE * dt, self._sim.model
            )
            self._resting = scene.without_peg(self._models[Peg.FREE], engine.COARSE)
        reach = self.plate.radius * (math.sqrt(2.0) if is_square else 1.0)
        self._hole = np.array([*self.plate.position, *self.plate.rotation[:, 2], reach])
        self._datas = {which: mujoco.MjData(model) for which, model in self._models.items()}
        self._pads = tuple(int(self._models[Peg.FREE].geom(name).id) for name in ("left", "right"))
        body = self._models[Peg.HELD].body("peg")
        self._pivot_dof = int(self._models[Peg.HELD].joint("pivot").dofadr[0])
        self._weight = body.mass[0] * GRAVITY
        self._half = (self.job.peg.length + self.job.peg.overhang) / 2
        self._reach = self.job.peg.diameter / 2 * (math.sqrt(2.0) if is_square else 1.0)

    # The clock.

    def now(self) -> float:
        """Return the simulated time, s."""
        return self._ticks * self._sim.timestep

    def wait_until(self, stamp: float) -> None:
        """Advance the physics to `stamp`; at a set pace also wait for the wall clock.

        Raises:
            SimulationUnstableError: The state is no longer finite.
        """
        steps = round((stamp - self.now()) / self._sim.timestep)
        while steps > 0:
            steps -= self._advance(min(steps, self._law_every * 10))
        if self._sim.pace != "max":
            self._keep_pace(self._sim.pace)

    def _keep_pace(self, pace: float) -> None:
        now = time.monotonic()
        if self._wall is None:
            self._wall = now - self.now() / pace
        behind = self._wall + self.now() / pace - now
        if behind > 0.0:
            time.sleep(behind)
        else:
            # Too slow for the pace: do not run after the lost time.
            self._wall = now - self.now() / pace

    # The physics.

    def _advance(self, steps: int) -> int:
        data = self._data
        if self.peg is not Peg.HELD:
            self._let_rest()
        else:
            slips_at = self.breakaway()
            for model in self._steppers:
                model.dof_frictionloss[self._pivot_dof] = slips_at
        addresses = [model._address for model in self._steppers]
        taken: int = engine.advance(
            (addresses[0], addresses[-1] if len(addresses) > 1 else 0),
            data._address,
            data.qpos,
            data.qvel,
            data.qfrc_applied,
            self._pivot,
            self._peg_views,
            self._near,
            data.userdata,
            self._figures,
            self.words,
            self.law_state,
            self.meters,
            self.drive,
            7 if self.peg is Peg.HELD else -1,
            LOST_TURN,
            self._peg_geom if self.peg is Peg.HELD else 2,
            self.now(),
            self._sim.timestep,
            steps,
            self._law_every,
            self._ticks % self._law_every,
        )
        if not taken:
            # Time goes on all the same: whoever reports the fault waits for the end of the scan.
            self._ticks += steps
            raise SimulationUnstableError(
                f"simulation at {self.now():.3f} s: state not finite (time step {self._sim.timestep} s); reduce gains or sim.timestep"
            )
        self._ticks += taken
        self._pass_on()
        return taken

    def _let_rest(self) -> None:
        """Leave a peg that lies still, out of the pads' reach, out of the physics; take it in again before they reach it."""
        if self._resting is None:
            return
        data, model = self._data, self._model
        is_clear = (
            engine.pad_gap(self._pads, model.geom_size, data.geom_xpos, data.geom_xmat, self._peg_views) > OUT_OF_REACH
        )
        if self._is_resting and not is_clear:
            self._is_resting, self._loose_since = False, self.now()
            self._steppers, self._near = [model], self._hole
            data.xfrc_applied[self._peg_body, 2] = self._load
        elif is_clear and not self._is_resting and self.now() - self._loose_since >= SETTLING:
            speeds = np.abs(data.qvel[9:15])
            if speeds[:3].max() < AT_REST[0] and speeds[3:].max() < AT_REST[1]:
                self._is_resting, self._load = True, float(data.xfrc_applied[self._peg_body, 2])
                self._steppers, self._near = [model, self._resting], NOWHERE
                data.xfrc_applied[self._peg_body, 2] = data.qvel[9:15] = 0.0

    def _pass_on(self) -> None:
        """Change the peg's situation when what happened asks for it."""
        if self.peg is Peg.HELD:
            if abs(self._data.qpos[7]) > LOST_TURN:
                self._drop()
            elif self.finger_force <= 0.0:
                self._enter_free(width=self.job.peg.diameter, peg=self.peg_pose())
        elif self.peg is Peg.FREE:
            is_squeezed = self.pad_force() > 0.5 * self.finger_force > 0.0
            if is_squeezed and self._lowest() > self.rack.position[2] + 1e-3:
                if self._sim.model.grip == "hinge" and self.now() - self._held_since > SETTLED_GRIP:
                    self._enter_held()
            else:
                self._held_since = self.now()

    def _use(self, which: Peg) -> None:
        self.peg = which
        key = Peg.HELD if which is Peg.HELD else Peg.FREE
        self._model, self._data = self._models[key], self._datas[key]
        self._steppers = [self._model, *([self._coarse] if key is Peg.HELD and self._coarse is not None else [])]
        self._near, self._is_resting, self._loose_since = self._hole, False, self.now()
        self._peg_body = int(self._model.body("peg").id)
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:7], self._data.qvel[:7] = self._q, self._dq

    def hold(self, theta: float) -> None:
        """Put the peg into the hand at this in-hand angle, rad, as after a grasp; with pads they must still close."""
        reach = frames.compose(self.tcp(), frames.peg_in_finger(theta, self.job.peg.length))
        middle = Pose(reach.position + self._half * reach.rotation[:, 2], reach.rotation)
        self._enter_free(width=self.job.peg.diameter, peg=middle)
        if self._sim.model.grip == "hinge":
            self._enter_held()

    def _leave(self) -> None:
        self._q, self._dq = self._data.qpos[:7].copy(), self._data.qvel[:7].copy()

    def _enter_free(self, width: float, peg: Pose) -> None:
        if self._data is not None:
            self._leave()
        self._use(Peg.FREE)
        data = self._data
        data.qpos[7] = data.qpos[8] = width / 2
        data.qpos[9:12] = peg.position
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, peg.rotation.flatten())
        data.qpos[12:16] = quat
        data.xfrc_applied[self._model.body("peg").id, 2] = -self._weight
        self._finish()

    def _enter_held(self) -> None:
        T_base_tcp = self.tcp()
        peg = self.peg_pose()
        axis = T_base_tcp.rotation.T @ peg.rotation[:, 2]
        theta = math.atan2(-axis[1], -axis[0])
        # The nearest point of the peg's axis to the finger centre is where the pads hold it.
        reach = float((T_base_tcp.position - peg.position) @ peg.rotation[:, 2]) + self._half
        self._leave()
        self._use(Peg.HELD)
        self.peg_length = reach - self._grip.slip
        for model in self._steppers:
            model.geom("peg").pos[2] = model.body("peg").ipos[2] = self._half - self.peg_length
        self._data.qpos[7] = theta
        self._data.xfrc_applied[self._model.body("peg").id, 2] = -self._weight
        self.meters[engine.TURN_FROM] = theta
        self._finish()

    def _drop(self) -> None:
        """Take the peg out of play: it fell out of the hand."""
        self._enter_free(width=self.job.peg.diameter, peg=Pose(np.array([0.0, 0.0, -1.0]), np.eye(3)))
        self._data.xfrc_applied[self._model.body("peg").id, 2] = 0.0
        self.peg = Peg.GONE

    def _finish(self) -> None:
        mujoco.mj_forward(self._model, self._data)
        held = self.peg is Peg.HELD
        body = self._model.body("peg" if held else "left").id
        self._pivot = self._data.xpos[body]
        self._peg_geom = int(self._model.geom("peg").id)
        self._peg_views = (
            np.array([self._reach, self._half]),
            self._data.geom_xpos[self._peg_geom],
            self._data.geom_xmat[self._peg_geom].reshape(3, 3),
        )
        self._held_since = self.now()

    # What devices and records ask.

    def physics(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Return the model that the next step takes, and the data, for measurements."""
        coarse = self._steppers[-1]
        return (coarse if engine.is_far(self._near, *self._peg_views) else self._model), self._data

    @property
    def is_held(self) -> bool:
        """Whether the peg hangs in the hand."""
        return self.peg is Peg.HELD

    @property
    def q(self) -> Vector:
        """Joint positions, shape (7,), rad."""
        return np.array(self._data.qpos[:7])

    @property
    def dq(self) -> Vector:
        """Joint velocities, shape (7,), rad/s."""
        return np.array(self._data.qvel[:7])

    def tcp(self) -> Pose:
        """Return T_base_tcp from the arm's own kinematics."""
        position, rotation, _, _ = impedance.forward(self._figures, self._data.qpos[:7])
        return Pose(position, rotation)

    def finger_gap(self) -> float:
        """Return the distance between the pads, m."""
        if self.peg is Peg.HELD:
            return self.job.peg.diameter
        return float(self._data.qpos[7] + self._data.qpos[8])

    @property
    def finger_force(self) -> float:
        """Closing force commanded, N; 0 opens to `finger_width`."""
        return float(self.drive[engine.DRIVE_FORCE])

    @property
    def finger_width(self) -> float:
        """Distance between the pads commanded when the hand opens, m."""
        return float(self.drive[engine.DRIVE_WIDTH])

    def pad_force(self) -> float:
        """Return the smaller of the forces between the pads and the peg, N."""
        if self.peg is Peg.HELD:
            return self.finger_force
        if self.peg is Peg.GONE:
            return 0.0
        squeezed: float = engine.pad_force(self._data._address, *self._pads)
        return squeezed

    def breakaway(self) -> float:
        """Return the torque at which the pivot slips, N·m; the held peg's axis goes through the finger centre."""
        length, width = self._pad
        return breakaway_torque_of(
            theta=self._data.qpos[7],
            offset=0.0,
            grip_force=self.finger_force,
            reach_tip=self.peg_length,
            reach_back=2 * self._half - self.peg_length,
            half_length=length / 2,
            half_width=width / 2,
            friction=self.draw.pad_friction,
            flat=self.job.peg.diameter if self.job.peg.shape == "square" else 0.0,
        )

    def pad_load(self) -> PadLoad | None:
        """Return what the pads hold now; None when nothing is between them."""
        if self.peg is Peg.HELD or (self.peg is Peg.FREE and self.pad_force() > 0.0):
            return self._pad_load()
        return None

    def _pad_load(self) -> PadLoad:
        """Return the load of the pads: grip, and the reaction of what pushes the held peg; its inertia is too small to count."""
        tcp, pose = self.tcp(), self.peg_pose()
        axis = tcp.rotation.T @ pose.rotation[:, 2]
        theta = math.atan2(-axis[1], -axis[0])
        way = pose.position - tcp.position
        lateral = tcp.rotation @ np.array([-math.sin(theta), math.cos(theta), 0.0])
        closing = tcp.rotation[:, 2]
        reach = self._half - float(way @ pose.rotation[:, 2])
        return PadLoad(
            theta=theta,
            offset=float(way @ lateral),
            grip_force=self.pad_force(),
            across=float(self.contact_force() @ closing),
            # A force f along z at the lever s along the peg gives s·f about (z × peg), with the sign turned.
            tilting=-float(self.contact_torque() @ lateral),
            reach_tip=reach,
            reach_back=2 * self._half - reach,
            diameter=self.job.peg.diameter,
            is_flat=self.job.peg.shape == "square",
        )

    def _feels_plates(self) -> bool:
        return self.peg is Peg.HELD or (self.peg is Peg.FREE and self._sim.model.grip == "pads")

    def contact_force(self) -> Vector:
        """Return the net force of the plates on the held peg, 5 ms low-pass, shape (3,), N, base frame."""
        if not self._feels_plates():
            return np.zeros(3)
        return self.meters[engine.FORCE : engine.FORCE + 3].copy()

    def contact_torque(self) -> Vector:
        """Return its torque about the finger centre, shape (3,), N·m, base frame."""
        if not self._feels_plates():
            return np.zeros(3)
        return self.meters[engine.TORQUE : engine.TORQUE + 3].copy()

    def is_switch_pressed(self) -> bool:
        """Whether the peg's end presses the switch."""
        depth, in_hole = self._depth()
        return in_hole and depth >= self.job.hole.depth

    def truth(self) -> Truth:
        """Return what no sensor tells."""
        depth, in_hole = self._depth()
        tip = self._end()
        clearance = (self.job.hole.diameter - self.job.peg.diameter) / 2
        lasting = float(self.meters[engine.SUSTAINED])
        return Truth(
            stamp=self.now(),
            peg=self.peg,
            theta=float(self._data.qpos[7]) if self.peg is Peg.HELD else math.nan,
            tip=(float(tip[0]), float(tip[1]), float(tip[2])),
            hole=(float(self.plate.position[0]), float(self.plate.position[1]), float(self.plate.position[2])),
            depth=depth,
            is_in_hole=in_hole,
            switch_closed=self.is_switch_pressed(),
            peak_contact_force=float(self.meters[engine.PEAK_FORCE]),
            max_penetration=lasting,
            is_void=lasting > min(VOID_PENETRATION, VOID_SHARE * clearance),
            max_in_hand_rotation=float(self.meters[engine.TURN_MAX]),
        )

    def _racked(self) -> Pose:
        up = self.rack.rotation[:, 2]
        return Pose(self.rack.position + up * (self._half - self.job.rack.depth), self.rack.rotation)

    def peg_pose(self) -> Pose:
        """Return the pose of the peg's middle, z from its end upward."""
        return Pose(
            self._data.geom_xpos[self._peg_geom].copy(), self._data.geom_xmat[self._peg_geom].reshape(3, 3).copy()
        )

    def _end(self) -> Vector:
        pose = self.peg_pose()
        end: Vector = pose.position - self._half * pose.rotation[:, 2]
        return end

    def _lowest(self) -> float:
        axis = self.peg_pose().rotation[:, 2]
        return float(self._end()[2] - self._reach * math.hypot(axis[0], axis[1]))

    def _depth(self) -> tuple[float, bool]:
        _, middle, axes = self._peg_views
        depth, beside = engine.below_mouth(self._half, middle, axes, self.plate.position, self.plate.rotation)
        return depth, depth > 0.0 and beside < self.plate.radius
