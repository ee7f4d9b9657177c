"""Bounds of each phase of an insertion, from sizes, forces and masses; without side effects.

Each bound holds for every search, rotation or push that meets these assumptions: the wall force is limited, a push
accelerates at least the hand's mass, lanes have no error.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.quantities import Vector
from skills.insert.play import LEAST, allowed_depth
from skills.paths import TURN_TIME

SPEEDS: Vector = np.arange(0.02, 0.6, 0.001)
"""Candidate speeds for the optimum, m/s."""


@dataclass(frozen=True, slots=True)
class Dip:
    """Conditions of the drop of a tilted round peg into a round hole, up to its detection."""

    hole: float
    """Diameter of the hole, m."""
    peg: float
    """Diameter of the peg, m."""
    tilt: float
    """Tilt of the peg from the plate's normal, rad, > 0."""
    depth: float
    """Depth of the peg's lowest point at which the drop is detected, m."""
    push: float
    """Push along the normal, N."""
    mass: float
    """Effective mass of the hand along the normal at the peg's end, kg."""

    @property
    def time(self) -> float:
        """Time of the drop from rest, sqrt(2 h m/F), s."""
        return math.sqrt(2.0 * self.depth * self.mass / self.push)

    def band(self, speed: float) -> float:
        """Return the width of the capture band, across the lanes, of a peg that slides at `speed`: m; 0 if there is no
        band.

        A lane at the distance x from the band's centre crosses the hole along a chord 2 sqrt(R² - x²). The chord must be
        at least as long as speed times the time of the drop, plus half the width of the peg's end at the depth of
        detection. Source: docs/tried/search.md.

        Args:
            speed: Speed along the lane, m/s.
        """
        chord = speed * self.time + half_width(self.depth, self.peg, self.tilt)
        half = math.sqrt(max(self.hole**2 - chord**2, 0.0)) / 2.0
        return 2.0 * half

    def shortest(self, area: tuple[float, float]) -> "Cover":
        """Return the fastest cover of an area, m, by lanes along its second side at the best speed, without missing the
        hole.

        A lane takes its length divided by the speed, and half the time of a turn, as in `skills.paths.Lanes`.

        Raises:
            ValueError: No speed leaves a band.
        """
        found = []
        for speed in SPEEDS:
            band = self.band(float(speed))
            if band > 0.0:
                lanes = math.ceil(area[0] / band)
                found.append(Cover(lanes * (area[1] / float(speed) + TURN_TIME / 2.0), float(speed), lanes))
        if not found:
            raise ValueError(f"a dip of {self.depth} m in a hole of {self.hole} m is not detected at any speed")
        return min(found, key=lambda cover: cover.time)


@dataclass(frozen=True, slots=True)
class Cover:
    """One cover of an area by lanes."""

    time: float
    """Time, s; for a uniformly distributed hole the mean time is half of it."""
    speed: float
    """Speed along the lanes, m/s."""
    lanes: int


def half_width(depth: float, peg: float, tilt: float) -> float:
    """Return half the width, m, of a tilted round end at the height `depth`, m, above its lowest point.

    The end is a disc of radius r. The part of the disc below that height is a segment of height h/sin(tilt), h = `depth`;
    half its chord is w = sqrt(r² - (r - h/sin(tilt))²).

    Args:
        depth: Height above the lowest point, m, at most that of the end's centre.
        peg: Diameter of the peg, m.
        tilt: Tilt of the peg, rad, > 0.
    """
    radius = peg / 2.0
    segment = min(depth / math.sin(tilt), radius)
    return math.sqrt(radius**2 - (radius - segment) ** 2)


def mobility(inertia: Vector, direction: Vector) -> float:
    """Return the effective mass, kg, along `direction`, unit, shape (3,), at a point about which the hand can rotate.

    The effective mass is 1/(dᵀ W d), with the direction d and the upper left 3 x 3 block W of the inverse of `inertia`:
    the hand's inertia at that point, shape (6, 6), translation first.
    """
    return 1.0 / float(direction @ np.linalg.inv(inertia)[:3, :3] @ direction)


def turning_force(inertia: Vector, axis: Vector) -> Vector:
    """Return the force at a fixed point, shape (3,), N per rad/s², for an angular acceleration of the hand about the point.

    The law of motion is f = L_vv a + L_vw alpha. At the fixed point a = 0, so that f = L_vw alpha. The hole's wall exerts
    the part of f that the arm's law does not exert.

    Args:
        inertia: Inertia of the hand at the point, shape (6, 6), translation first, kg, kg·m and kg·m².
        axis: Axis of the rotation, unit, shape (3,).
    """
    force: Vector = inertia[:3, 3:] @ axis
    return force


def turn_time(force: float, angle: float, coupling: float, push: float) -> float:
    """Return the shortest time of a rotation by `angle`, rad, about a fixed point, s.

    The wall force is at most `force`, N, which must exceed `push`, N; `coupling` is the force per angular acceleration,
    N per rad/s².
    """
    return math.sqrt(2.0 * angle * coupling / math.sqrt(force**2 - push**2))


@dataclass(frozen=True, slots=True)
class Down:
    """Push that moves a peg down its hole: m z'' = F - D z'."""

    push: float
    """Push down the hole, N."""
    mass: float
    """Mass of the hand along the hole, kg."""
    damping: float
    """Damping along the hole, N·s/m; 0 for inertia alone."""
    arrival: float = 0.0
    """Distance from the end of the descent within which the damping is multiplied by `factor`, m."""
    factor: float = 1.0

    def descent(
        self, depth: float, end: float, most: Callable[[float], float] = lambda time: math.inf
    ) -> tuple[Vector, Vector]:
        """Return times, s, and depths, m, from rest at `depth` until `end`, m.

        Args:
            depth: Depth of the peg at the start, m.
            end: Depth at which it is seated, m.
            most: Largest depth that the walls allow at a time, m; they absorb excess speed.
        """
        step = 1e-4  # Time step of the integration of a descent, s.
        times, depths, speed = [0.0], [depth], 0.0
        # Time limit of a descent, s.
        while depths[-1] < end and times[-1] < 5.0:
            damped = self.damping * (self.factor if depths[-1] > end - self.arrival else 1.0)
            speed = (speed + step * self.push / self.mass) / (1.0 + step * damped / self.mass)
            times.append(times[-1] + step)
            depths.append(max(min(depths[-1] + step * speed, most(times[-1])), depths[-1]))
            speed = (depths[-1] - depths[-2]) / step
        return np.array(times), np.array(depths)


@dataclass(frozen=True, slots=True)
class Upright:
    """Motion of a tilted hand, turned upright about the tip by its rotational stiffness K with critical damping and inertia I:
    lean'' = -w² lean - 2 w lean', w² = K/I.
    """

    lean: float
    """Initial tilt, rad."""
    rate: float
    """Initial rate of the tilt, rad/s; negative if it is decreasing."""
    stiffness: float
    """Rotational stiffness, N·m/rad."""
    moment: float
    """Moment of inertia about the tip, kg·m²."""

    def at(self, time: float) -> float:
        """Return the tilt after `time`, s, rad."""
        natural = math.sqrt(self.stiffness / self.moment)
        return (self.lean + (self.rate + natural * self.lean) * time) * math.exp(-natural * time)

    def deepest(self, time: float, peg: float, hole: float) -> float:
        """Return the largest depth after `time`, s, that the walls allow a round peg with this tilt, m; diameters in m."""
        lean = abs(self.at(time))
        return allowed_depth(lean, peg, hole) if lean > LEAST else math.inf


def critical_damping(stiffness: float, mass: float) -> float:
    """Return the critical damping, N·s/m, for a stiffness, N/m, and a mass, kg: 2 sqrt(k m)."""
    return 2.0 * math.sqrt(stiffness * mass)
