"""Paths of the tip and of the finger centre; pure functions of time."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.quantities import Vector

TURN_TIME = 0.1
"""Time of the turn from one lane into the next, s; at 0.125 m/s the acceleration is 2.5 m/s², which the arm can follow. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True)
class Lanes:
    """Straight parallel lanes at constant speed, a pitch apart, that cover a rectangle.

    The lanes of the next cover are between those of the first, and also along both borders, because there the first
    cover passes a hole on one side only. The first lane starts at a corner, or outside it.

    A turn takes `TURN_TIME`: the speed along the lane reverses at constant acceleration, and the point moves to the next
    lane along a cosine. The turn is within the rectangle and touches its border half-way. The peg is slow in a turn, so
    it drops into a hole there more easily.
    """

    half: tuple[float, float]
    """Half the extents of the rectangle, m."""
    fast: int
    """Axis of the lanes, 0 or 1."""
    speed: float
    """Speed along a lane, m/s."""
    lanes: int
    """Number of lanes of the first cover."""
    signs: tuple[float, float]
    """Signs of the coordinates of the first corner."""
    straight: float
    """Time along the straight part of a lane, s; each turn extends beyond it by v · TURN_TIME / 4."""
    lead: float
    """Time from the start of the path to the start of the first straight part, s."""

    @property
    def cover(self) -> float:
        """Time of the first cover of the rectangle, s."""
        return self.lead + self.lanes * (self.straight + TURN_TIME)

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Return the point, m, relative to the middle of the rectangle, and its velocity, m/s, at `time`, each shape (2,)."""
        slow = 1 - self.fast
        straight = self.straight
        time -= self.lead
        lane = max(math.floor(time / (straight + TURN_TIME)), 0)
        within = time - lane * (straight + TURN_TIME)
        pitch = 2.0 * self.half[slow] / self.lanes
        here = self._place(lane)
        way = -1.0 if lane % 2 == 0 else 1.0
        if within < straight:
            along, rate = self.speed * (within - straight / 2.0), self.speed
            across, drift = here, 0.0
        else:
            # Turn, T = TURN_TIME: along = v (straight/2 + t (1 - t/T)), its rate v (1 - 2 t/T);
            # across = here + (there - here) (1 - cos(pi t/T)) / 2
            t, there = within - straight, self._place(lane + 1)
            along = self.speed * (straight / 2.0 + t * (1.0 - t / TURN_TIME))
            rate = self.speed * (1.0 - 2.0 * t / TURN_TIME)
            angle = math.pi * t / TURN_TIME
            across = here + (there - here) * (1.0 - math.cos(angle)) / 2.0
            drift = (there - here) * math.pi / TURN_TIME * math.sin(angle) / 2.0
        point, velocity = np.empty((2, 2))
        point[self.fast] = self.signs[self.fast] * way * along
        velocity[self.fast] = self.signs[self.fast] * way * rate
        point[slow] = self.signs[slow] * pitch * across
        velocity[slow] = self.signs[slow] * pitch * drift
        return point, velocity

    def _place(self, lane: int) -> float:
        """Return the position of a lane, in pitches from the middle; every second cover is shifted by half a pitch and has one more lane."""
        number = lane % (2 * self.lanes + 1)
        if number < self.lanes:
            return (self.lanes - 1) / 2.0 - number
        return number - self.lanes - self.lanes / 2.0


def lanes(
    half: tuple[float, float], pitch: float, speed: float, fast: int, near: tuple[float, float], run_in: float
) -> Lanes:
    """Return lanes over a rectangle, at most `pitch` apart, m, from the corner next to `near`; units as in `Lanes`.

    The first lane starts `run_in` outside the rectangle, m.
    """
    signs = (math.copysign(1.0, near[0]), math.copysign(1.0, near[1]))
    straight = max(2.0 * half[fast] / speed - TURN_TIME / 2.0, 0.0)
    lead = run_in / speed + half[fast] / speed - straight / 2.0
    return Lanes(half, fast, speed, max(math.ceil(2.0 * half[1 - fast] / pitch), 1), signs, straight, lead)


def spiral(time: float, growth: float, turn_rate: float) -> Vector:
    """Return the point at `time` on an Archimedean spiral turned at constant rate.

    The radius grows linearly, r = growth·t, as in [gibbons], Sec. V.B; neighbouring turns lie
    2π·growth/turn_rate apart.

    Args:
        time: Time since the start, s, >= 0.
        growth: Growth of the radius, m/s, > 0.
        turn_rate: Angular rate, rad/s, > 0.

    Returns:
        Point in the plane of the spiral, shape (2,), m, from its centre.
    """
    radius, angle = growth * time, turn_rate * time
    return np.array([radius * math.cos(angle), radius * math.sin(angle)])


def spiral_at_speed(time: float, speed: float, pitch: float) -> Vector:
    """Return the point at `time` on an Archimedean spiral at about constant speed.

    With r = pitch·angle/2π, the length after many turns is pitch·angle²/4π, so angle = sqrt(4π·speed·time/pitch).

    Args:
        time: Time since the start, s, >= 0.
        speed: Speed along the spiral, m/s, > 0.
        pitch: Distance between neighbouring turns, m, > 0.

    Returns:
        Point in the plane of the spiral, shape (2,), m, from its centre.
    """
    angle = math.sqrt(4.0 * math.pi * speed * time / pitch)
    radius = pitch * angle / (2.0 * math.pi)
    return np.array([radius * math.cos(angle), radius * math.sin(angle)])


def dither(time: float, radius: float, turn_rate: float, period: float) -> Vector:
    """Return the point at `time` of a dither: circles whose radius grows from zero and fades to zero within each period.

    A decaying oscillation releases the torque stored by dry friction, as a decaying field demagnetises iron. A smaller
    torque on the peg reduces jamming. The radius grows during a fifth of the period, because a sudden start would hit the
    peg.

    Args:
        time: Time since the start, s, >= 0.
        radius: Largest radius, m.
        turn_rate: Angular rate, rad/s.
        period: Time of one growth and fade of the circles, s.

    Returns:
        Point in the plane of the circles, shape (2,), m, from their centre.
    """
    share, angle = (time % period) / period, turn_rate * time
    r = radius * min(share / 0.2, (1.0 - share) / 0.8)
    return np.array([r * math.cos(angle), r * math.sin(angle)])
