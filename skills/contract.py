"""Contract of a skill: typed parameters and a context in, a typed result out."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum, IntEnum, StrEnum
from typing import NoReturn

import numpy as np

from drivers.config_model import ConfigModel
from drivers.errors import ArmSilentError, NotFiniteError, NotPassiveError, SkinUntrustedError
from drivers.frames import end_point
from drivers.parts import Job
from drivers.protocols import Arm, Clock, Gripper, Skin, SuccessSwitch
from drivers.quantities import (
    ArmState,
    GripperState,
    ImpedanceSetpoint,
    InHandTip,
    SwitchState,
    TaxelFrame,
    Vector,
)
from drivers.skin.layout import Layout
from skills.guards.limits import Limits
from skills.guards.passivity import STOP, PassivityGuard, PassivityVerdict
from skills.guards.scan_guards import (
    WIDEST,
    ScanSchedule,
    ScanTiming,
    require_finite_skin,
    require_finite_theta,
    require_level_skin,
    way_back,
)
from skills.guards.wrench_zero import ZeroedWrench
from skills.held_peg import HeldPeg
from skills.lead import Lead
from skills.tactile.pose import NO_PEG, Estimator, PegPose, Tracker

logger = logging.getLogger(__name__)


class SkillParams(ConfigModel):
    """Base of all skills' parameters; every skill derives its own model."""


class Outcome(StrEnum):
    """Outcome of a skill, a program or a run; records and tables use the values, the PLC's result the names."""

    SUCCESS = "success"
    FAILURE = "failure"
    ABORTED = "aborted"
    """A person or the PLC stopped the run."""
    FAULT = "fault"
    """A device or the program failed. Skills never return it; the supervisor sets it if a run raises a `CellError`."""


class Reason(IntEnum):
    """Reason why a skill ended, common to all skills; the PLC reads the number."""

    NONE = 0
    MISSED_GRASP = 1
    LOST_GRASP = 2
    NO_HOLE = 3
    NOT_ALIGNED = 4
    NOT_SEATED = 5
    FORCE_LIMIT = 6
    WORKSPACE = 7
    STOPPED = 8
    STILL_HELD = 9
    JAMMED = 10
    """The peg did not come out of the hole; the hand has released it."""
    PART_LEFT = 11
    """A peg is in a place from which a person must remove it."""


@dataclass(frozen=True, slots=True)
class SkillResult:
    """Base of all skills' results; every skill adds its facts."""

    outcome: Outcome
    reason: IntEnum
    """A `Reason`, or one of the skill's own reasons from its entry in the catalogue."""
    elapsed: float
    """Duration of the skill, s, without a preceding free-space approach."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Readings and estimates of one scan."""

    stamp: float
    """Start of the scan, s."""
    elapsed: float
    """Time along the skill's path, s; late scans slow it, and time on hold does not count."""
    step: float
    """Advance of the path time since the previous scan, s."""
    running: float
    """Running time of the skill on the cell's clock, s; time on hold does not count."""
    arm: ArmState
    gripper: GripperState
    frame: TaxelFrame
    is_new_frame: bool
    """True if the skin delivered `frame` in this scan."""
    peg: PegPose
    """Present estimate of the peg's pose; its stamp is that of the newest frame used."""
    tip: Vector
    """End point of the peg, shape (3,), m, base frame."""
    axis: Vector
    """Peg axis v from the tip to the finger, unit, shape (3,), base frame."""
    switch: SwitchState


class Request(Enum):
    """Request of the supervisor to a skill, read at each scan."""

    RUN = "run"
    HOLD = "hold"
    """Bring the arm to rest and wait."""
    RESUME = "resume"
    """Move the arm back to the setpoint that it held before the hold."""
    STOP = "stop"


class Interrupted(Exception):  # noqa: N818  a way to end, not an error
    """End of a skill from within its scan: stop, force limit, workspace limit or lost grasp; `flow` converts it to a result."""

    def __init__(self, reason: Reason) -> None:
        """Store the reason for the caller of the skill."""
        super().__init__(reason.name)
        self.reason = reason


LONGEST_BLIND = 0.7
"""Longest time without a new healthy frame while a skill holds a peg, s. Including its braking time, the arm then rests
within a second of the last healthy frame. Source: decision 0021.
"""
LATEST_STATE = 0.1
"""Largest age of the arm's state, s; if a device repeats an old state, it counts as timed out. Source: chosen, not measured."""
LEAST_TRUSTED = 0.5
"""Least share of trusted taxels of both fingers during a skill, fraction, for example one module of two on each finger."""


def is_trusted(frame: TaxelFrame) -> bool:
    """Return True if enough taxels are trusted for a skill."""
    return bool(np.count_nonzero(frame.trusted) >= LEAST_TRUSTED * frame.trusted.size)


Recorder = Callable[[Observation, ImpedanceSetpoint | None], None]


@dataclass(frozen=True, slots=True)
class Devices:
    """Devices of the cell, and its clock; the assembly makes them once."""

    clock: Clock
    arm: Arm
    gripper: Gripper
    skin: Skin
    layout: Layout
    """Layout of the skin's taxels."""
    switch: SuccessSwitch


@dataclass(frozen=True, slots=True)
class Perception:
    """Steps from a frame of the skin to the peg's pose; made anew for each run, because peg and method can change."""

    estimator: Estimator
    tracker: Tracker


@dataclass(frozen=True, slots=True)
class Callbacks:
    """Functions of the program that runs the skills."""

    poll: Callable[[], Request] = lambda: Request.RUN
    """Function that returns the supervisor's request, called once a scan."""
    progress: Callable[[float], None] = lambda fraction: None
    """Function that receives the progress of the skill, 0 to 1."""
    ended: Callable[[str, float], None] = lambda stage, elapsed: None
    """Function called with the name and the duration, s, of each stage that has ended."""
    record: Recorder = lambda seen, setpoint: None
    """Function called with every observation and the setpoint held during it."""


@dataclass(slots=True)
class SkillContext:
    """Context of a skill: devices, job, limits and scan."""

    devices: Devices
    perception: Perception
    job: Job
    limits: Limits
    """Limits of force and workspace."""
    schedule: ScanSchedule
    rng: np.random.Generator
    """Random generator of a skill's choices, such as the start of a search."""
    wrench: ZeroedWrench = field(default_factory=ZeroedWrench)
    callbacks: Callbacks = field(default_factory=Callbacks)
    stage: str = ""
    """Name of the running skill."""
    lead: Lead = field(init=False)
    """Setpoints sent to the arm, and its brake."""
    peg: HeldPeg = field(default_factory=HeldPeg, init=False)
    """Knowledge about the peg in the hand."""
    pose: PegPose = field(default=NO_PEG, init=False)
    """Newest healthy pose of the peg in the hand."""
    _unseen_since: float | None = field(default=None, init=False)
    """Time since which the hand has held a peg without a healthy pose, s; None if the pose is healthy or no peg is held."""
    _sequence: int = field(default=-1, init=False)
    """Number of the newest frame of the skin."""

    def __post_init__(self) -> None:
        """Take the lead of the arm."""
        self.lead = Lead(self.devices.arm)

    def new_id(self) -> int:
        """Return an unused setpoint id; a new id resets the arm's integral."""
        return self.lead.new_id()

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Send `setpoint` to the arm and keep it for the record; see `Lead`."""
        self.lead.follow(setpoint)

    def note_touch(self, excess: float) -> None:
        """Record that the peg touched the plate `excess`, m, further from the hand than its known length; after a slip the skills push less."""
        before, self.peg = self.peg, self.peg.touched(excess)
        if self.peg.grip_share < before.grip_share:
            share = 1e2 * self.peg.grip_share
            logger.info("peg: slipped along the fingers; pushes now rely on %.0f %% of the assumed grip", share)

    @property
    def length(self) -> float:
        """Distance from the finger centre to the peg's end point, m, by the best estimate."""
        return self.job.peg.length + (self.peg.measured or 0.0)

    def in_hand(self) -> InHandTip:
        """Return the estimated pose of the end point in the hand."""
        return InHandTip(self.pose.theta, self.length)

    def read_hand(self) -> GripperState:
        """Return the newest state of the hand.

        Raises:
            NotFiniteError: The width is not a plausible number.
            CellError: The hand's own `read` raised it.
        """
        hand = self.devices.gripper.read()
        if not -WIDEST <= hand.width <= WIDEST:
            raise NotFiniteError(f"hand: width: {hand.width}; a number needed")
        return hand

    def observe(self, elapsed: float = 0.0, step: float = 0.0, running: float = 0.0) -> Observation:
        """Read every sensor once; the three times, s, are copied into the observation.

        Raises:
            CellError: A device has timed out or stopped, or its readings are implausible.
        """
        devices = self.devices
        arm = self.wrench.taken_from(devices.arm.read())
        age = devices.clock.now() - arm.stamp
        if age > LATEST_STATE:
            raise ArmSilentError(f"arm: newest state {age:.2f} s old > {LATEST_STATE} s limit")
        frame = devices.skin.read()
        is_new_frame = frame.sequence != self._sequence
        pose: PegPose | None = None
        if is_new_frame:
            self._sequence = frame.sequence
            require_finite_skin(frame)
            if not is_trusted(frame):
                trusted, size = np.count_nonzero(frame.trusted), frame.trusted.size
                raise SkinUntrustedError(f"skin: {trusted} of {size} taxels trusted; {LEAST_TRUSTED * size:.0f} needed")
            estimate = self.perception.estimator.estimate(frame)
            require_finite_theta(estimate)
            pose = estimate if estimate.healthy else None
        # Nothing touches the peg on the way through free air; what the arm reports there is its own inertia and friction.
        held = self.lead.held
        is_free = held is None or held.is_free
        moment = 0.0 if is_free else float(arm.tcp.rotation[:, 2] @ arm.wrench.torque)
        known = self.perception.tracker.follow(pose, arm.stamp, moment)
        if known.healthy:
            self.pose, self._unseen_since = known, None
        tip, axis = end_point(arm.tcp, self.pose.theta, self.length)
        return Observation(
            stamp=arm.stamp,
            elapsed=elapsed,
            step=step,
            running=running,
            arm=arm,
            gripper=self.read_hand(),
            frame=frame,
            is_new_frame=is_new_frame,
            peg=self.pose,
            tip=tip,
            axis=axis,
            switch=devices.switch.read(),
        )

    def scan(self, timeout: float, holding: bool = False, limited: bool = True) -> Iterator[Observation]:
        """Yield one observation a scan until `timeout` seconds have passed on the cell's clock; the only loop of a skill.

        A hold request halts the arm and stops the timeout until the arm is back at its setpoint. A late scan slows the
        path time `Observation.elapsed`. If a scan exceeds the limits of `schedule`, it raises a fault.

        Args:
            timeout: Longest running time, s; time on hold does not count.
            holding: True if the hand must hold a peg and the skin must measure its pose throughout.
            limited: True to check the limits of force and workspace; False only for a motion out of a violation.

        Raises:
            Interrupted: Stop request, force limit, workspace limit or a lost grasp; the arm is halted.
            NotPassiveError: The held setpoint pumps energy into the arm; the arm is halted.
            CellError: A device has timed out or stopped, or its readings are implausible.
        """
        elapsed = running = 0.0
        clock, lead = self.devices.clock, self.lead
        paused, timing, guard = None, ScanTiming(self.schedule), PassivityGuard(self.limits.force)
        timing.take(clock.now())
        while running < timeout:
            request = self.callbacks.poll()
            if request is Request.STOP:
                self._interrupt(Reason.STOPPED)
            seen = self.observe(elapsed, timing.step, running)
            if request is not Request.RUN or lead.rest.is_sought:
                paused = self._pause(request, seen, paused)
            self.callbacks.record(seen, lead.held)
            if limited:
                self._check(seen)
                self._keep_passive(guard, seen, request)
            if holding:
                self._require_peg(seen)
            else:
                self._unseen_since = None
            if request is Request.RUN:
                yield seen
            clock.wait_until(timing.due)
            timing.take(clock.now())
            if request is Request.RUN:
                elapsed, running = elapsed + timing.step, running + timing.passed

    def _pause(self, request: Request, seen: Observation, paused: ArmState | None) -> ArmState | None:
        """Bring the arm to rest during a hold and return its state; after the hold, move it from there back to its setpoint."""
        rest, held = self.lead.rest, self.lead.held
        if request is Request.HOLD:
            if not rest.is_sought:
                rest.seek(seen.stamp)
            rest.take(seen.arm, seen.stamp)
            return seen.arm
        rest.leave()
        if request is Request.RESUME and held is not None and paused is not None:
            self.devices.arm.follow(way_back(paused, held, seen.arm, self.schedule.period))
        return paused

    def _require_peg(self, seen: Observation) -> None:
        """Check that the hand holds the peg and that the skin has measured its pose recently."""
        if not seen.gripper.is_gripping:
            self._interrupt(Reason.LOST_GRASP)
        if seen.peg.healthy:
            blind = seen.stamp - seen.peg.stamp
        else:
            if self._unseen_since is None:
                self._unseen_since = seen.stamp
            blind = seen.stamp - self._unseen_since
        if blind > LONGEST_BLIND:
            raise SkinUntrustedError(f"skin: no angle of the peg for {blind:.2f} s > {LONGEST_BLIND} s limit")

    def _check(self, seen: Observation) -> None:
        force = seen.arm.wrench.force
        if float(force @ force) > self.limits.force**2:
            self._interrupt(Reason.FORCE_LIMIT)
        x, y, z = seen.arm.tcp.position.tolist()
        low, high = self.limits.low, self.limits.high
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]):
            self._interrupt(Reason.WORKSPACE)
        if seen.is_new_frame:
            require_level_skin(seen.frame, self.devices.layout)

    def _keep_passive(self, guard: PassivityGuard, seen: Observation, request: Request) -> None:
        held = self.lead.held if request is Request.RUN else None
        verdict = guard.update(held, seen.arm.tcp, seen.stamp)
        if held is None or verdict is PassivityVerdict.PASSIVE:
            return
        if verdict is PassivityVerdict.STOP:
            self.devices.arm.halt()
            raise NotPassiveError(
                f"{self.stage or 'skill'}: {guard.share:.1f} times the energy that presses with {self.limits.force:g} N,"
                f" at {held.stiffness[:3].max():g} N/m and {held.stiffness[3:].max():g} N·m/rad; less than {STOP:g} allowed"
            )
        self.lead.soften(held)

    def _interrupt(self, reason: Reason) -> NoReturn:
        self.devices.arm.halt()
        raise Interrupted(reason)
