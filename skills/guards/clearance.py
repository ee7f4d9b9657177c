"""Clearance of hand and peg from plate and rack, checked along a free-space path before it starts; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.errors import SetpointError
from drivers.frames import cross, peg_in_finger
from drivers.parts import Job
from drivers.quantities import InHandTip, Vector

SAMPLES = 24
"""Number of points along a path at which the distance is checked, in addition to its start."""
RINGS, AROUND = 6, 12
"""Number of rings of points on the peg, and number of points on each ring."""
BALLS = 5
"""Number of balls that approximate a capsule of the hand."""
DEEP = 1.0
"""Depth of the boxes below their upper faces, m; no path can lead below such a box. Source: chosen, not measured."""
TOLERANCE = 1e-4
"""Tolerance on the clearance, m, so that rounding does not reject a path exactly at the limit. Source: chosen, not measured."""
_BALLS = np.linspace(-1.0, 1.0, BALLS)[:, None]
_ANGLES = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
_RING = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_HEIGHTS = np.linspace(0.0, 1.0, RINGS)[:, None, None]


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Solid box with faces along the base frame's axes."""

    name: str
    low: Vector
    """Lower corner, shape (3,), m, base frame."""
    high: Vector
    """Upper corner, shape (3,), m, base frame."""

    def gaps(self, points: Vector) -> Vector:
        """Return the distance of each point, shape (n, 3), m, base frame, from the box; negative inside, shape (n,), m."""
        # d = max(low - p, p - high) per axis; distance = |max(d, 0)| + min(max over axes of d, 0)
        beyond = np.maximum(self.low - points, points - self.high)
        outside = np.sqrt(np.add.reduce(np.maximum(beyond, 0.0) ** 2, axis=1))
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Attitude:
    """Position of the controlled point and orientation of the hand at one point of a path."""

    tip: Vector
    """Controlled point, shape (3,), m, base frame."""
    axis: Vector
    """Axis of the peg or of the bare hand, unit, shape (3,), base frame."""
    roll: Vector
    """Requested closing axis, not necessarily orthogonal to `axis`, shape (3,), base frame."""


def boxes_of(job: Job) -> tuple[Box, Box]:
    """Return plate and rack of the job as boxes."""
    (near, far), (least, most) = job.rack.bounds, job.hole.plate_bounds
    plate, rack = job.hole.centre[2], job.rack.first[2]
    return (
        Box("plate", np.array([*least[:2], plate - DEEP]), np.array([*most[:2], plate])),
        Box("rack", np.array([*near[:2], rack - DEEP]), np.array([*far[:2], rack])),
    )


def nearest(at: Attitude, job: Job, in_hand: InHandTip | None, boxes: Sequence[Box]) -> tuple[float, str, str]:
    """Return the least distance of hand and peg from the boxes, m, the name of the nearest part ("hand" or "peg"), and the box's name."""
    theta, length = (0.0, 0.0) if in_hand is None else (in_hand.theta, in_hand.length)
    closing = at.roll - (at.roll @ at.axis) * at.axis
    closing /= math.sqrt(float(closing @ closing))
    peg = np.array([closing, cross(at.axis, closing), at.axis]).T
    finger_peg = peg_in_finger(theta, length)
    rotation = peg @ finger_peg.rotation.T
    centre = at.tip - rotation @ finger_peg.position
    hand = job.hand
    # Closed fingers span less than open fingers; the difference is the closing distance.
    closed = 0.0 if in_hand is None else max(hand.stroke - job.peg.part.thickness, 0.0)
    capsules = (
        (hand.body_offset, hand.body_radius, hand.half_span),
        (hand.finger_offset, hand.finger_radius, hand.half_span - closed / 2),
    )
    balls = [centre + place * rotation[:, 0] + half * _BALLS * rotation[:, 2] for place, _, half in capsules]
    surface = [] if in_hand is None else [_surface(at.tip, peg, job, length)]
    points, radii = np.concatenate(balls + surface), np.repeat([radius for _, radius, _ in capsules], BALLS)
    found = []
    for box in boxes:
        gaps = box.gaps(points)
        gaps[: radii.size] -= radii
        k = int(gaps.argmin())
        found.append((float(gaps[k]), "hand" if k < radii.size else "peg", box.name))
    return min(found)


def require_clear(way: Sequence[Attitude], job: Job, in_hand: InHandTip | None, clearance: float) -> None:
    """Check the clearance of a path from plate and rack.

    If the start or the end of the path is nearer than `clearance`, for example over a slot, the smaller of their distances
    is the limit instead.

    Args:
        way: Points along the path, including its start and its end.
        job: Part, plate and rack.
        in_hand: Pose of the peg in the hand; None for the empty hand.
        clearance: Least distance, m.

    Raises:
        SetpointError: The path comes nearer than the limit; the message names part, box, distance and position.
    """
    boxes = boxes_of(job)
    seen = [nearest(at, job, in_hand, boxes) for at in way]
    least = min(clearance, seen[0][0], seen[-1][0]) - TOLERANCE
    k = min(range(len(seen)), key=lambda i: seen[i][0])
    gap, what, where = seen[k]
    if gap < least:
        x, y, z = way[k].tip
        raise SetpointError(
            f"transfer: {what} would come to {1e3 * gap:.1f} mm from the {where} with the tip at {x:.3f}, {y:.3f}, {z:.3f} m; "
            f"{1e3 * least:.1f} mm needed: raise grasp.clearance or search.height, or see rack.first and hole.centre"
        )


def _surface(tip: Vector, peg: Vector, job: Job, length: float) -> Vector:
    """Return points on the peg, shape (n, 3), m, base frame; the columns of `peg` are its axes."""
    ring = job.peg.part.reach * (_RING[:, :1] * peg[:, 0] + _RING[:, 1:] * peg[:, 1])
    heights = (length + job.peg.overhang) * _HEIGHTS
    return np.asarray((tip + heights * peg[:, 2] + ring).reshape(-1, 3))
