"""Stepping of a trial's scene: selection of the running model, transfer of its state, and one call per time span."""

import math

import mujoco
import numpy as np

from drivers import frames, impedance, setpoint_words
from drivers.arm.model import JOINTS, ArmModel
from drivers.errors import SimulationUnstableError
from drivers.quantities import Pose, Vector
from sim.arm import arm_senses, joint_drive
from sim.arm.arm_truth import ArmTruth
from sim.config import SimConfig
from sim.contact import latch, peg_distances
from sim.hand import slip
from sim.world import engine, metering, situation
from sim.world.pace import ClockPace
from sim.world.situation import PegSituation
from sim.world.trial_scene import Mechanism, TrialScene

NOWHERE: Vector = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -math.inf])
"""Mouth of a hole that is far from everything."""
FINGERS, PEG = slice(7, 9), slice(9, 15)
"""Degrees of freedom of the free model after the arm's seven."""
HINGE, ALONG, BESIDE = 7, 8, 9
"""Degrees of freedom of the held model after the arm's seven: the peg's rotation about the closing axis, and its
positions along and beside its own axis."""
TABLE = 0.0
"""Height of the table under arm, rack and plate, m, base frame; a peg dropped beside them lies there."""
NO_NOISE: Vector = np.zeros((1, arm_senses.NOISES))
"""Random numbers for an arm with exact readings."""


class Stepper:
    """Steps the physics of arm, hand and peg through successive trials; the arm keeps its pose between trials."""

    running: Mechanism
    """Mechanism that is stepped; set by the first trial."""

    def __init__(self, arm: ArmModel, sim: SimConfig, pad: tuple[float, float], pace: ClockPace) -> None:
        """Place the arm at its waiting pose; `pad` is length and width of a pad, m."""
        self._arm, self._long_steps, self.pad, self.pace = arm, sim.model.long_steps, pad, pace
        self.beat = engine.Beat(pace.timestep, round(arm.control_period / sim.timestep))
        """Length of a tick, and number of ticks in a control period."""
        hand = arm.hand
        self.control = engine.Drives(
            impedance.figures(arm),
            np.zeros(setpoint_words.WORDS),
            impedance.new_state(arm),
            np.array([0.0, hand.stroke, hand.finger_speed, hand.finger_force]),  # commanded to open fully
            np.zeros(joint_drive.WORDS),
            np.zeros(arm_senses.WORDS),
            np.zeros(slip.WORDS),
            np.zeros(latch.WORDS),
        )
        self.meters = metering.new_meters()
        self.peg, self.peg_length = PegSituation.FREE, math.nan
        self._is_begun = False
        self._q, self._dq = np.array(arm.home), np.zeros(JOINTS)
        self._in_grip_since = self._loose_since = 0.0
        self._load: Vector = np.zeros(6)
        self._is_resting = False

    @property
    def has_twins(self) -> bool:
        """True if longer steps are possible."""
        return self._long_steps and self.beat.law_every % engine.COARSE == 0

    def begin_trial(self, scene: TrialScene, pad_friction: float, noise: np.random.Generator) -> None:
        """Begin a trial with a fresh peg in the rack.

        Args:
            scene: Scene of the trial.
            pad_friction: Coulomb coefficient of the peg's pads.
            noise: Random generator of the noise in the arm's readings.
        """
        self.scene, self._pad_friction, self._noise = scene, pad_friction, noise
        self.meters = metering.new_meters()
        self._change_arm(scene.arm)
        self.control.latch[:] = scene.latch
        self.enter_free(float(self.control.drive[engine.DRIVE_WIDTH]), scene.racked())

    def _change_arm(self, truth: ArmTruth) -> None:
        """Replace the arm by another one at the same pose, under the last torques commanded by the law."""
        timestep, period, control = self.pace.timestep, self._arm.control_period, self.control
        control.joints[:] = joint_drive.words_of(truth, (timestep, engine.COARSE * timestep))
        joint_drive.fill(control.joints, control.law[impedance.TORQUE : impedance.TORQUE + JOINTS])
        control.senses[:] = arm_senses.words_of(truth, period)
        arm_senses.fill(control.senses, self.q if self._is_begun else self._q, self.dq if self._is_begun else self._dq)
        self._real = impedance.figures(truth.model)

    # Changes of situation; they carry positions and velocities along.

    def enter_free(self, width: float, peg: Pose) -> None:
        """Make the peg a separate body with its centre at a pose, between fingers `width` m apart."""
        self._run(PegSituation.FREE, self.scene.free)
        data = self.running.data
        data.qpos[7] = data.qpos[8] = width / 2
        data.qpos[9:12] = peg.position
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, peg.rotation.flatten())
        data.qpos[12:16] = quat
        self._begin(weight=self.scene.size.weight)

    def enter_held(self) -> None:
        """Attach the peg to the hand at its present pose between the pads."""
        tcp, pose = self.tcp(), self.peg_pose()
        axis = tcp.rotation.T @ pose.rotation[:, 2]
        # The pads hold the peg at the point of its axis nearest to the finger centre.
        self.peg_length = float((tcp.position - pose.position) @ pose.rotation[:, 2]) + self.scene.size.half
        self._run(PegSituation.HELD, self.scene.held)
        for model in self._steppers:
            model.geom("peg").pos[2] = model.body("peg").ipos[2] = self.scene.size.half - self.peg_length
        theta = math.atan2(-axis[1], -axis[0])
        lateral = tcp.rotation @ np.array([-math.sin(theta), math.cos(theta), 0.0])
        beside = float((pose.position - tcp.position) @ lateral)
        self.running.data.qpos[HINGE] = self.meters[metering.TURN_FROM] = theta
        self.running.data.qpos[BESIDE] = beside
        (length, width), half, mass = self.pad, self.scene.size.half, self.scene.job.peg.mass
        pads = length / 2, width / 2, self._pad_friction, self.scene.shear_stiffness
        inertia = mass * (half**2 / 3 + (self.peg_length - half) ** 2)
        peg = self.peg_length, 2 * half, self.scene.size.flat, mass, inertia
        slip.grasp(self.control.grip, (theta, 0.0, beside), pads, peg)
        self._begin(weight=self.scene.size.weight)

    def hold(self, theta: float) -> None:
        """Put the peg into the hand at this in-hand angle, rad, as after a grasp."""
        reach = frames.compose(self.tcp(), frames.peg_in_finger(theta, self.scene.job.peg.length))
        middle = Pose(reach.position + self.scene.size.half * reach.rotation[:, 2], reach.rotation)
        self.enter_free(self.scene.size.thickness, middle)
        self.enter_held()

    def fall(self) -> None:
        """Place a lost peg flat on the surface below it, or leave it standing in its hole.

        The fall itself is not simulated, only its end. A lying peg has no weight, because only the peg's end and the rim
        of that end have contacts with the plate: the back end would sink in.
        """
        width, plate = self.finger_gap(), self.scene.plate
        depth, is_in_hole = self.depth()
        if is_in_hole:
            up = plate.rotation[:, 2]
            standing = Pose(plate.position + up * (self.scene.size.half - depth), plate.rotation)
            self.enter_free(width, standing)
            return
        place, ground = self._ground()
        pose, up = self.peg_pose(), ground[:, 2]
        axis = pose.rotation[:, 2] - float(pose.rotation[:, 2] @ up) * up
        # Square of the horizontal component below which an axis is upright.
        axis = ground[:, 0] if float(axis @ axis) < 1e-6 else axis / math.sqrt(float(axis @ axis))
        height = float((pose.position - place) @ up)
        # Gap under a peg that has just been placed on the plate, m.
        below = pose.position - (height - self.scene.size.reach - 1e-4) * up
        self.enter_free(width, Pose(below, np.column_stack([up, np.cross(axis, up), axis])))
        self.running.data.xfrc_applied[self.running.peg_body, 2] = 0.0

    def _ground(self) -> tuple[Vector, Vector]:
        """Return a point of the surface below the peg, shape (3,), m, and its axes, z upward, shape (3, 3), base frame."""
        above = self.peg_view.middle + self.scene.size.half * frames.UP
        for below in (self.scene.rack, self.scene.plate):
            if below.is_below(above):
                return below.position, below.rotation
        return np.array([0.0, 0.0, TABLE]), np.eye(3)

    def _has_fallen(self, lowest: float) -> bool:
        """Return True if a free peg has toppled over, has left the plate, or spins faster than the integration can follow.

        `lowest` is the height of the peg's lowest point, m, base frame.
        """
        place, ground = self._ground()
        size, axis = self.scene.size, self.peg_view.axes[:, 2]
        away, along = np.array([self.peg_view.middle + size.half * axis - place, axis]) @ ground[:, 2]
        back = float(away) - size.reach * math.sqrt(max(1.0 - float(along) ** 2, 0.0))
        return situation.has_fallen(min(back, lowest - TABLE), self.running.data.qvel[PEG])

    def lose(self) -> None:
        """Take the peg out of play."""
        self.enter_free(self.scene.size.thickness, Pose(np.array([0.0, 0.0, -1.0]), np.eye(3)))
        self.running.data.xfrc_applied[self.running.peg_body, 2] = 0.0
        self.peg = PegSituation.GONE

    def _run(self, peg: PegSituation, mechanism: Mechanism) -> None:
        """Continue with a mechanism from the arm's present state."""
        if self._is_begun:
            self._q, self._dq = self.q, self.dq
        self.peg, self.running, self._is_begun = peg, mechanism, True
        is_held = peg is PegSituation.HELD
        self._steppers = [mechanism.model]
        if is_held and mechanism.twin is not None:
            self._steppers.append(mechanism.twin)
        self._is_resting = False
        mujoco.mj_resetData(mechanism.model, mechanism.data)
        mechanism.data.qpos[:7], mechanism.data.qvel[:7] = self._q, self._dq

    def _begin(self, weight: float) -> None:
        """Complete the state after its positions have been set; the peg's weight is in N."""
        mechanism, now = self.running, self.pace.stamp
        data, is_held = mechanism.data, self.peg is PegSituation.HELD
        data.xfrc_applied[mechanism.peg_body, 2] = -weight
        latch.loosen(self.control.latch)
        mujoco.mj_forward(mechanism.model, data)
        size = self.scene.size
        self.peg_view = peg_distances.PegView(
            np.array([size.reach, size.half]),
            data.geom_xpos[mechanism.peg_geom],
            data.geom_xmat[mechanism.peg_geom].reshape(3, 3),
        )
        self._state = engine.state_of(data)
        self._watch = engine.Watched(
            self.peg_view,
            data.xpos[mechanism.sides[0]],
            mechanism.plates,
            HINGE if is_held else -1,
            situation.LOST_TURN,
            data.xipos[mechanism.peg_body],
            data.xfrc_applied[mechanism.peg_body],
            metering.HandView(
                data.cvel[mechanism.hand],
                data.subtree_com[int(mechanism.model.body_rootid[mechanism.hand])],
                *(data.xpos[side] for side in mechanism.sides),
            ),
        )
        self._set_near(self.scene.hole)
        self._in_grip_since = self._loose_since = now

    def _set_near(self, hole: Vector) -> None:
        addresses = [model._address for model in self._steppers]
        self._models = engine.Models(addresses[0], addresses[1] if len(addresses) > 1 else 0, hole)

    # Stepping of the physics.

    def command(self, torque: Vector) -> None:
        """Command joint torques, shape (7,), N·m, instead of the law's; once a control period."""
        joint_drive.command(self.control.joints, torque, self.running.data.qfrc_applied)

    def advance(self, ticks: int) -> int:
        """Advance the physics by `ticks`, or by fewer if the peg's situation changes; return the number taken.

        Raises:
            SimulationUnstableError: The state is no longer finite.
        """
        if self.peg is not PegSituation.HELD:
            self._let_rest()
        pace, noises = self.pace, NO_NOISE
        if self.control.senses[arm_senses.IS_IDEAL] == 0.0:
            noises = self._noise.standard_normal((ticks // self.beat.law_every + 1, arm_senses.NOISES))
        taken: int = engine.advance(
            self._models, self._state, self._watch, self.control, self.meters, self.beat, pace.ticks, ticks, noises
        )
        if not taken:
            # Time still advances, because the code that reports the fault waits for the end of the scan.
            pace.tick(ticks)
            raise SimulationUnstableError(
                f"simulation at {pace.stamp:.3f} s: state not finite (time step {pace.timestep} s); reduce gains or sim.timestep"
            )
        pace.tick(taken)
        self._pass_on()
        return taken

    def _let_rest(self) -> None:
        """Leave the peg out of the physics if it is at rest and out of the pads' reach; put it back before the pads reach it."""
        mechanism = self.running
        if mechanism.twin is None:
            return
        data, now = mechanism.data, self.pace.stamp
        gap = peg_distances.pad_gap(
            self.scene.pads, mechanism.model.geom_size, data.geom_xpos, data.geom_xmat, self.peg_view
        )
        rests = situation.may_rest(self._is_resting, gap, now - self._loose_since, data.qvel[PEG])
        if rests == self._is_resting:
            return
        self._is_resting = rests
        force = data.xfrc_applied[mechanism.peg_body]
        if rests:
            self._load = force.copy()
            self._steppers = [mechanism.model, mechanism.twin]
            self._set_near(NOWHERE)
            force[:] = data.qvel[PEG] = 0.0
        else:
            self._loose_since = now
            self._steppers = [mechanism.model]
            self._set_near(self.scene.hole)
            force[:] = self._load

    def _pass_on(self) -> None:
        """Change the peg's situation if the last ticks require it."""
        grip_force = float(self.control.drive[engine.DRIVE_FORCE])
        if self.peg is PegSituation.HELD:
            turn = float(self.running.data.qpos[HINGE])
            if abs(turn) > situation.LOST_TURN or self.control.grip[slip.CONTACT] < situation.LEAST_CONTACT:
                self.fall()
            elif grip_force <= 0.0:
                self.enter_free(self.scene.size.thickness, self.peg_pose())
        elif self._is_resting:
            self._in_grip_since = self.pace.stamp
        elif self.peg is PegSituation.FREE:
            lowest = self.lowest()
            if self._has_fallen(lowest):
                self.fall()
            elif not situation.is_in_grip(self.pad_force(), grip_force, lowest - self.scene.rack.position[2]):
                self._in_grip_since = self.pace.stamp
            elif self.pace.stamp - self._in_grip_since > situation.SETTLED_GRIP:
                self.enter_held()

    # Present positions.

    @property
    def q(self) -> Vector:
        """Joint positions, shape (7,), rad."""
        return np.array(self.running.data.qpos[:7])

    @property
    def dq(self) -> Vector:
        """Joint velocities, shape (7,), rad/s."""
        return np.array(self.running.data.qvel[:7])

    def scanned(self) -> arm_senses.Reading:
        """Return the arm's readings for a scan."""
        control = self.control
        if control.senses[arm_senses.IS_IDEAL] > 0.0:
            is_held = self.peg is PegSituation.HELD
            felt = self.meters[metering.FORCE : metering.TORQUE + 3].copy() if is_held else np.zeros(6)
            position, rotation, _, _ = impedance.forward(control.arm, self.q)
            torques = impedance.commanded(control.law), impedance.unexplained(control.law)
            return self.q, self.dq, felt, position, rotation, *torques
        felt = control.joints[joint_drive.LEFT_OVER : joint_drive.LEFT_OVER + JOINTS]
        return arm_senses.scanned(control.senses, control.arm, felt, control.law)

    def physics(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Return the model of the next step, and the data."""
        is_far = peg_distances.is_far(self._models.hole, *self.peg_view)
        return (self._steppers[-1] if is_far else self._steppers[0]), self.running.data

    def tcp(self) -> Pose:
        """Return the true T_base_tcp."""
        position, rotation, _, _ = impedance.forward(self._real, self.running.data.qpos[:7])
        return self.scene.arm.displaced(Pose(position, rotation))

    def peg_pose(self) -> Pose:
        """Return the pose of the peg's centre, z from its end upward."""
        return Pose(self.peg_view.middle.copy(), self.peg_view.axes.copy())

    def end(self) -> Vector:
        """Return the centre of the peg's end face, m, base frame."""
        end: Vector = self.peg_view.middle - self.scene.size.half * self.peg_view.axes[:, 2]
        return end

    def lowest(self) -> float:
        """Return the height of the peg's lowest point, m, base frame."""
        size, (x, y, z) = self.scene.size, self.peg_view.axes[:, 2].tolist()
        lean, end = math.hypot(x, y), float(self.peg_view.middle[2]) - size.half * z
        # The lower of the two rims of a chamfered end.
        return float(end - max((size.reach - size.chamfer) * lean, size.reach * lean - size.chamfer * z))

    def depth(self) -> tuple[float, bool]:
        """Return the depth of the tip below the hole's mouth along its axis, m, and True if the tip is in the hole."""
        plate = self.scene.plate
        depth, beside = peg_distances.below_mouth(
            self.scene.size.half, self.peg_view.middle, self.peg_view.axes, plate.position, plate.rotation
        )
        return depth, depth > 0.0 and beside < min(plate.half)

    def pivot(self) -> tuple[float, Vector]:
        """Return the true in-hand angle, rad, NaN if no hand holds the peg, and the centre of the peg's end face, m."""
        theta = float(self.running.data.qpos[HINGE]) if self.peg is PegSituation.HELD else math.nan
        return theta, self.end()

    def finger_gap(self) -> float:
        """Return the distance between the pads, m."""
        if self.peg is PegSituation.HELD:
            return self.scene.size.thickness
        left, right = self.running.data.qpos[FINGERS].tolist()
        return float(left + right)

    def pad_force(self) -> float:
        """Return the smaller of the forces between the pads and the peg, N."""
        if self.peg is PegSituation.HELD:
            return float(self.control.drive[engine.DRIVE_FORCE])
        if self.peg is PegSituation.GONE:
            return 0.0
        squeezed: float = metering.pad_force(self.running.data._address, *self.scene.pads)
        return squeezed
