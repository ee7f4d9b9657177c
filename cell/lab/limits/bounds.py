"""Bounds of each phase of an insertion, from sizes, forces and masses; pure.

Each says what no search, turn or push can beat under its assumptions, which stand with it: a wall bears no more than it is given, a push accelerates
no more than its mass, lanes do not err.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.quantities import Vector
from skills.paths import TURN_TIME
from skills.play import LEAST, allowed_depth

SPEEDS: Vector = np.arange(0.02, 0.6, 0.001)
"""Speeds among which the best one is looked for, m/s."""
STEP = 1e-4
"""Step with which a descent is integrated, s."""
LONGEST = 5.0
"""Time after which a descent is given up, s."""


@dataclass(frozen=True, slots=True)
class Dip:
    """What it takes for a leaning round peg to fall into a round hole so deep that it is noticed."""

    hole: float
    """Diameter of the hole, m."""
    peg: float
    """Diameter of the peg, m."""
    tilt: float
    """Tilt of the peg from the plate's normal, rad, > 0."""
    depth: float
    """Depth of its lowest point at which the fall is noticed, m."""
    push: float
    """Push along the normal, N."""
    mass: float
    """Mass of the hand as it is felt along the normal at the peg's end, kg."""

    @property
    def time(self) -> float:
        """Time of the fall from rest, s."""
        return fall_time(self.depth, self.push, self.mass)

    def band(self, speed: float, error: float = 0.0) -> float:
        """Return the width of the band across the lanes in which a peg that slides at `speed`, m/s, is noticed, m; 0 where there is none.

        A lane at the distance x from the band's middle crosses the hole along a chord 2 sqrt(R² - x²). On it the peg slides on by speed times
        the time of the fall, and has half the width of its own end at that depth before it. Docs/tried/search.md.

        Args:
            speed: Speed along the lane, m/s.
            error: Largest distance of a lane from where it should be, m.
        """
        chord = speed * self.time + half_width(self.depth, self.peg, self.tilt)
        half = math.sqrt(max(self.hole**2 - chord**2, 0.0)) / 2.0
        return max(2.0 * (half - error), 0.0)

    def shortest(self, area: tuple[float, float], error: float = 0.0) -> "Cover":
        """Return the quickest cover of an area, m, by lanes along its second side at the best speed, none of which misses the hole.

        A lane takes its length over the speed and half the time of a turn, as `skills.paths.Lanes` has it.

        Raises:
            ValueError: No speed leaves a band.
        """
        found = []
        for speed in SPEEDS:
            band = self.band(float(speed), error)
            if band > 0.0:
                lanes = math.ceil(area[0] / band)
                found.append(Cover(lanes * (area[1] / float(speed) + TURN_TIME / 2.0), float(speed), lanes))
        if not found:
            raise ValueError(f"a dip of {self.depth} m in a hole of {self.hole} m is noticed at no speed")
        return min(found, key=lambda cover: cover.time)


@dataclass(frozen=True, slots=True)
class Cover:
    """One cover of an area by lanes."""

    time: float
    """Time, s; a hole that may be anywhere takes half of it in the mean."""
    speed: float
    """Speed along the lanes, m/s."""
    lanes: int


def fall_time(depth: float, push: float, mass: float) -> float:
    """Return the time in which a push, N, moves a mass, kg, by a depth, m, from rest: sqrt(2 h m/F), s."""
    return math.sqrt(2.0 * depth * mass / push)


def fall_depth(time: float, push: float, mass: float) -> float:
    """Return how far a push, N, moves a mass, kg, in a time, s, from rest: F t²/(2 m), m."""
    return push * time**2 / (2.0 * mass)


def half_width(depth: float, peg: float, tilt: float) -> float:
    """Return half the width, m, of a tilted round end, at a depth `depth`, m, above its lowest point.

    The end is a disc of radius r, of which the segment up to `depth`/sin(tilt) from its lowest point is below: w = sqrt(r² - (r - h/sin(tilt))²).

    Args:
        depth: Depth, m, at most that of the end's middle.
        peg: Diameter of the peg, m.
        tilt: Tilt of the peg, rad, > 0.
    """
    radius = peg / 2.0
    segment = min(depth / math.sin(tilt), radius)
    return math.sqrt(radius**2 - (radius - segment) ** 2)


def mobility(inertia: Vector, direction: Vector) -> float:
    """Return the mass, kg, that a force along `direction`, unit, shape (3,), accelerates at a point where the hand is free to turn.

    It is 1/(d W d) with W the upper left part of the inverse of `inertia`, the hand's at that point, shape (6, 6), translation first.
    """
    return 1.0 / float(direction @ np.linalg.inv(inertia)[:3, :3] @ direction)


def turning_force(inertia: Vector, axis: Vector) -> Vector:
    """Return the force at a point, shape (3,), N per rad/s², that it takes to set the hand turning about that point, which stays where it is.

    The law of motion f = L_vv a + L_vw alpha has a = 0 there, so that f = L_vw alpha. What the arm's law does not give, the hole's wall bears.

    Args:
        inertia: Inertia of the hand at the point, shape (6, 6), translation first, kg, kg·m and kg·m².
        axis: Axis of the turn, unit, shape (3,).
    """
    force: Vector = inertia[:3, 3:] @ axis
    return force


def turn_force(time: float, angle: float, coupling: float, push: float) -> float:
    """Return the least force on the hole's wall, N, of a turn about the tip from rest, which the wall bears, square to a push.

    A turn of `angle` in `time` from rest has at some moment at least the acceleration 2 angle/time².

    Args:
        time: Time of the turn, s.
        angle: Angle of the turn, rad.
        coupling: Size of `turning_force` across the push, N per rad/s².
        push: Push down the hole, N.
    """
    return math.hypot(push, coupling * 2.0 * angle / time**2)


def turn_time(force: float, angle: float, coupling: float, push: float) -> float:
    """Return the least time of such a turn, s, that keeps the wall's force at `force`, N, > push."""
    return math.sqrt(2.0 * angle * coupling / math.sqrt(force**2 - push**2))


@dataclass(frozen=True, slots=True)
class Down:
    """A push that brings a peg down its hole: m z'' = F - D z'."""

    push: float
    """Push down the hole, N."""
    mass: float
    """Mass of the hand along the hole, kg."""
    damping: float
    """Damping along the hole, N·s/m; 0 leaves the push against inertia alone."""
    arrival: float = 0.0
    """Distance from the end within which the damping is `factor` times as much, m."""
    factor: float = 1.0

    def descent(
        self, depth: float, end: float, most: Callable[[float], float] = lambda time: math.inf
    ) -> tuple[Vector, Vector]:
        """Return times, s, and depths, m, from rest at `depth` until `end`, m.

        Args:
            depth: Depth at which the peg begins, m.
            end: Depth at which it is seated, m.
            most: Largest depth that the walls allow at a time, m; they take the speed that is too much.
        """
        times, depths, speed = [0.0], [depth], 0.0
        while depths[-1] < end and times[-1] < LONGEST:
            damped = self.damping * (self.factor if depths[-1] > end - self.arrival else 1.0)
            speed = (speed + STEP * self.push / self.mass) / (1.0 + STEP * damped / self.mass)
            times.append(times[-1] + STEP)
            depths.append(max(min(depths[-1] + STEP * speed, most(times[-1])), depths[-1]))
            speed = (depths[-1] - depths[-2]) / STEP
        return np.array(times), np.array(depths)


@dataclass(frozen=True, slots=True)
class Upright:
    """A leaning hand that its rotational stiffness brings upright about the tip, critically damped: lean'' = -w² lean - 2 w lean', w² = K/I."""

    lean: float
    """Lean at the beginning, rad."""
    rate: float
    """Rate of the lean at the beginning, rad/s; negative where it is on its way up."""
    stiffness: float
    """Rotational stiffness, N·m/rad."""
    moment: float
    """Moment of inertia about the tip, kg·m²."""

    def at(self, time: float) -> float:
        """Return the lean after `time`, s, from the beginning, rad."""
        natural = math.sqrt(self.stiffness / self.moment)
        return (self.lean + (self.rate + natural * self.lean) * time) * math.exp(-natural * time)

    def deepest(self, time: float, peg: float, hole: float) -> float:
        """Return the largest depth after `time`, s, that the walls allow a round peg that leans so, m; diameters in m."""
        lean = abs(self.at(time))
        return allowed_depth(lean, peg, hole) if lean > LEAST else math.inf


def critical_damping(stiffness: float, mass: float) -> float:
    """Return the damping, N·s/m, that is critical for a stiffness, N/m, and a mass, kg: 2 sqrt(k m)."""
    return 2.0 * math.sqrt(stiffness * mass)
