"""The course of a search: path of the tip and attitude of the peg; pure except for its random draws."""

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
"""Largest number of short strokes over the likely place; if more are needed, the search begins with whole lanes, else with one."""
SURE = 2.0
"""Standard deviations of the likely place, to each side, that a short stroke must cover so that the next one continues
from its end. Otherwise the next stroke starts at its beginning."""
ANYWHERE = Belief()
"""Distribution of the hole's place if only the area is known."""
STEP = 0.01
"""Step along the path in the search for the end of a decoy, s. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Path of the tip, attitude of the peg, and the decoys that the path skips."""

    path: Path
    middle: Vector
    """Position of the tip at the path's middle, shape (2,), m, base frame."""
    surface: float
    """Height of the plate's stated surface, m, base frame."""
    height: float
    """Height of the tip above that surface before the descent, m."""
    axis: Vector
    """Axis of the peg, unit, shape (3,), base frame."""
    closing: Vector
    """Closing axis of the hand, unit, shape (3,), base frame."""
    fast: int
    """Axis of the base frame along which the lanes run, 0 or 1."""
    likely_until: float
    """Time along the path until which the peg is over the likely place of the hole, s; 0 if no place is more likely."""
    lowest: Vector
    """Lowest point of the leaning peg with its tip at the path's middle, shape (2,), m, base frame."""
    cover: float
    """Time in which whole lanes cover the area once, s; after it, a new decoy is tried again: it may be the hole."""
    until: float
    """Time along the path until which the decoys are skipped, s."""
    decoys: tuple[Decoy, ...]
    """Decoys that the path skips."""
    since: float = 0.0
    """Time along the path at which the peg descends to the plate, s."""

    @property
    def first(self) -> Vector:
        """Position of the tip before the descent, shape (3,), m, base frame."""
        return np.array([*(self.middle + self.path.at(self.since)[0]), self.surface + self.height])

    def passing(self, decoy: Decoy, time: float) -> "Course":
        """Return the course that also skips a decoy found at `time` along the path, s."""
        return replace(self, decoys=(*self.decoys, decoy), until=time + self.cover)

    def down_from(self, time: float) -> "Course":
        """Return the course whose descent is at the first time from `time` on, s, with the peg outside every decoy."""
        return replace(self, since=self.beyond(time))

    def beyond(self, time: float) -> float:
        """Return the first time along the path, from `time` on, at which the peg is outside every decoy, s."""
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
    """Return the course over the area: lanes that start at the corner next to a random point. The middle of the capture
    band of the leaning edge follows the lanes.

    If a place of the hole is likely, the path begins with a short stroke over it and continues outwards. In a later
    attempt, it begins with several short strokes and continues with the rest of the earlier path.

    Args:
        params: Parameters of the search.
        job: The part and the area.
        rng: Draws the point, and the distance from the area, or the likely place, to the start of the first lane.
        belief: Likely place of the hole, and the rest of the path of earlier attempts.
        is_length_known: True if the peg in the hand has touched the plate before; otherwise the descent starts higher.
    """
    hole, part = job.hole, job.peg.part
    fast, pitch = 0 if params.fast_axis == "x" else 1, params.pitch * hole.part.inscribed
    over = (hole.area[0] / 2 + params.margin, hole.area[1] / 2 + params.margin)
    start = rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2)
    begin = (start[0], start[1])
    outside = hole.part.reach + hole.part.chamfer + rng.uniform(*params.outside)
    whole = lanes(over, pitch, params.speed, fast, begin, max(outside - params.margin, 0.0))
    # Strokes are shorter by the reach of their turns, so that the turns end at the same border as those of the lanes.
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
        # After the rest of the area is covered, decoys are tried again: one of them may be the hole.
        until=path.cover or whole.cover,
        decoys=belief.decoys,
    ).down_from(0.0)


def leading(reach: float, tilt: float, fall: float) -> float:
    """Return the distance from the middle of the peg's end to the middle of the band in which the peg falls, m, along the tilt's azimuth.

    If the lowest point is at a depth h = `fall` in the hole, two points of the peg in the mouth's plane must be inside the rim:
    - the peg's side, h tan(tilt) ahead of the lowest point;
    - the end face, h / tan(tilt) behind it, along a chord at the height s = h / sin(tilt) of the face.
    At the ends of the chord, a rim with the peg's radius is nearer by s. The middle of the band is therefore behind the
    lowest point by (h / tan(tilt) + s - h tan(tilt)) / 2 = (h / 2) (1 / tan(tilt / 2) - tan(tilt)).

    Args:
        reach: Largest distance of a point of the peg's end from its axis, m.
        tilt: Tilt of the peg from the vertical, rad.
        fall: Depth at which the lowest point counts as in the hole, m.
    """
    off = fall / 2.0 * (1.0 / math.tan(tilt / 2.0) - math.tan(tilt)) if tilt > 0.0 else 0.0
    return reach * math.cos(tilt) - min(off, reach)


def _as_believed(belief: Belief, job: Job, rows: Rows, whole: Lanes, outside: float, way: float) -> tuple[Path, float]:
    """Return the path for a belief, and the time along it until which the place is likely, s; `whole` is the path without a belief."""
    left, width, likely = belief.left, job.hole.part.inscribed, belief.likely
    if likely is None:
        if left is None:
            return whole, 0.0
        # The peg descends beside the place of the last try, not into it; decoys are skipped anyway.
        beside = 0.0 if belief.decoys else 1.5 * width / rows.speed
        return tour([], rows.speed, Left(left.path, left.since + beside)), 0.0
    middle = job.hole.centre[:2]
    looks = first_look(likely, middle, rows, width, outside, way)
    if left is not None:
        return tour(looks, rows.speed, left), _time(looks, rows)
    # If the hole is elsewhere, one stroke through the likely place costs little time; many strokes cost too much.
    (begin, end), looks = looks[0], looks[:1] if len(looks) <= MOST_LOOKS else []
    is_enough = SURE * likely.deviation[1 - rows.fast] <= rows.pitch / 2
    start = end if is_enough else begin
    # If all the strokes miss the hole, it is between them: the lanes of the second cover are shifted by half a pitch.
    then = Left(whole, whole.cover)
    strokes = [*looks, *outwards(likely, middle, rows, start[rows.fast], way)]
    return tour(strokes, rows.speed, then), _time(looks, rows)


def _time(strokes: Sequence[Stroke], rows: Rows) -> float:
    """Return the time of all strokes, s."""
    return sum(math.dist(*stroke) for stroke in strokes) / rows.speed
