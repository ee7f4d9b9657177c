"""Physics of one cell as its devices use it: the clock, the commands, the readings, and the true state."""

import mujoco
import numpy as np

from drivers import impedance
from drivers.arm.model import JOINTS, ArmModel
from drivers.parts import Job
from drivers.quantities import Vector
from drivers.skin.layout import Layout, pad_size
from sim.config import ContactConfig, GripConfig, SimConfig
from sim.contact import shapes
from sim.contact.plate import Plate
from sim.hand import slip
from sim.hand.pads import PadLoad, load_of
from sim.world import metering, native
from sim.world.disturb import Draw, draw, in_fixture
from sim.world.pace import ClockPace
from sim.world.reality import NO_ERRORS, Errors
from sim.world.situation import PegSituation
from sim.world.stepper import Stepper
from sim.world.trial_scene import TrialScene
from sim.world.truth import Truth, is_void


class World(Stepper):
    """Physics and clock of one cell."""

    def __init__(
        self,
        arm: ArmModel,
        sim: SimConfig,
        friction: ContactConfig,
        grip: GripConfig,
        layout: Layout,
        job: Job,
        errors: Errors = NO_ERRORS,
    ) -> None:
        """Store the configuration and build the scene of the first run; the skin's layout defines the pads' size.

        Raises:
            ConfigError: `reality.alone` names no error.
        """
        self._errors, self.drawn = errors, errors.draw(sim.seed)
        """Errors of the cell and their draw, constant over the life of the cell: arm, positions, skin and computer."""
        self.arm, self._sim, self._contact, self._grip = arm, sim, friction, grip
        super().__init__(arm, sim, pad_size(layout), ClockPace(sim.timestep, sim.pace))
        self.now = self.pace.now
        """Returns the simulated time, s."""
        native.log_warnings()
        self.restock(job, sim.seed)

    def restock(self, job: Job, seed: int) -> None:
        """Place a fresh peg in the rack and draw the trial's properties from `seed`; the arm keeps its pose."""
        part = self._errors.draw(seed)
        drawn = draw(self.arm, job, self._contact, self._grip, seed, self.drawn, part)
        if self._sim.fixture is not None:
            drawn = in_fixture(drawn, self._sim.fixture, job, self._sim.seed, seed)
        self.begin(job, drawn)

    def begin(self, job: Job, drawn: Draw) -> None:
        """Begin a trial with given properties and a fresh peg in the rack; the arm keeps its pose."""
        self.job, self.draw = job, drawn
        shapes.install(job.peg.part)
        scene = TrialScene(self._sim, job, drawn, self.pad, self.has_twins)
        self.begin_trial(scene, drawn.pad_friction, drawn.senses)

    def wait_until(self, stamp: float) -> None:
        """Advance the physics to `stamp`, s; at a set pace also wait for the wall clock.

        Raises:
            SimulationUnstableError: The state is no longer finite.
        """
        # At most ten control periods pass between two checks of the peg's situation.
        pace, most = self.pace, self.beat.law_every * 10
        ticks = round(stamp / pace.timestep) - pace.ticks
        while ticks > 0:
            ticks -= self.advance(most if ticks > most else ticks)
        pace.keep()

    @property
    def is_held(self) -> bool:
        """True if the peg hangs in the hand."""
        return self.peg is PegSituation.HELD

    @property
    def plate(self) -> Plate:
        """The true plate."""
        return self.scene.plate

    def inertia(self, point: Vector) -> Vector:
        """Return the true inertia of the arm at a point of the hand, m, (J M⁻¹ Jᵀ)⁻¹, shape (6, 6), translation first, base frame."""
        model, data = self.physics()
        M = np.empty((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        _, _, axes, origins = impedance.forward(impedance.figures(self.draw.arm.model), self.q)
        J = np.vstack([np.cross(axes, point - origins).T, axes.T])
        inertia: Vector = np.linalg.inv(J @ np.linalg.inv(M[:JOINTS, :JOINTS]) @ J.T)
        return inertia

    def pad_load(self) -> PadLoad | None:
        """Return the present load of the pads; None if nothing is between them."""
        if self.peg is PegSituation.GONE or (self.peg is PegSituation.FREE and self.pad_force() <= 0.0):
            return None
        return load_of(
            self.job.peg, self.tcp(), self.peg_pose(), self.pad_force(), self.contact_force(), self.contact_torque()
        )

    def contact_force(self) -> Vector:
        """Return the net force of the plates on the held peg, 5 ms low-pass, shape (3,), N, base frame."""
        return self._felt(metering.FORCE)

    def contact_torque(self) -> Vector:
        """Return the torque of the contact force about the finger centre, shape (3,), N·m, base frame."""
        return self._felt(metering.TORQUE)

    def _felt(self, first: int) -> Vector:
        return self.meters[first : first + 3].copy() if self.is_held else np.zeros(3)

    def is_switch_pressed(self) -> bool:
        """True if the hole has a switch and the peg's end presses it."""
        depth, in_hole = self.depth()
        return in_hole and depth >= self.job.hole.depth and self.job.hole.evidence == "switch"

    def truth(self) -> Truth:
        """Return the true state of the cell."""
        depth, in_hole = self.depth()
        theta, tip = self.pivot()
        lasting = float(self.meters[metering.SUSTAINED])
        return Truth(
            peg=self.peg,
            theta=theta,
            tip=_three(tip),
            hole=_three(self.plate.position),
            depth=depth,
            is_in_hole=in_hole,
            switch_closed=self.is_switch_pressed(),
            peak_contact_force=float(self.meters[metering.PEAK_FORCE]),
            max_penetration=lasting,
            is_void=is_void(lasting, self.job.peg.part.clearance(self.job.hole.part)),
            max_in_hand_rotation=float(self.meters[metering.TURN_MAX]),
            grip_slip=float(self.control.grip[slip.SLIP]),
            time_over_20N=float(self.meters[metering.OVER_TIME]),
            jerk_free=float(self.meters[metering.JERK_FREE]),
            jerk_contact=float(self.meters[metering.JERK_CONTACT]),
            plate_penetration=float(self.meters[metering.SURFACE_SUSTAINED]),
            joint_speed=float(np.max(np.abs(self.dq))),
        )


def _three(vector: Vector) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
