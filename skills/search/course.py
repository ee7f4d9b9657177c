"""The course of a search: where the tip goes and how the peg is held on the way; pure but for its random draws."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drivers.parts import Job
from drivers.quantities import Vector
from skills.paths import TURN_TIME, Lanes, lanes
from skills.search.belief import Belief
from skills.search.decoys import Decoy
from skills.search.params import SpraySearchParams
from skills.search.tour import Left, Path, Rows, Stroke, first_look, outwards, tour

MOST_LOOKS = 5
"""Number of strokes beyond which the likely place is so wide that the search begins with whole lanes."""
SURE = 2.0
"""Standard deviations that one stroke has to cover to either side for the search to go on from its end, and not to sweep
the same length once more on the area's own lanes."""
ANYWHERE = Belief()
"""Distribution of the hole's place if only the area is known."""
STEP = 0.01
"""Step along the path in which the end of a decoy is looked for, s. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Where the tip goes, how the peg is held on the way, and the decoys that it passes over."""

    path: Path
    middle: Vector
    """Middle of the area for the tip, shape (2,), m, base frame."""
    surface: float
    """Height of the plate's stated surface, m, base frame."""
    height: float
    """Height above that surface from which the tip comes down, m."""
    axis: Vector
    """Axis of the peg, unit, shape (3,), base frame."""
    closing: Vector
    """Closing axis of the hand, unit, shape (3,), base frame."""
    fast: int
    """Axis of the base frame that is swept fast, 0 or 1."""
    likely_until: float
    """Time along the path up to which the peg comes by where the hole is likely, s; 0 where that is nowhere."""
    lowest: Vector
    """Lowest point of the leaning peg with its tip at the path's middle, shape (2,), m, base frame."""
    cover: float
    """Time in which the path covers the area once, s; a hole that was taken for a decoy is tried again after it."""
    until: float
    """Time along the path until which the decoys are passed over, s."""
    decoys: tuple[Decoy, ...]
    """Decoys that are passed over."""
    since: float = 0.0
    """Time along the path at which the peg comes down, s."""

    @property
    def first(self) -> Vector:
        """Place from which the tip comes down, shape (3,), m, base frame."""
        return np.array([*(self.middle + self.path.at(self.since)[0]), self.surface + self.height])

    def passing(self, decoy: Decoy, time: float) -> "Course":
        """Return the course with one more decoy, found at a `time` along the path, s."""
        return replace(self, decoys=(*self.decoys, decoy), until=time + self.cover)

    def down_from(self, time: float) -> "Course":
        """Return the course on which the peg comes down at the first time from `time`, s, on at which it is in no decoy."""
        return replace(self, since=self.beyond(time))

    def beyond(self, time: float) -> float:
        """Return the first time along the path from `time` on at which the peg is outside every decoy, s."""
        while self.decoys and time < self.until and self._is_in_decoy(self.path.at(time)[0] + self.lowest):
            time += STEP
        return time

    def _is_in_decoy(self, lowest: Vector) -> bool:
        return any(math.dist(lowest, decoy.place) < decoy.radius for decoy in self.decoys)


def make_course(
    params: SpraySearchParams,
    job: Job,
    rng: np.random.Generator,
    belief: Belief = ANYWHERE,
    is_length_known: bool = True,
) -> Course:
    """Return the course over the area: lanes from the corner next to a random point of it, drawn by the middle of the band in
    which the leaning edge falls.

    Where the hole is likely somewhere, short strokes over that place come first, and the area follows from there outwards.

    Args:
        params: Parameters of the search.
        job: The part and the area.
        rng: Draws the point, and how far beyond the area, or the likely place, the first lane begins.
        belief: Likely place of the hole, and the rest of the path of earlier attempts.
        is_length_known: Whether the peg in the hand has touched the plate before; a search that is the first comes down from higher.
    """
    hole, part = job.hole, job.peg.part
    fast, pitch = 0 if params.fast_axis == "x" else 1, params.pitch * hole.part.inscribed
    half = [extent / 2 + params.margin[0 if axis == fast else 1] for axis, extent in enumerate(hole.area)]
    start = rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2)
    over, begin = (half[0], half[1]), (start[0], start[1])
    outside = hole.part.reach + hole.part.chamfer + rng.uniform(*params.outside)
    whole = lanes(over, pitch, params.speed, fast, begin, max(outside - params.margin[0], 0.0))
    # Strokes end where their turns begin, which reach as far as those of the lanes.
    ends = [extent - params.speed * TURN_TIME / 4.0 if axis == fast else extent for axis, extent in enumerate(over)]
    rows = Rows((max(ends[0], 0.0), max(ends[1], 0.0)), fast, pitch, params.speed)
    path, likely_until = _as_believed(belief, job, rows, whole, outside, math.copysign(1.0, begin[fast]))
    axis, closing = part.leaning(params.tilt_azimuth, params.tilt)
    azimuth = part.azimuth(params.tilt_azimuth)
    ahead = leading(part.reach, params.tilt, params.fall)
    middle = np.array(hole.centre[:2]) - ahead * np.array([math.cos(azimuth), math.sin(azimuth)])
    return Course(
        path=path,
        middle=middle,
        surface=hole.centre[2],
        height=params.first_height(part.reach, is_length_known),
        axis=axis,
        closing=closing,
        fast=fast,
        likely_until=likely_until,
        lowest=part.lowest(np.array([*middle, 0.0]), axis, closing)[:2],
        cover=whole.cover,
        # A hole that was taken for a decoy is tried again once the rest of the area has been covered.
        until=path.cover or whole.cover,
        decoys=belief.decoys,
    ).down_from(0.0)


def leading(reach: float, tilt: float, fall: float) -> float:
    """Return the distance from the middle of the peg's end to the middle of the band in which the peg falls, m, along the tilt's azimuth.

    A lowest point at a depth h = `fall` has the peg's side h tan(tilt) ahead of it where it leaves the hole's mouth, and may lie no
    nearer to the rim there; the end face cuts the mouth's plane h / tan(tilt) behind it, along a chord that is
    h / sin(tilt) high, and may lie no nearer to the rim on the other side. The band, as wide as a hole as tight as the peg leaves it,
    therefore lies off the lowest point by half of what these sum up to, (h / 2) (1 / tan(tilt / 2) - tan(tilt)).

    Args:
        reach: Largest distance of a point of the peg's end from its axis, m.
        tilt: Tilt of the peg from the vertical, rad.
        fall: Depth at which the lowest point counts as in the hole, m.
    """
    off = fall / 2.0 * (1.0 / math.tan(tilt / 2.0) - math.tan(tilt)) if tilt > 0.0 else 0.0
    return reach * math.cos(tilt) - min(off, reach)


def _as_believed(belief: Belief, job: Job, rows: Rows, whole: Lanes, outside: float, way: float) -> tuple[Path, float]:
    """Return the path that a belief asks for, and the time along it up to which the hole is likely, s; `whole` is the one without a belief."""
    left, width, likely = belief.left, job.hole.part.inscribed, belief.likely
    if likely is None:
        if left is None:
            return whole, 0.0
        # Down beside the place where the peg was tried last, and not into it; decoys are passed over anyway.
        beside = 0.0 if belief.decoys else 1.5 * width / rows.speed
        return tour([], rows.speed, Left(left.path, left.since + beside)), 0.0
    middle = job.hole.centre[:2]
    looks = first_look(likely, middle, rows, width, outside, way)
    if left is not None:
        return tour(looks, rows.speed, left), _time(looks, rows)
    # One stroke right through the likely place is a small price where the hole is somewhere else; several are not.
    (begin, end), looks = looks[0], looks[:1] if len(looks) <= MOST_LOOKS else []
    is_enough = SURE * likely.deviation[1 - rows.fast] <= rows.pitch / 2
    start = end if is_enough else begin
    # What all the strokes have missed lies between them: a second cover of lanes begins half a pitch off.
    then = Left(whole, whole.cover)
    strokes = [*looks, *outwards(likely, middle, rows, start[rows.fast], way)]
    return tour(strokes, rows.speed, then), _time(looks, rows)


def _time(strokes: Sequence[Stroke], rows: Rows) -> float:
    """Return the time along strokes, s."""
    return sum(math.dist(*stroke) for stroke in strokes) / rows.speed
