"""The phases of a search as values, and the conditions of the transitions between them; pure.

The peg descends, slides along the course until there is contact evidence of an edge, and rests there. If the resting
tip is not deep enough, the peg probes the surroundings once, on a spiral. It rests again where it falls, or returns to
the course.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from drivers.frames import rotation_about
from drivers.quantities import Pose, Vector
from skills.contract import Observation
from skills.paths import spiral_at_speed
from skills.search.course import Course
from skills.search.params import SpraySearchParams


@dataclass(frozen=True, slots=True, eq=False)
class Detour:
    """Offset of the setpoint from its course, and attitude of the peg, both of which fade on the way back to the course."""

    since: float
    """Running time at the start of the way back, s."""
    offset: Vector
    """Offset from the course to the setpoint at that time, shape (2,), m."""
    axis: Vector
    """Axis of the peg at that time, without the peg's rotation in the hand since the descent, unit, shape (3,), base frame."""
    closing: Vector
    """Closing axis of the hand at that time, unit, shape (3,), base frame."""

    def left(self, elapsed: float, params: SpraySearchParams) -> float:
        """Return the remaining share of the detour, from 1 at its start to 0."""
        return max(1.0 - (elapsed - self.since) / params.return_time, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Felt:
    """Quantities of the peg on the plate in one scan."""

    seen: Observation
    turned: float
    """Rotation of the peg in the hand since the descent, rad."""
    below: float
    """Depth of the lowest point of the peg below the plate, m."""
    is_pressed: bool
    """True if the plate has borne the push for `TOUCHED_TIME`."""
    is_edge: bool
    """True if there is contact evidence of an edge."""
    velocity: Vector
    """Velocity of the course, shape (2,), m/s, base frame."""


@dataclass(frozen=True, slots=True, eq=False)
class ComingDown:
    """The peg descends to the plate from above the first point."""

    detour: Detour


@dataclass(frozen=True, slots=True, eq=False)
class Sliding:
    """The peg slides along the course."""

    detour: Detour


@dataclass(frozen=True, slots=True, eq=False)
class Probing:
    """The peg probes the place of the evidence on a spiral."""

    detour: Detour
    place: Vector
    """Place of the evidence, shape (2,), m, base frame."""
    below: float
    """Depth of the lowest point of the peg below the plate when it began to probe, m."""

    def looked(self, elapsed: float, params: SpraySearchParams) -> Vector:
        """Return the offset of the spiral from the place of the evidence, shape (2,), m."""
        return spiral_at_speed(elapsed - self.detour.since, params.probe_speed, params.probe_pitch)


@dataclass(frozen=True, slots=True, eq=False)
class Resting:
    """Rest and push until a frame taken at rest gives the depth of the tip."""

    place: Vector
    """Place of the evidence, shape (2,), m, base frame."""
    tcp: Pose
    """Pose at which the hand is held, T_base_tcp; the hand is controlled and not the tip, because the fall turns the peg in the hand."""
    stopped: float
    """Time on the cell's clock at which the hand was stopped, s."""
    was_probed: bool = False

    def is_over(self, felt: Felt, params: SpraySearchParams) -> bool:
        """Return True if the newest frame was measured after the time of rest, so that the tip's depth can be judged."""
        return felt.seen.peg.stamp >= self.stopped + params.rest


Phase = ComingDown | Sliding | Probing | Resting


def next_phase(phase: Phase, felt: Felt, params: SpraySearchParams, course: Course, point: Vector) -> Phase:
    """Return the phase after one scan; the same object if the phase continues.

    Args:
        phase: The present phase.
        felt: Quantities of the scan.
        params: Parameters of the search.
        course: The course of the search.
        point: Present point of the course, from its middle, shape (2,), m.
    """
    match phase:
        case Sliding():
            return stopped(felt, params) if felt.is_edge else phase
        case ComingDown():
            return _touched(phase, felt, params, course)
        case Probing():
            return _probed(phase, felt, params, course, point)
        case Resting():
            return phase


def after_rest(phase: Resting, felt: Felt, params: SpraySearchParams, course: Course, point: Vector) -> Phase:
    """Return the phase after a rest in which the tip was not deep enough: probe the place once, then slide on.

    An error of theta resembles the dip of a corner until theta is measured at rest; a thin peg that sticks and slips loses
    its push as in a fall. If such a dip is gone at rest, it is not probed, because a probe takes time and turns a corner further.
    """
    is_gone = params.is_doubtful and felt.below < params.gone * params.dip_threshold
    is_done = phase.was_probed or is_gone
    goal = course.middle + point if is_done else phase.place
    closing = felt.seen.arm.tcp.rotation[:, 2]
    hand_axis = rotation_about(closing, -felt.turned) @ felt.seen.axis
    detour = Detour(felt.seen.elapsed, felt.seen.tip[:2] - goal, hand_axis, closing)
    return Sliding(detour) if is_done else Probing(detour, phase.place, felt.below)


def stopped(felt: Felt, params: SpraySearchParams) -> Resting:
    """Rest at the evidence of an edge, with the hand's setpoint moved back by `probe_radius`; friction of joints and plate keeps the tip in place.

    When the rim stops a falling peg, the sliding peg is past the middle of the hole by about half this distance, and leans on the rim.
    """
    back = params.probe_radius * felt.velocity / max(math.hypot(*felt.velocity), 1e-9)
    tcp = felt.seen.arm.tcp
    hand = Pose(tcp.position - np.array([*back, 0.0]), tcp.rotation)
    return Resting(felt.seen.tip[:2] - back / 2.0, hand, felt.seen.stamp)


def _touched(phase: ComingDown, felt: Felt, params: SpraySearchParams, course: Course) -> Phase:
    """Slide once the setpoint is down and the plate bears the push, or after `search.touch_down`."""
    elapsed = felt.seen.elapsed
    is_down = elapsed * params.descent >= course.height + params.push_offset
    if (felt.is_pressed and is_down) or elapsed >= params.touch_down:
        return Sliding(replace(phase.detour, since=elapsed))
    return phase


def _probed(phase: Probing, felt: Felt, params: SpraySearchParams, course: Course, point: Vector) -> Phase:
    """Rest if the tip falls; at the end of the spiral, return to the course.

    The tip must be deeper by a dip than at the start of the probe, and before the end of the spiral also deeper than `fall`. Without the second
    condition, a peg that leans on the rim just above `fall` would stop the probe at once, and after three such rests the hole would be skipped.
    """
    seen, looked = felt.seen, phase.looked(felt.seen.elapsed, params)
    is_over = math.hypot(*looked) > params.probe_radius
    if felt.below > max(phase.below + params.dip_threshold, 0.0 if is_over else params.fall):
        return Resting(phase.place, seen.arm.tcp, seen.stamp, was_probed=True)
    if not is_over:
        return phase
    probed = phase.place + looked + phase.detour.left(seen.elapsed, params) * phase.detour.offset
    return Sliding(Detour(seen.elapsed, probed - course.middle - point, course.axis, course.closing))
