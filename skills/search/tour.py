"""A path over the area that begins at the likely place of the hole and then covers the rest; pure."""

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Protocol

import numpy as np

from drivers.parts import HolePrior
from drivers.quantities import Vector
from skills.paths import TURN_TIME

GATE = 3.0
"""Half width of the likely place, which is searched first, standard deviations."""
RUN_UP = 0.015
"""Additional length of the first stroke before the likely place, m, if the area has room; on it the search estimates the plate's plane.
Source: docs/tried/search.md.
"""

_BEGAN = attrgetter("began")

Point = tuple[float, float]
"""Point in the plane of the area, m, from its middle, or velocity, m/s."""
Stroke = tuple[Point, Point]
"""First and last point of a straight piece with constant speed, m."""


class Path(Protocol):
    """A path in the plane of the area."""

    @property
    def cover(self) -> float:
        """Return the time along the path until the area is covered once, s; 0 if nothing is left to cover."""

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Return the point, m, and its velocity, m/s, at `time`, s, each shape (2,), from the middle of the area."""


@dataclass(frozen=True, slots=True)
class Left:
    """Rest of a path, from a time on."""

    path: Path
    since: float
    """Time along the path at which the rest begins, s."""


@dataclass(frozen=True, slots=True)
class Leg:
    """One piece of a path: a cubic between two points with given velocities; it is straight if both velocities point along it."""

    began: float
    """Start of the piece, as time along the path, s."""
    duration: float
    """Duration, s, > 0."""
    points: tuple[Point, Point]
    """First and last point, m."""
    velocities: tuple[Point, Point]
    """Velocities at the first and the last point, m/s."""

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Return the point, m, and its velocity, m/s, at `time` along the path, s, each shape (2,): a cubic Hermite curve."""
        s, span = (time - self.began) / self.duration, self.duration
        rise, begin, end = s * s * (3.0 - 2.0 * s), (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)
        point, rate = np.empty(2), np.empty(2)
        for i in range(2):
            (p, q), (u, v) = (self.points[0][i], self.points[1][i]), (self.velocities[0][i], self.velocities[1][i])
            point[i] = p + rise * (q - p) + span * s * (1.0 - s) * ((1.0 - s) * u - s * v)
            rate[i] = 6.0 * s * (1.0 - s) * (q - p) / span + begin * u + end * v
        return point, rate


@dataclass(frozen=True, slots=True)
class Tour:
    """Straight strokes in order, joined by turns, and then another path."""

    legs: tuple[Leg, ...]
    then: Left
    """Path that follows the strokes."""

    @property
    def duration(self) -> float:
        """Time of the strokes, s."""
        return _end(self.legs)

    @property
    def cover(self) -> float:
        """Return the time along the path until the area is covered once, s."""
        return self.duration + max(self.then.path.cover - self.then.since, 0.0)

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Return the point, m, and its velocity, m/s, at `time`, s, each shape (2,), from the middle of the area."""
        if time >= self.duration:
            return self.then.path.at(time - self.duration + self.then.since)
        return self.legs[max(bisect_right(self.legs, time, key=_BEGAN) - 1, 0)].at(time)


@dataclass(frozen=True, slots=True)
class Rows:
    """Arrangement of the strokes that sweep an area."""

    half: Point
    """Half the extents of the swept area, m."""
    fast: int
    """Axis of the strokes, 0 or 1."""
    pitch: float
    """Largest distance between neighbouring strokes, m."""
    speed: float
    """Speed along a stroke, m/s."""

    def place(self, along: float, across: float) -> Point:
        """Return a point by its coordinates along and across the strokes."""
        return (along, across) if self.fast == 0 else (across, along)

    def order(self, across: float, near: int) -> list[float]:
        """Return the coordinate of each stroke across the strokes, m, in order: the one nearest to `across`, `near` strokes
        on each side alternately, those up to the nearer border, then the rest.
        """
        edge = self.half[1 - self.fast]
        count = max(math.ceil(2.0 * edge / self.pitch), 1)
        first = min(max(math.floor((across + edge) / (2.0 * edge) * count), 0), count - 1)
        turns = (first + (n + 1) // 2 * (1 if n % 2 else -1) for n in range(2 * near + 1))
        below, above = range(first - 1, -1, -1), range(first + 1, count)
        numbers = [*turns, *below, *above] if len(below) < len(above) else [*turns, *above, *below]
        return [edge * ((2 * n + 1) / count - 1.0) for n in dict.fromkeys(numbers) if 0 <= n < count]


def first_look(likely: HolePrior, middle: Point, rows: Rows, width: float, outside: float, way: float) -> list[Stroke]:
    """Return strokes over the likely place of the hole, the most likely one first. Even if the likely place is wide, no stroke leaves
    the area by more than `outside`.

    Args:
        likely: Likely place of the hole.
        middle: Middle of the area, shape (2,), m, base frame.
        rows: Arrangement of the strokes.
        width: Diameter of the largest circle inside the hole, m.
        outside: Distance from the hole's middle at which the peg touches down, m.
        way: Direction of the first stroke along its axis, -1 or 1.
    """
    along, across = _clipped(likely, middle, rows)
    reach, edge = GATE * likely.deviation[rows.fast], rows.half[rows.fast]
    strokes: list[Stroke] = []
    for n in range(2 * beside(likely, rows) + 1):
        place = across + rows.pitch * ((n + 1) // 2) * (1.0 if n % 2 else -1.0)
        if abs(place) <= rows.half[1 - rows.fast]:
            before, run_up = (width / 2, 0.0) if strokes else (outside, RUN_UP)
            begin = way * max(way * along - reach - before - run_up, -edge - before)
            end = way * min(way * along + reach + width / 2, edge)
            strokes.append((rows.place(begin, place), rows.place(end, place)))
            way = -way
    return strokes


def outwards(likely: HolePrior, middle: Point, rows: Rows, start: float, way: float) -> list[Stroke]:
    """Return strokes over the whole area: first over the likely place, then to the nearer border, then to the other border.

    Args:
        likely: Likely place of the hole.
        middle: Middle of the area, shape (2,), m, base frame.
        rows: Arrangement of the strokes.
        start: Coordinate along the strokes at which the first one begins, from the middle, m; the part before it comes last.
        way: Direction of the first stroke along its axis, -1 or 1.
    """
    edge = rows.half[rows.fast]
    start = way * min(way * start, edge)
    first, *others = rows.order(_clipped(likely, middle, rows)[1], beside(likely, rows))
    spans = [(start, way * edge, first)]
    for n, place in enumerate(others):
        turned = way if n % 2 else -way
        spans.append((-turned * edge, turned * edge, place))
    if way * start > -edge:
        spans.append((-way * edge, start, first))
    return [(rows.place(begin, at), rows.place(end, at)) for begin, end, at in spans if begin != end]


def beside(likely: HolePrior, rows: Rows) -> int:
    """Return the number of strokes, on each side of the first, that cover the likely place of the hole."""
    return max(math.ceil(GATE * likely.deviation[1 - rows.fast] / rows.pitch - 0.5), 0)


def _clipped(likely: HolePrior, middle: Point, rows: Rows) -> Point:
    """Return the likely place along and across the strokes, from the middle of the area and clipped to it, m."""
    place = [min(max(m - c, -h), h) for m, c, h in zip(likely.mean, middle, rows.half, strict=True)]
    return place[rows.fast], place[1 - rows.fast]


def tour(strokes: Sequence[Stroke], speed: float, then: Left) -> Tour:
    """Return the path of strokes at one speed, joined by turns, and then the rest of another path."""
    legs: list[Leg] = []
    here: tuple[Point, Point] | None = None
    for begin, end in strokes:
        span = max(math.dist(begin, end) / speed, 1e-3)
        velocity = ((end[0] - begin[0]) / span, (end[1] - begin[1]) / span)
        if here is not None and here != (begin, velocity):
            legs += _joined(_end(legs), here, (begin, velocity), speed)
        legs.append(Leg(_end(legs), span, (begin, end), (velocity, velocity)))
        here = end, velocity
    if here is not None:
        point, rate = then.path.at(then.since)
        legs += _joined(_end(legs), here, (_pair(point), _pair(rate)), speed)
    return Tour(tuple(legs), then)


def _joined(began: float, here: tuple[Point, Point], there: tuple[Point, Point], speed: float) -> Iterator[Leg]:
    """Yield the pieces from one point and velocity to another: one turn, or, if the distance is large, a stop, a straight
    line and a start.
    """
    span = 1.5 * math.dist(here[0], there[0]) / speed
    if span <= 2.0 * TURN_TIME:
        yield Leg(began, max(span, TURN_TIME), (here[0], there[0]), (here[1], there[1]))
        return
    stop, still = TURN_TIME / 2, (0.0, 0.0)
    left, reached = _ahead(here, stop / 2), _ahead(there, -stop / 2)
    span = max(1.5 * math.dist(left, reached) / speed, TURN_TIME)
    yield Leg(began, stop, (here[0], left), (here[1], still))
    yield Leg(began + stop, span, (left, reached), (still, still))
    yield Leg(began + stop + span, stop, (reached, there[0]), (still, there[1]))


def _ahead(place: tuple[Point, Point], time: float) -> Point:
    (x, y), (u, v) = place
    return x + u * time, y + v * time


def _end(legs: Sequence[Leg]) -> float:
    return legs[-1].began + legs[-1].duration if legs else 0.0


def _pair(vector: Vector) -> Point:
    return float(vector[0]), float(vector[1])
