"""Trace of the present run, thinned out for a page, and the present touch image; pure."""

import math
from collections import deque
from collections.abc import Iterable

import numpy as np

from cell.run.live import Look
from skills.catalogue import CATALOGUE

STEP = 0.05
"""Least time between two points of a trace on the cell's clock, s."""
POINTS = 2400
"""Largest number of points of a run, two minutes at `STEP`; of a longer run the newest are kept."""
NAMES = ("time", "force", "depth", "x", "y", "theta", "sigma", "stage")
"""Values of a point: s since the first scan of the run, N, m below the surface, m, m, rad, rad, number of the stage.

In stages whose time does not count, the depth is None, because they work away from the hole.
"""
DIGITS = (2, 2, 6, 6, 6, 4, 4, 0)

Point = list[float | None]
"""Values of `NAMES`; None for a missing one."""


class Traces:
    """Force, depth, position and angle over time, of the present run or the last one."""

    def __init__(self) -> None:
        """Start empty."""
        self.run = 0
        """Number of the run in the journal."""
        self.points: deque[Point] = deque(maxlen=POINTS)
        self._start = self._last = 0.0

    def add(self, looks: Iterable[Look]) -> list[Point]:
        """Add looks, oldest first, and return the new points; a new run clears the earlier points."""
        added: list[Point] = []
        for look in looks:
            stamp = look.seen.stamp
            if look.run == 0:
                continue
            if look.run != self.run:
                self.run, self._start, self._last = look.run, stamp, -math.inf
                self.points.clear()
                added.clear()
            if stamp - self._last >= STEP - 1e-9:
                self._last = stamp
                added.append(_point(look, stamp - self._start))
        self.points.extend(added)
        return added


def _point(look: Look, time: float) -> Point:
    seen, peg = look.seen, look.seen.peg
    force = math.sqrt(float(seen.arm.wrench.force @ seen.arm.wrench.force))
    x, y, z = seen.tip.tolist()
    angle = (peg.theta, peg.sigma) if peg.healthy else (math.nan, math.nan)
    depth = look.surface - z if look.stage in CATALOGUE.counted else math.nan
    values = (time, force, depth, x, y, *angle, float(CATALOGUE.stage_number(look.stage)))
    return [_number(value, digits) for value, digits in zip(values, DIGITS, strict=True)]


def touch(look: Look) -> dict[str, object]:
    """Return both fingers' readings, the estimated angle of the peg and the joint positions, for a page to draw."""
    seen = look.seen
    frame, peg = seen.frame, seen.peg
    return {
        "values": np.rint(frame.values).astype(int).tolist(),
        "trusted": frame.trusted.astype(int).tolist(),
        "frame": frame.sequence,
        "age": _number(seen.stamp - frame.stamp, 3),
        "theta": _number(peg.theta, 4) if peg.healthy else None,
        "sigma": _number(peg.sigma, 4) if peg.healthy else None,
        "theta_age": _number(seen.stamp - peg.stamp, 3),
        "width": _number(seen.gripper.width, 5),
        "joints": seen.arm.q.round(4).tolist(),
        "switch": seen.switch.name.lower(),
    }


def _number(value: float, digits: int) -> float | None:
    """Return a number rounded to `digits`; None if it is not finite, because JSON cannot express it."""
    return round(value, digits) if math.isfinite(value) else None
