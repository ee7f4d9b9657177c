"""Meshes without a MuJoCo primitive: a plate with a hole, whole or cut open, and boxes with round edges."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from drivers.quantities import Vector


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A surface made of triangles."""

    vertices: Vector
    """Corners, shape (n, 3), m."""
    faces: NDArray[np.intp]
    """Indices of each triangle's corners, counter-clockwise seen from outside, shape (m, 3)."""


def perforated(
    outline: tuple[float, float, float, float],
    sides: Vector,
    depth: float,
    thickness: float,
    cut: bool,
    chamfer: float = 0.0,
) -> Mesh:
    """Return a plate with one blind hole whose mouth is the origin, z out of the plate.

    Args:
        outline: Edges of the plate: smallest and largest x, smallest and largest y, m; the hole lies between them.
        sides: Corners of the hole's mouth, shape (n, 2), m, counter-clockwise about the origin.
        depth: Depth of the hole's floor, m.
        thickness: Thickness of the plate, m, more than the depth.
        cut: True to cut off the part at negative y.
        chamfer: Width and depth of a chamfer at the mouth, m.
    """
    x0, x1, y0, y1 = outline
    edges = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    turns = math.pi if cut else 2.0 * math.pi
    corners = np.concatenate([edges, sides])
    angles = np.arctan2(corners[:, 1], corners[:, 0]) % (2.0 * math.pi)
    # Number of directions from the hole's centre in which outline and hole are sampled.
    rays = np.unique(np.concatenate([np.linspace(0.0, turns, 180 + 1), angles[angles < turns]]).round(9))
    if not cut:
        rays = rays[:-1]
    mouth, rim = _reached(sides, rays), _reached(edges, rays)
    wider = mouth * (1.0 + chamfer / np.linalg.norm(mouth, axis=1))[:, None]
    chamfers = [_at(wider, 0.0)] if chamfer > 0.0 else []
    rings = [
        _at(rim, -thickness),
        _at(rim, 0.0),
        *chamfers,
        _at(mouth, -chamfer),
        _at(mouth, -depth),
        np.tile([0.0, 0.0, -depth], (len(rays), 1)),
        np.tile([0.0, 0.0, -thickness], (len(rays), 1)),
    ]
    # The profile goes from ring to ring around the plate and back along the underside.
    return _lofted([*rings, rings[0]], closed=not cut)


def rounded_box(half: tuple[float, float, float], radius: float) -> Vector:
    """Return points whose convex hull is a box with round edges, shape (n, 3), m, about its centre."""
    steps = np.linspace(0.0, math.pi / 2, 7)
    ball = np.array([[math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b)] for a in steps for b in steps])
    inner = np.array(half) - radius
    octant = inner + radius * ball
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points: Vector = np.unique((signs[:, None, :] * octant).reshape(-1, 3).round(7), axis=0)
    return points


def chamfered(sides: Vector, low: float, high: float, chamfers: tuple[float, float]) -> Vector:
    """Return points whose convex hull is a prism along z with both ends chamfered, shape (n, 3), m.

    Args:
        sides: Corners of the section, shape (n, 2), m.
        low: z of the lower end, m.
        high: z of the upper end, m.
        chamfers: Widths of the chamfers at the lower end and at the upper one, m.
    """
    width = float(np.abs(sides).max())
    narrow = [sides * (1.0 - chamfer / width) for chamfer in chamfers]
    rings = [
        _at(narrow[0], low),
        _at(sides, low + chamfers[0]),
        _at(sides, high - chamfers[1]),
        _at(narrow[1], high),
    ]
    points: Vector = np.concatenate(rings)
    return points


def _at(points: Vector, height: float) -> Vector:
    return np.column_stack([points, np.full(len(points), height)])


def _reached(polygon: Vector, rays: Vector) -> Vector:
    """Return the exit points of rays from the origin, at the given angles, from a convex polygon around it, shape (n, 2), m."""
    start, way = polygon, np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([way[:, 1], -way[:, 0]])
    distance = (normal * start).sum(axis=1)
    direction = np.column_stack([np.cos(rays), np.sin(rays)])
    speed = direction @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(speed > 1e-12, distance / speed, np.inf).min(axis=1)
    points: Vector = direction * reach[:, None]
    return points


def _lofted(rings: list[Vector], closed: bool) -> Mesh:
    """Return the surface between neighbouring rings; if the rings are open, two flat ends close it, each a fan of triangles."""
    count = len(rings[0])
    faces = []
    for k in range(len(rings) - 1):
        for i in range(count if closed else count - 1):
            j = (i + 1) % count
            a, b, c, d = (k * count + i, k * count + j, (k + 1) * count + j, (k + 1) * count + i)
            faces += [(a, b, c), (a, c, d)]
    vertices = np.concatenate(rings)
    if not closed:
        for i, is_first in ((0, True), (count - 1, False)):
            profile = [k * count + i for k in range(len(rings) - 1)]
            # Order of the rings: bottom and top outside, mouth with chamfer, floor, axis below. All points of the profile
            # are visible from the first one, so that a fan from it fills the end.
            ends = [(profile[0], one, two) for one, two in pairwise(profile[1:])]
            faces += [end if is_first else end[::-1] for end in ends]
    used = np.array(faces, dtype=np.intp)
    corners = vertices[used]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Mesh(vertices, used[area > 1e-14])
