"""Contract of a skill: typed parameters and a context in, a typed result out."""

import logging
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum, StrEnum
from typing import NoReturn

import numpy as np

from drivers.config_model import ConfigModel
from drivers.errors import ArmSilentError, NotPassiveError, SkinUntrustedError
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
    Wrench,
)
from drivers.skin.layout import Layout, layout_of
from skills.held_peg import HeldPeg
from skills.passivity import SOFTENED, STOP, PassivityGuard, PassivityVerdict
from skills.rest import Rest
from skills.scan_guards import (
    ScanLimits,
    ScanTiming,
    new_window,
    require_finite_hand,
    require_finite_skin,
    require_finite_theta,
    require_level_skin,
    require_tracking,
    way_back,
)
from skills.setpoint_gate import Limits
from skills.tactile.blend import Blend, Smoothing
from skills.tactile.pose import Estimator, PegPose, Tracker
from skills.wrench_zero import SCANS, WrenchConfig, WrenchZero, zero_of

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
"""Largest age of the arm's state, s; if a device repeats an old state, it counts as timed out."""
LEAST_TRUSTED = 0.5
"""Least share of trusted taxels of both fingers during a skill, fraction, for example one module of two on each finger."""


def is_trusted(frame: TaxelFrame) -> bool:
    """Return True if enough taxels are trusted for a skill."""
    return bool(np.count_nonzero(frame.trusted) >= LEAST_TRUSTED * frame.trusted.size)


Recorder = Callable[[Observation, ImpedanceSetpoint | None], None]


@dataclass(slots=True)
class SkillContext:
    """Context of a skill: devices, job, limits and scan."""

    clock: Clock
    arm: Arm
    gripper: Gripper
    skin: Skin
    layout: Layout
    """Layout of the skin's taxels."""
    switch: SuccessSwitch
    estimator: Estimator
    job: Job
    limits: Limits
    scan_period: float
    rng: np.random.Generator
    """Random generator of a skill's choices, such as the start of a search."""
    scan_limits: ScanLimits = field(default_factory=ScanLimits)
    """Limits on the lateness of scans."""
    wrench: WrenchConfig = field(default_factory=WrenchConfig)
    """Limits on the offset and noise of the external wrench."""
    tracker: Tracker = field(default_factory=lambda: Blend(Smoothing()))
    poll: Callable[[], Request] = lambda: Request.RUN
    """Function that returns the supervisor's request, called once a scan."""
    progress: Callable[[float], None] = lambda fraction: None
    """Function that receives the progress of the skill, 0 to 1."""
    ended: Callable[[str, float], None] = lambda stage, elapsed: None
    """Function called with the name and the duration, s, of each stage that has ended."""
    record: Recorder = lambda seen, setpoint: None
    """Function called with every observation and the setpoint held during it."""
    stage: str = ""
    """Name of the running skill."""
    held: ImpedanceSetpoint | None = field(default=None, init=False)
    rest: Rest = field(init=False)
    """Brake that brings the arm to rest."""
    zero: WrenchZero = field(default_factory=WrenchZero, init=False)
    """Offset of the wrench in free air; it is subtracted from every observation."""
    peg: HeldPeg = field(default_factory=HeldPeg, init=False)
    """Knowledge about the peg in the hand."""
    _unseen_since: float | None = field(default=None, init=False)
    """Time since which the hand has held a peg without a healthy pose, s; None if there is no such peg."""
    _sequence: int = field(default=-1, init=False)
    _next_id: int = field(default=0, init=False)
    _late: deque[bool] = field(default_factory=new_window, init=False)
    """Lateness of the last scans: True if late."""
    _wrenches: deque[Wrench] = field(default_factory=lambda: deque(maxlen=SCANS), init=False)
    """Wrenches reported by the arm in the last scans."""
    _soft: tuple[int, Vector] | None = field(default=None, init=False)
    """Id of the motion softened by the passivity guard, and its largest permitted stiffness, shape (6,)."""

    def __post_init__(self) -> None:
        """Make the brake, which halts the arm through the setpoint gate."""
        self.rest = Rest(self.arm)

    def new_id(self) -> int:
        """Return an unused setpoint id; a new id resets the arm's integral."""
        self._next_id += 1
        return self._next_id

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Send `setpoint` to the arm and keep it for the record.

        If the passivity guard has softened this motion, the stiffness is reduced first.
        """
        if self._soft is not None and setpoint.id == self._soft[0]:
            setpoint = replace(setpoint, stiffness=np.minimum(setpoint.stiffness, self._soft[1]))
        self.held = setpoint
        self.rest.leave()
        self.arm.follow(setpoint)

    def note_slip(self) -> None:
        """Record a slip of the peg along the fingers; from now on the skills assume less grip and push less."""
        self.peg = self.peg.slipped()
        share = 1e2 * self.peg.grip_share
        logger.info("peg: slipped along the fingers; %.0f %% of the believed grip is counted on", share)

    @property
    def length(self) -> float:
        """Distance from the finger centre to the peg's end point, m, by the best estimate."""
        return self.job.peg.length + self.peg.excess

    def in_hand(self) -> InHandTip:
        """Return the estimated pose of the end point in the hand."""
        return InHandTip(self.peg.pose.theta, self.length, self.peg.pose.stamp)

    def zero_wrench(self) -> None:
        """Set the wrench's offset to its mean over the last scans; the hand must have rested in free air.

        Raises:
            WrenchOffsetError: The wrenches are implausible for free air.
        """
        self.zero = zero_of(self._wrenches, self.wrench)
        x, y, z = self.zero.force
        logger.info("wrench zeroed: %.1f, %.1f, %.1f N in free air, noise %.1f N", x, y, z, self.zero.noise)

    def read_hand(self) -> GripperState:
        """Return the newest state of the hand.

        Raises:
            NotFiniteError: The width is not a plausible number.
            CellError: The hand's own `read` raised it.
        """
        return require_finite_hand(self.gripper.read())

    def observe(self, elapsed: float = 0.0, step: float = 0.0, running: float = 0.0) -> Observation:
        """Read every sensor once; the three times, s, are copied into the observation.

        Raises:
            CellError: A device has timed out or stopped, or its readings are implausible.
        """
        arm = self.arm.read()
        self._wrenches.append(arm.wrench)
        arm = self.zero.taken_from(arm)
        age = self.clock.now() - arm.stamp
        if age > LATEST_STATE:
            raise ArmSilentError(f"arm: newest state {age:.2f} s old > {LATEST_STATE} s limit")
        frame = self.skin.read()
        is_new_frame = frame.sequence != self._sequence
        pose: PegPose | None = None
        if is_new_frame:
            self._sequence = frame.sequence
            require_finite_skin(frame)
            if not is_trusted(frame):
                trusted, size = np.count_nonzero(frame.trusted), frame.trusted.size
                raise SkinUntrustedError(f"skin: {trusted} of {size} taxels trusted; {LEAST_TRUSTED * size:.0f} needed")
            estimate = self.estimator.estimate(frame)
            require_finite_theta(estimate)
            pose = estimate if estimate.healthy else None
        # Nothing touches the peg on the way through free air; what the arm reports there is its own inertia and friction.
        is_free = self.held is None or self.held.is_free
        moment = 0.0 if is_free else float(arm.tcp.rotation[:, 2] @ arm.wrench.torque)
        known = self.tracker.follow(pose, arm.stamp, moment)
        if known.healthy and known is not self.peg.pose:
            self.peg = replace(self.peg, pose=known)
        tip, axis = end_point(arm.tcp, self.peg.pose.theta, self.length)
        return Observation(
            stamp=arm.stamp,
            elapsed=elapsed,
            step=step,
            running=running,
            arm=arm,
            gripper=self.read_hand(),
            frame=frame,
            is_new_frame=is_new_frame,
            peg=self.peg.pose,
            tip=tip,
            axis=axis,
            switch=self.switch.read(),
        )

    def scan(self, timeout: float, holding: bool = False, limited: bool = True) -> Iterator[Observation]:
        """Yield one observation a scan until `timeout` seconds have passed on the cell's clock; the only loop of a skill.

        A hold request halts the arm and stops the timeout until the arm is back at its setpoint. A late scan slows the
        path time `Observation.elapsed`. If a scan exceeds `scan_limits`, it raises a fault.

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
        paused, timing, guard = (
            None,
            ScanTiming(self.scan_period, self.scan_limits, self._late),
            PassivityGuard(self.limits.force),
        )
        timing.take(self.clock.now())
        while running < timeout:
            request = self.poll()
            timing.require_kept()
            if request is Request.STOP:
                self._interrupt(Reason.STOPPED)
            self._hold_or_leave(request)
            seen = self.observe(elapsed, timing.step, running)
            self.rest.take(seen.arm, seen.stamp)
            paused = seen.arm if request is Request.HOLD else paused
            self._keep_to_setpoint(seen, request, paused)
            self.record(seen, self.held)
            if limited:
                self._check(seen)
                self._keep_passive(guard, seen, request)
            if holding:
                self._require_peg(seen)
            else:
                self._unseen_since = None
            if request is Request.RUN:
                yield seen
            self.clock.wait_until(timing.due)
            timing.take(self.clock.now())
            if request is Request.RUN:
                elapsed, running = elapsed + timing.step, running + timing.passed

    def _hold_or_leave(self, request: Request) -> None:
        """Bring the arm to rest during a hold, otherwise release it."""
        if request is not Request.HOLD:
            self.rest.leave()
        elif not self.rest.is_sought:
            self.rest.seek(self.clock.now())

    def _keep_to_setpoint(self, seen: Observation, request: Request, paused: ArmState | None) -> None:
        """Check that the arm is close to its setpoint; after a hold, move it back there from where it `paused`."""
        if self.held is None:
            return
        if request is Request.RUN:
            require_tracking(seen.arm, self.held)
        elif request is Request.RESUME and paused is not None:
            self.arm.follow(way_back(paused, self.held, seen.stamp, self.scan_period))

    def _require_peg(self, seen: Observation) -> None:
        """Check that the hand holds the peg and that the skin has measured its pose recently."""
        if not seen.gripper.is_gripping:
            self._interrupt(Reason.LOST_GRASP)
        if seen.peg.healthy:
            blind = seen.stamp - seen.peg.stamp
        else:
            self._unseen_since = seen.stamp if self._unseen_since is None else self._unseen_since
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
            require_level_skin(seen.frame, layout_of(self.layout).beside)

    def _keep_passive(self, guard: PassivityGuard, seen: Observation, request: Request) -> None:
        held = self.held if request is Request.RUN else None
        verdict = guard.update(held, seen.arm.tcp, seen.stamp)
        if held is None or verdict is PassivityVerdict.PASSIVE:
            return
        if verdict is PassivityVerdict.STOP:
            self.arm.halt()
            raise NotPassiveError(
                f"{self.stage or 'skill'}: {guard.share:.1f} times the energy that presses with {self.limits.force:g} N,"
                f" at {held.stiffness[:3].max():g} N/m and {held.stiffness[3:].max():g} N·m/rad; less than {STOP:g} allowed"
            )
        if self._soft is None or held.id != self._soft[0]:
            self._soft = held.id, SOFTENED * held.stiffness

    def _interrupt(self, reason: Reason) -> NoReturn:
        self.arm.halt()
        raise Interrupted(reason)
