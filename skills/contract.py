"""What a skill is: typed parameters and a context in, a typed result out."""

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
    """Parameters of a skill; every skill derives a model of its own."""


class Outcome(StrEnum):
    """How a skill, a program or a run ended: the words of records, tables and, by their names, of the PLC's result."""

    SUCCESS = "success"
    FAILURE = "failure"
    ABORTED = "aborted"
    """A person or the PLC stopped the run."""
    FAULT = "fault"
    """A device or the program failed; no skill returns this, the supervisor says it of a run in which a `CellError` was
    raised.
    """


class Reason(IntEnum):
    """Reason of a skill's ending, in the words that all skills share; the PLC reads the number."""

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
    """A peg did not come out of the hole; the hand has let it go."""
    PART_LEFT = 11
    """A peg lies where a person must take it away."""


@dataclass(frozen=True, slots=True)
class SkillResult:
    """How a skill ended; every skill adds its facts."""

    outcome: Outcome
    reason: IntEnum
    """A `Reason`, or one of the skill's own words as its entry in the catalogue names them."""
    elapsed: float
    """Time that counts as the skill's own, s; a free-space approach before it does not."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Everything one scan reads."""

    stamp: float
    """Start of the scan, s."""
    elapsed: float
    """Time along the skill's path, s: late scans slow it, and time on hold does not count."""
    step: float
    """Time by which the path has gone on since the scan before, s."""
    running: float
    """Time that the skill's scan has been running on the cell's clock, s; time on hold does not count."""
    arm: ArmState
    gripper: GripperState
    frame: TaxelFrame
    is_new_frame: bool
    """Whether the skin delivered `frame` in this scan."""
    peg: PegPose
    """What is known of the peg now; its stamp is that of the newest frame in it and tells the age."""
    tip: Vector
    """End point of the peg, shape (3,), m, base frame."""
    axis: Vector
    """Peg axis v from the tip to the finger, unit, shape (3,), base frame."""
    switch: SwitchState


class Request(Enum):
    """What the supervisor asks of a skill at each scan."""

    RUN = "run"
    HOLD = "hold"
    """Wait, with the arm brought to rest."""
    RESUME = "resume"
    """Lead the arm back to the setpoint that it was halted from."""
    STOP = "stop"


class Interrupted(Exception):  # noqa: N818  a way to end, not an error
    """The scan ends the skill: stop, force limit or workspace limit; `flow` turns it into a result."""

    def __init__(self, reason: Reason) -> None:
        """Carry the reason to whoever runs the skill."""
        super().__init__(reason.name)
        self.reason = reason


LONGEST_BLIND = 0.7
"""Longest time for which a skill that holds a peg goes on without a new healthy frame, s: with what it takes to stand, the arm
rests within a second of the last one. Source: decision 0021.
"""
LATEST_STATE = 0.1
"""Largest age of the arm's state, s; a device that repeats an old state counts as silent."""
LEAST_TRUSTED = 20
"""Least number of trusted taxels of both fingers with which a skill goes on: half of all, one module of each finger."""


Recorder = Callable[[Observation, ImpedanceSetpoint | None], None]


@dataclass(slots=True)
class SkillContext:
    """Everything that a skill works with: devices, the job, the limits, and the scan."""

    clock: Clock
    arm: Arm
    gripper: Gripper
    skin: Skin
    switch: SuccessSwitch
    estimator: Estimator
    job: Job
    limits: Limits
    scan_period: float
    rng: np.random.Generator
    """Random generator of a skill's choices, such as the start of a search."""
    scan_limits: ScanLimits = field(default_factory=ScanLimits)
    """How late the scan may come."""
    wrench: WrenchConfig = field(default_factory=WrenchConfig)
    """What may be believed of the external wrench."""
    tracker: Tracker = field(default_factory=lambda: Blend(Smoothing()))
    poll: Callable[[], Request] = lambda: Request.RUN
    """Function that is asked once a scan what the skill shall do."""
    progress: Callable[[float], None] = lambda fraction: None
    """Function that is told how much of the skill is done, 0 to 1."""
    ended: Callable[[str, float], None] = lambda stage, elapsed: None
    """Function that is told that a stage has ended, and the time that it counts as its own, s."""
    record: Recorder = lambda seen, setpoint: None
    """Function that is given every observation with the setpoint that was held while it was made."""
    stage: str = ""
    """Name of the skill under way."""
    held: ImpedanceSetpoint | None = field(default=None, init=False)
    rest: Rest = field(init=False)
    """Rest of the arm."""
    zero: WrenchZero = field(default_factory=WrenchZero, init=False)
    """Wrench that the arm reports where nothing touches it; it is subtracted from every observation."""
    peg: HeldPeg = field(default_factory=HeldPeg, init=False)
    """What is known of the peg in the hand."""
    _unseen_since: float | None = field(default=None, init=False)
    """Time from which the hand holds a peg that the skin has not shown yet, s; None where no such peg is held."""
    _sequence: int = field(default=-1, init=False)
    _next_id: int = field(default=0, init=False)
    _late: deque[bool] = field(default_factory=new_window, init=False)
    """Lateness of the last scans."""
    _wrenches: deque[Wrench] = field(default_factory=lambda: deque(maxlen=SCANS), init=False)
    """Wrenches that the arm reported in the last scans."""
    _soft: tuple[int, Vector] | None = field(default=None, init=False)
    """Id of the setpoint whose motion the passivity guard has softened, and the largest stiffness that it leaves, shape (6,)."""

    def __post_init__(self) -> None:
        """Let the arm be brought to rest through the gate that setpoints pass."""
        self.rest = Rest(self.arm)

    def new_id(self) -> int:
        """Return a setpoint id that was not used before, which resets the arm's integral."""
        self._next_id += 1
        return self._next_id

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Hand `setpoint` to the arm and remember it for the record, with less stiffness once the passivity guard has
        softened its motion.
        """
        if self._soft is not None and setpoint.id == self._soft[0]:
            setpoint = replace(setpoint, stiffness=np.minimum(setpoint.stiffness, self._soft[1]))
        self.held = setpoint
        self.rest.leave()
        self.arm.follow(setpoint)

    def note_slip(self) -> None:
        """Note that the peg has slipped along the fingers: the skills count on less grip from now on and push less."""
        self.peg = self.peg.slipped()
        share = 1e2 * self.peg.grip_share
        logger.info("peg: slipped along the fingers; %.0f %% of the believed grip is counted on", share)

    @property
    def length(self) -> float:
        """Distance from the finger centre to the peg's end point, m, as far as is known."""
        return self.job.peg.length + self.peg.excess

    def in_hand(self) -> InHandTip:
        """Return where the end point is in the hand, as far as is known."""
        return InHandTip(self.peg.pose.theta, self.length, self.peg.pose.stamp)

    def zero_wrench(self) -> None:
        """Set the wrench's offset to its mean over the last scans, in which the hand rested in free air.

        Raises:
            WrenchOffsetError: The mean is implausible for free air.
        """
        self.zero = zero_of(self._wrenches, self.wrench)
        x, y, z = self.zero.force
        logger.info("wrench zeroed: %.1f, %.1f, %.1f N in free air, noise %.1f N", x, y, z, self.zero.noise)

    def read_hand(self) -> GripperState:
        """Return the newest state of the hand.

        Raises:
            NotFiniteError: Its width is no number.
            CellError: The hand's own `read` raised it.
        """
        return require_finite_hand(self.gripper.read())

    def observe(self, elapsed: float = 0.0, step: float = 0.0, running: float = 0.0) -> Observation:
        """Read every sensor once; the three times, s, are copied into the observation.

        Raises:
            CellError: A device is silent, stopped or not to be believed.
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
            trusted = int(np.count_nonzero(frame.trusted))
            if trusted < LEAST_TRUSTED:
                raise SkinUntrustedError(
                    f"skin: {trusted} of {frame.trusted.size} taxels trusted; {LEAST_TRUSTED} needed"
                )
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

        A hold request halts the arm and stops the count of the timeout until the arm is back at its setpoint. A scan that comes
        late slows the path, whose time is `Observation.elapsed`; beyond `scan_limits` it is a fault.

        Args:
            timeout: Longest time to go on, s; time on hold does not count.
            holding: Whether the hand must hold a peg all the while, and the skin see it.
            limited: Whether the limits of force and workspace hold; only a way out of a violation may go without.

        Raises:
            Interrupted: Stop request, force limit, workspace limit or a lost grasp; the arm is halted.
            NotPassiveError: The held setpoint pumps energy into the arm; the arm is halted.
            CellError: A device is silent, stopped or not to be believed.
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
        """Bring the arm to rest on a hold, and otherwise let it move."""
        if request is not Request.HOLD:
            self.rest.leave()
        elif not self.rest.is_sought:
            self.rest.seek(self.clock.now())

    def _keep_to_setpoint(self, seen: Observation, request: Request, paused: ArmState | None) -> None:
        """Make sure that the arm is close to its setpoint, or after a hold lead it back there from where it `paused`."""
        if self.held is None:
            return
        if request is Request.RUN:
            require_tracking(seen.arm, self.held)
        elif request is Request.RESUME and paused is not None:
            self.arm.follow(way_back(paused, self.held, seen.stamp, self.scan_period))

    def _require_peg(self, seen: Observation) -> None:
        """Make sure that the hand still holds the peg and that the skin still sees it."""
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
            require_level_skin(seen.frame)

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
