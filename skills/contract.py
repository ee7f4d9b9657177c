"""What a skill is: typed parameters and a context in, a typed result out."""

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum, StrEnum
from typing import Annotated, Literal, NoReturn, Protocol

import numpy as np
from pydantic import Field

from drivers.errors import NotPassiveError, ScanOverrunError, SkinUntrustedError, TrackingError
from drivers.frames import end_point
from drivers.parts import ConfigModel, Job
from drivers.protocols import Arm, Clock, Gripper, Skin, SuccessSwitch
from drivers.quantities import (
    ArmState,
    GripperState,
    ImpedanceSetpoint,
    InHandTip,
    Pose,
    SwitchState,
    TaxelFrame,
    Vector,
)
from skills.passivity import SOFTENED, STOP, PassivityGuard, Verdict


class SkillParams(ConfigModel):
    """How a skill shall work; every skill derives its own."""


class Outcome(StrEnum):
    """How a skill or a program ended."""

    SUCCESS = "success"
    FAILURE = "failure"
    ABORTED = "aborted"


class Reason(IntEnum):
    """Why a skill ended so, in the words that all skills share; the PLC reads the number."""

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


@dataclass(frozen=True, slots=True)
class SkillResult:
    """How a skill ended; every skill adds its facts."""

    outcome: Outcome
    reason: IntEnum
    """A `Reason`, or one of the skill's own words as its entry in the catalogue names them."""
    elapsed: float
    """Time that counts as the skill's own, s; a free-space approach before it does not."""


@dataclass(frozen=True, slots=True)
class PegPose:
    """What an estimator knows of the peg in the hand."""

    theta: float
    """In-hand angle, rad, in [-pi/2, pi/2)."""
    offset: float
    """Distance of the peg's axis from the finger centre, in the plane of the pads, m, signed."""
    sigma: float
    """Standard deviation of theta, rad."""
    residual: float
    """Part of the frame that the estimate does not explain, 0 to 1."""
    healthy: bool
    """False where theta should not be used."""
    stamp: float
    """Time of the frame it was made from, s."""


NO_PEG = PegPose(theta=0.0, offset=0.0, sigma=math.inf, residual=1.0, healthy=False, stamp=-math.inf)
"""Before the first healthy estimate: straight out of the hand, and nothing to rely on."""


class Estimator(Protocol):
    """Taxels in, pose of the peg in the hand out; nothing is kept but what frames tell of the pads."""

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; `healthy` is False where there is none to be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Everything one scan reads."""

    stamp: float
    """Start of the scan, s."""
    elapsed: float
    """Time that the skill's scan has been running, s; time on hold does not count."""
    arm: ArmState
    gripper: GripperState
    frame: TaxelFrame
    is_new_frame: bool
    """The skin delivered `frame` in this scan."""
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
    """Wait, halting the arm at every scan until it is at rest."""
    STAY = "stay"
    """Wait on, with the arm as it is."""
    RESUME = "resume"
    """Lead the arm back to the setpoint that it was halted from."""
    STOP = "stop"


class Interrupted(Exception):  # noqa: N818  a way to end, not an error
    """The scan ends the skill: stop, force limit or workspace limit; `flow` turns it into a result."""

    def __init__(self, reason: Reason) -> None:
        """Carry the reason to whoever runs the skill."""
        super().__init__(reason.name)
        self.reason = reason


class Tracker(Protocol):
    """Keeps the pose of the peg in the hand from frame to frame, and between them."""

    def follow(self, stamp: float, tcp: Pose, length: float, new: PegPose | None) -> PegPose:
        """Return the pose of the peg now, at every scan; not healthy as long as nothing is known.

        Args:
            stamp: Time now, s.
            tcp: T_base_tcp now.
            length: From the finger centre to the peg's end point, m.
            new: A healthy estimate from a frame that has just come, if any; its stamp may lie in the past, and one
                that is no newer than what is known is left out.
        """


class Smoothing(ConfigModel):
    """How theta is taken over from frame to frame; noise of theta would kick the tip at the skin's rate."""

    method: Literal["blend", "observer"] = "blend"
    """Blend frames and hold theta between them, or observe it at every scan: see `skills.tactile.observer`."""
    blend: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Weight of a new frame in the running estimate; 1 takes each frame as it is, as [gibbons] does."""
    jump: Annotated[float, Field(gt=0.0)] = 0.15
    """A frame further off than this, rad, is a slip of the peg and taken at once."""

    def take(self, held: PegPose, new: PegPose) -> PegPose:
        """Return the running estimate after a new healthy frame.

        A peg looks the same turned by 180 degrees, so the angle next to the held one is meant.
        """
        if not held.healthy:
            return new
        step = math.remainder(new.theta - held.theta, math.pi)
        return replace(new, theta=held.theta + (step if abs(step) > self.jump else self.blend * step))


class Blend:
    """Blends frames as `Smoothing` says, and holds theta between them."""

    def __init__(self, smoothing: Smoothing) -> None:
        """Start with nothing known."""
        self._smoothing, self._peg = smoothing, NO_PEG

    def follow(self, stamp: float, tcp: Pose, length: float, new: PegPose | None) -> PegPose:
        """See `Tracker`."""
        if new is not None and new.stamp > self._peg.stamp:
            self._peg = self._smoothing.take(self._peg, new)
        return self._peg


LONGEST_BLIND = 1.0
"""A skill that holds a peg whose angle was known goes on without a new healthy frame for so long, s."""
OVERRUN_WINDOW = 100
"""Scans that overruns are counted over."""
MOST_OVERRUNS = 5
"""So many scans of the window may take longer than two periods; a scan that slips once is made up for."""
TRACKING_LIMIT = 0.1
"""Between the controlled point and its setpoint, m: what skills push with stays below half of it."""
RESUME_TIME = 1.0
"""From a hold back to the setpoint, s: a peg that left the plate while the arm braked comes down on it slowly."""
LEAST_TRUSTED = 20
"""Taxels of both fingers without which no skill goes on: half of them, one module of each finger."""


class Limits(ConfigModel):
    """What ends a skill at once; no defaults."""

    force: float
    """Largest estimated external force at the TCP, N."""
    low: tuple[float, float, float]
    """Corner of the workspace that the TCP must stay in, m, base frame."""
    high: tuple[float, float, float]
    """The other corner, m, base frame."""


Recorder = Callable[[Observation, ImpedanceSetpoint | None], None]


@dataclass(slots=True)
class SkillContext:
    """A skill's whole world: devices, the job, the limits, and the scan."""

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
    """For choices that a skill makes at random, as the start of a search."""
    tracker: Tracker = field(default_factory=lambda: Blend(Smoothing()))
    poll: Callable[[], Request] = lambda: Request.RUN
    """Asked once a scan."""
    progress: Callable[[float], None] = lambda fraction: None
    """Told how much of the skill is done, 0 to 1."""
    record: Recorder = lambda seen, setpoint: None
    """Given every observation with the setpoint that was held while it was made."""
    stage: str = ""
    """Name of the skill under way."""
    held: ImpedanceSetpoint | None = field(default=None, init=False)
    _peg: PegPose = field(default=NO_PEG, init=False)
    _sequence: int = field(default=-1, init=False)
    _next_id: int = field(default=0, init=False)
    _soft: tuple[int, Vector] | None = field(default=None, init=False)
    """Id of the setpoint that is followed softly, and the most stiffness, shape (6,)."""

    def new_id(self) -> int:
        """Return a setpoint id that was not used before, which resets the arm's integral."""
        self._next_id += 1
        return self._next_id

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Hand `setpoint` to the arm and remember it for the record; softly once its motion was found to pump."""
        if self._soft is not None and setpoint.id == self._soft[0]:
            setpoint = replace(setpoint, stiffness=np.minimum(setpoint.stiffness, self._soft[1]))
        self.held = setpoint
        self.arm.follow(setpoint)

    def in_hand(self) -> InHandTip:
        """Return where the end point is in the hand, as far as is known."""
        return InHandTip(self._peg.theta, self.job.peg.length, self._peg.stamp)

    def observe(self, elapsed: float = 0.0) -> Observation:
        """Read every sensor once; `elapsed` is what the observation shall say of the scan's running time, s.

        Raises:
            CellError: A device is silent, stopped or not to be believed.
        """
        arm = self.arm.read()
        frame = self.skin.read()
        is_new_frame = frame.sequence != self._sequence
        pose: PegPose | None = None
        if is_new_frame:
            self._sequence = frame.sequence
            trusted = int(np.count_nonzero(frame.trusted))
            if trusted < LEAST_TRUSTED:
                raise SkinUntrustedError(
                    f"skin: {trusted} of {frame.trusted.size} taxels trusted; {LEAST_TRUSTED} needed"
                )
            estimate = self.estimator.estimate(frame)
            pose = estimate if estimate.healthy else None
        known = self.tracker.follow(arm.stamp, arm.tcp, self.job.peg.length, pose)
        if known.healthy:
            self._peg = known
        tip, axis = end_point(arm.tcp, self._peg.theta, self.job.peg.length)
        return Observation(
            stamp=arm.stamp,
            elapsed=elapsed,
            arm=arm,
            gripper=self.gripper.read(),
            frame=frame,
            is_new_frame=is_new_frame,
            peg=self._peg,
            tip=tip,
            axis=axis,
            switch=self.switch.read(),
        )

    def scan(self, timeout: float, holding: bool = False, limited: bool = True) -> Iterator[Observation]:
        """Yield one observation a scan until `timeout` seconds of running have passed; the only loop of a skill.

        A hold request halts the arm and stops the count of the timeout until the arm is back at its setpoint.

        Args:
            timeout: Longest time to go on, s; time on hold does not count.
            holding: The hand must hold something all the while.
            limited: Keep to the limits of force and workspace; only a way out of a violation may not.

        Raises:
            Interrupted: Stop request, force limit, workspace limit or a lost grasp; the arm is halted.
            NotPassiveError: The held setpoint pumps energy into the arm; the arm is halted.
            CellError: A device is silent, stopped or not to be believed.
        """
        elapsed, due = 0.0, math.inf
        overruns: deque[bool] = deque(maxlen=OVERRUN_WINDOW)
        guard = PassivityGuard(self.limits.force)
        paused = None
        while elapsed < timeout:
            request = self.poll()
            if request is Request.STOP:
                self._interrupt(Reason.STOPPED)
            if request is Request.HOLD:
                self.arm.halt()
            seen = self.observe(elapsed)
            overruns.append(seen.stamp > due + self.scan_period)
            due = seen.stamp + self.scan_period
            if sum(overruns) > MOST_OVERRUNS:
                raise ScanOverrunError(
                    f"scan: {sum(overruns)} of the last {len(overruns)} took longer than "
                    f"{2e3 * self.scan_period:g} ms; {MOST_OVERRUNS} allowed: stop other programs, or lower scan_rate"
                )
            if request in (Request.HOLD, Request.STAY):
                paused = seen.arm
            elif request is Request.RESUME and paused is not None and self.held is not None:
                self.arm.follow(_way_back(paused, self.held, seen.stamp, self.scan_period))
            if request is Request.RUN and self.held is not None:
                _require_tracking(seen.arm, self.held)
            if limited:
                self._check(seen)
                self._keep_passive(guard, seen, request)
            self.record(seen, self.held)
            if holding and not seen.gripper.is_gripping:
                self._interrupt(Reason.LOST_GRASP)
            blind = seen.stamp - seen.peg.stamp
            if holding and seen.peg.healthy and blind > LONGEST_BLIND:
                raise SkinUntrustedError(f"skin: no angle of the peg for {blind:.2f} s > {LONGEST_BLIND} s limit")
            if request is Request.RUN:
                yield seen
                elapsed += self.scan_period
            self.clock.wait_until(due)

    def _check(self, seen: Observation) -> None:
        force = seen.arm.wrench.force
        if float(force @ force) > self.limits.force**2:
            self._interrupt(Reason.FORCE_LIMIT)
        x, y, z = seen.arm.tcp.position
        low, high = self.limits.low, self.limits.high
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]):
            self._interrupt(Reason.WORKSPACE)

    def _keep_passive(self, guard: PassivityGuard, seen: Observation, request: Request) -> None:
        held = self.held if request is Request.RUN else None
        verdict = guard.update(held, seen.arm.tcp, seen.stamp)
        if held is None or verdict is Verdict.PASSIVE:
            return
        if verdict is Verdict.STOP:
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


def _way_back(paused: ArmState, held: ImpedanceSetpoint, stamp: float, scan_period: float) -> ImpedanceSetpoint:
    """Return the setpoint at `stamp` on the straight way from where the arm was `paused` to what it held before."""
    theta, length = (0.0, 0.0) if held.in_hand is None else (held.in_hand.theta, held.in_hand.length)
    tip, axis = end_point(paused.tcp, theta, length)
    share = min((stamp - paused.stamp) / RESUME_TIME, 1.0)
    mixed = axis + share * (held.axis - axis)
    return replace(
        held,
        tip=tip + share * (held.tip - tip),
        axis=mixed / float(np.linalg.norm(mixed)),
        twist=None,
        valid_until=stamp + 10.0 * scan_period,
    )


def _require_tracking(arm: ArmState, held: ImpedanceSetpoint) -> None:
    """Make sure that the arm is about where it shall be.

    Raises:
        TrackingError: It is blocked, or was told to be somewhere else altogether.
    """
    point = arm.tcp.position
    if held.in_hand is not None:
        point, _ = end_point(arm.tcp, held.in_hand.theta, held.in_hand.length)
    lag = math.dist(point, held.tip)
    if lag > TRACKING_LIMIT:
        raise TrackingError(
            f"arm: controlled point {lag * 1e3:.0f} mm from its setpoint > {TRACKING_LIMIT * 1e3:.0f} mm limit; "
            "it is blocked, or the setpoint cannot be reached"
        )
