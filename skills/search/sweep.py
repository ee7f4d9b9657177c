"""Motion of the peg over the plate, from each observation to the next setpoint; one object serves one search."""

import logging
import math
from dataclasses import replace

import numpy as np

from drivers.frames import UP, rotation_about
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, SkillContext
from skills.held_peg import EXPLAINED
from skills.motion import VALIDITY, Trim, between
from skills.search.course import Course
from skills.search.decoys import BLIND, Decoy
from skills.search.feel import Bearing, EdgeEvidence, Push, excess_of
from skills.search.params import SpraySearchParams
from skills.search.phases import (
    ComingDown,
    Detour,
    Felt,
    Phase,
    Probing,
    Resting,
    Sliding,
    after_rest,
    next_phase,
)
from skills.search.tour import Left

logger = logging.getLogger(__name__)


class SearchSweep:
    """Runs the phases of a search; `skills.search.phases` decides which phase follows."""

    def __init__(self, params: SpraySearchParams, ctx: SkillContext, course: Course, evidence: EdgeEvidence) -> None:
        """Start above the first point of the course."""
        self._params, self._ctx, self._course, self._evidence = params, ctx, course, evidence
        self._push = Push(params.push_stiffness, 0.0)
        self._stiffness, self._damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
        self._lag = 0.0
        """Lag of the tip behind its setpoint along the pass, m."""
        self._resting: ImpedanceSetpoint | None = None
        self._edge = course.first
        self.touched: Vector | None = None
        """Lowest point of the peg at its last touch-down, shape (3,), m, base frame, with the length measured there; None before."""
        self._is_doubted = False
        """True if the last touch-down was below the plate while decoys are known."""
        self.rests = 0
        """Number of times that contact evidence stopped the path."""
        self.hold_anew()

    def hold_anew(self) -> None:
        """Start the descent from the first point of the course, with the present theta of the peg."""
        ctx, course = self._ctx, self._course
        self._theta = ctx.in_hand().theta
        """In-hand angle at the start of the descent, rad."""
        self._identity, self._push = ctx.new_id(), replace(self._push, theta=self._theta)
        self._bearing = Bearing(self._params.touched, ctx.wrench.zero, ctx.schedule.period)
        self._phase: Phase = ComingDown(Detour(0.0, np.zeros(2), course.axis, course.closing))
        self._trim = Trim(self._params.trim_rate, self._params.trim_limit)
        self._along = course.since
        """Time along the course, s."""
        self._point, self._velocity = course.path.at(course.since)
        self._rested: Vector = np.full(2, math.inf)
        """Place of the newest stop that found no hole, shape (2,), m, base frame; infinite before the first one."""
        self._times = 0
        """Number of stops at that place so far."""
        self._evidence.restart()

    def finds(self, seen: Observation) -> bool:
        """Process one observation; return True if the tip is judged to be in the hole."""
        params, course = self._params, self._course
        self._push = self._push.after(seen.peg.theta, params)
        self._point, self._velocity = course.path.at(self._along)
        edge = self._edge = self._ctx.job.peg.part.lowest(seen.tip, seen.axis, seen.arm.tcp.rotation[:, 2])
        felt = self._felt(seen, edge)
        before = self._phase
        self._enter(next_phase(before, felt, params, course, self._point))
        match before, self._phase:
            case Sliding(), Sliding():
                self._evidence.learn(edge)
            case ComingDown(), Sliding():
                self._take_touch_down(felt, edge)
            case _, Resting() as rest if rest.is_over(felt, params):
                if felt.below >= params.fall:
                    return True
                if self._is_stuck(felt):
                    self._pass_over()
                self._enter(after_rest(rest, felt, params, course, self._point))
        return False

    def _take_touch_down(self, felt: Felt, edge: Vector) -> None:
        """Measure the peg's length at the touch-down on the plate, or register a decoy."""
        if self._has_come_down_in_decoy(felt, edge):
            self._pass_over()
        elif felt.is_pressed:
            self._measure_length(edge, felt)
        else:
            self._bearing.require_sense(self._push.stiffness * self._params.push_offset)

    def _has_come_down_in_decoy(self, felt: Felt, edge: Vector) -> bool:
        """Return True if decoys are known and the peg came down below the plate or without contact; the next time this counts as a slip."""
        low = self._course.surface - float(edge[2]) > EXPLAINED or not felt.is_pressed
        is_doubted, self._is_doubted = self._is_doubted, low and bool(self._course.decoys)
        return self._is_doubted and not is_doubted

    def _pass_over(self) -> None:
        """Register the place of the peg as a decoy."""
        decoy = Decoy(self.edge, BLIND * self._ctx.job.hole.part.inscribed)
        self._course = self._course.passing(decoy, self._along)

    def _is_stuck(self, felt: Felt) -> bool:
        """Count a rest that has ended; return True if the peg has rested here `search.stuck_after` times."""
        here = felt.seen.tip[:2]
        self._times = self._times + 1 if math.dist(here, self._rested) <= self._params.stuck_within else 1
        self._rested = here
        return self._times >= self._params.stuck_after

    def is_to_lift(self, seen: Observation) -> bool:
        """Return True if the search must lift the peg: it is stuck in a decoy or slides into one, or it has turned in the hand by more
        than `search.turned`, and the hand must turn by the same angle in the air.
        """
        is_stuck = self._times >= self._params.stuck_after
        is_in_decoy = isinstance(self._phase, Sliding) and self._course.beyond(self._along) > self._along
        return is_stuck or is_in_decoy or abs(seen.peg.theta - self._theta) > self._params.turned

    def begin_anew(self) -> Course:
        """Return the course on which the lifted peg descends at the same place, or behind a decoy."""
        self._course = self._course.down_from(self._along)
        return self._course

    @property
    def edge(self) -> tuple[float, float]:
        """Lowest point of the peg in the newest scan, m, base frame."""
        return float(self._edge[0]), float(self._edge[1])

    @property
    def axis(self) -> Vector:
        """Setpoint of the peg's axis on the plate, unit, shape (3,), base frame."""
        return self._course.axis

    @property
    def progress(self) -> float:
        """Return the covered part of the area, 0 to 1."""
        cover = self._course.path.cover
        return self._along / cover if self._along < cover else 1.0

    @property
    def left(self) -> Left:
        """Rest of the path, which the search has not swept yet."""
        return Left(self._course.path, self._along)

    def setpoint(self, seen: Observation) -> ImpedanceSetpoint:
        """Return the setpoint of this scan, and advance along the course. Must be called once per scan,
        after `finds`.
        """
        phase = self._phase
        if isinstance(phase, Resting):
            assert self._resting is not None
            return self._resting.moved(self._resting.tip, seen.stamp + VALIDITY)
        back = phase.detour.left(seen.elapsed, self._params)
        target, velocity = self._way(phase, seen, back)
        slow = 1 - self._course.fast
        if target[2] < self._course.surface + self._params.trimmed_below:
            self._trim = self._trim.after(target[slow] - seen.tip[slow], seen.step)
        target[slow] += self._trim.value
        return ImpedanceSetpoint(
            id=self._identity,
            tip=target,
            axis=self._turned(seen, between(self._course.axis, phase.detour.axis, back)),
            roll=between(self._course.closing, phase.detour.closing, back),
            stiffness=self._compliance(),
            damping_ratio=self._damping_ratio,
            valid_until=seen.stamp + VALIDITY,
            in_hand=self._ctx.in_hand(),
            twist=Twist(velocity, np.zeros(3)),
        )

    def _turned(self, seen: Observation, axis: Vector) -> Vector:
        """Return an axis rotated by the peg's rotation in the hand since the descent.

        With this setpoint the hand keeps its orientation. If the hand followed the rotation, the plate would hold the tip, and the peg
        would turn further in the pads: the hand would never reach the measured angle.
        """
        return rotation_about(seen.arm.tcp.rotation[:, 2], seen.peg.theta - self._theta) @ axis

    def _measure_length(self, edge: Vector, felt: Felt) -> None:
        """Measure the peg's length by a touch-down; a difference after the first touch-down shows a slip."""
        height = float(edge[2]) - self._course.surface
        excess = excess_of(height, felt.seen.axis, self._params.length_bound, self._ctx.peg.is_length_known)
        if excess is None:
            logger.warning(
                "peg: touched the plate with its end at %.1f mm above the stated surface; at most %.1f mm allowed: length unchanged",
                1e3 * height,
                1e3 * self._params.length_bound,
            )
        elif excess:
            logger.info("peg: reaches %.1f mm further from the hand than stated, by its first touch-down", 1e3 * excess)
        self._ctx.note_touch(excess or 0.0)
        self.touched = edge - (excess or 0.0) * float(felt.seen.axis[2]) * UP

    def _enter(self, phase: Phase) -> None:
        """Change to `phase`; no other function changes the phase."""
        before, self._phase = self._phase, phase
        if type(phase) is type(before):
            return
        self._lag = 0.0
        if isinstance(phase, Resting):
            self.rests += isinstance(before, Sliding)
            self._resting = self._still(phase)
            return
        self._evidence.restart()

    def _felt(self, seen: Observation, edge: Vector) -> Felt:
        is_likely = self._along < self._course.likely_until
        below, is_edge = self._evidence.update(seen, edge, is_likely)
        push = self._push.stiffness * self._params.push_offset
        is_held = self._params.lag is not None and self._lag > self._params.lag
        return Felt(
            seen=seen,
            turned=seen.peg.theta - self._theta,
            below=below,
            is_pressed=self._bearing.after(float(seen.arm.wrench.force[2]), push),
            is_edge=is_edge or is_held,
            velocity=self._velocity,
        )

    def _way(self, phase: ComingDown | Sliding | Probing, seen: Observation, back: float) -> tuple[Vector, Vector]:
        """Return the setpoint of the tip, shape (3,), m, and its velocity, shape (3,), m/s; advance along the course."""
        params, course = self._params, self._course
        top, depth = course.surface + course.height, course.surface - params.push_offset
        # The setpoint descends at this rate even if the touch-down was detected too early.
        share = min(seen.elapsed * params.descent / (top - depth), 1.0)
        target, velocity = np.array([0.0, 0.0, top + (depth - top) * share]), np.zeros(3)
        match phase:
            case Sliding():
                # Under a smaller push, the peg falls more slowly, so the speed is reduced in proportion.
                run_up = min((seen.elapsed - phase.detour.since) / params.run_up, 1.0)
                pace = self._push.stiffness / params.push_stiffness * run_up
                self._along += pace * seen.step
                target[:2] = course.middle + self._point + back * phase.detour.offset
                velocity[:2] = pace * self._velocity
                self._lag = abs(float(target[course.fast] - seen.tip[course.fast]))
            case Probing():
                target[:2] = phase.place + phase.looked(seen.elapsed, params) + back * phase.detour.offset
            case ComingDown():
                target[:2] = course.middle + self._point
        return target, velocity

    def _still(self, phase: Resting) -> ImpedanceSetpoint:
        """Return the setpoint that holds the hand at the pose of the stop, and continues to push down."""
        damping_ratio = self._damping_ratio.copy()
        damping_ratio[:3] *= self._params.rest_damping
        return ImpedanceSetpoint(
            id=self._identity,
            tip=phase.tcp.position - np.array([0.0, 0.0, self._params.push_offset]),
            axis=-phase.tcp.rotation[:, 0],
            roll=phase.tcp.rotation[:, 2],
            stiffness=self._compliance(),
            damping_ratio=damping_ratio,
            valid_until=phase.stopped + VALIDITY,
        )

    def _compliance(self) -> Vector:
        """Return the stiffness, shape (6,), with that of the push along z."""
        stiffness = self._stiffness.copy()
        stiffness[2] = self._push.stiffness
        return stiffness
