"""Where the tip goes in a search, and how the peg is held on the way; pure but for what it draws."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.parts import Job
from drivers.quantities import Vector
from skills.paths import Lanes, SprayPaint, lanes, spray_paint
from skills.search.params import SpraySearchParams

CROSSINGS = 18.5
"""Most diameters of the hole, or shorter sides, that a lane crosses in a second: what 0.15 m/s is for 8.1 mm, where few falls are missed."""
OUTSIDE = (2e-3, 4e-3)
"""The peg comes down so far from the rim of a hole at the border of the area, drawn evenly between these, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Where the tip shall go, and how the peg is held on the way."""

    path: Lanes | SprayPaint
    middle: Vector
    """Of the area, for the tip, shape (2,), m."""
    first: Vector
    """Above the path's first point, shape (3,), m."""
    axis: Vector
    """Of the peg, unit, shape (3,), base frame."""
    closing: Vector
    """Closing axis of the hand, unit, shape (3,), base frame."""
    fast: int
    """Axis of the base frame that is swept fast, 0 or 1."""


def make_course(params: SpraySearchParams, job: Job, rng: np.random.Generator) -> Course:
    """Return the way over the area: lanes from the corner next to a random point of it, sinusoids from that point.

    Args:
        params: How to search.
        job: The part and the area.
        rng: Draws the point, and for lanes how far beyond the area the first one begins.
    """
    hole, part = job.hole, job.peg.part
    fast, pitch = 0 if params.fast_axis == "x" else 1, params.pitch * hole.part.inscribed
    half = [extent / 2 + params.margin[0 if axis == fast else 1] for axis, extent in enumerate(hole.area)]
    start = rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2)
    over, begin = (half[0], half[1]), (start[0], start[1])
    path: Lanes | SprayPaint
    if params.path == "lanes":
        run_in = max(hole.part.reach + rng.uniform(*OUTSIDE) - params.margin[0], 0.0)
        path = lanes(over, pitch, min(params.speed, CROSSINGS * hole.part.inscribed), fast, begin, run_in)
    else:
        path = spray_paint(over, pitch, params.speed, fast, begin)
    axis, closing = part.leaning(params.tilt_azimuth, params.tilt)
    ahead, azimuth = part.reach * math.cos(params.tilt), part.azimuth(params.tilt_azimuth)
    middle = np.array(hole.centre[:2])
    if params.edge_leads:
        middle = middle - ahead * np.array([math.cos(azimuth), math.sin(azimuth)])
    first = np.array([*(middle + path.at(0.0)[0]), hole.centre[2] + params.height])
    return Course(path, middle, first, axis, closing, fast)
