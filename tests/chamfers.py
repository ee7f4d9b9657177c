"""How deep a round peg is in a plate, by dense samples of the surfaces of both: an oracle that shares nothing with the contact code."""

from collections.abc import Callable

import numpy as np

from drivers.part.round import Round

SLANT = np.sqrt(0.5)
HEIGHT = 0.02
"""Height of the peg that is sampled, m."""


def penetration(peg: Round, hole: Round, axes: np.ndarray, place: np.ndarray) -> float:
    """Return the largest depth of a point of the peg in the plate, or of the plate in the peg, m; negative for a gap.

    Args:
        peg: Cross-section of the peg.
        hole: Cross-section of the hole, whose floor is out of reach.
        axes: Axes of the peg, z from its end upward, shape (3, 3).
        place: Middle of the peg's end, shape (3,), m, from the hole's mouth.
    """

    def in_plate(x: np.ndarray) -> np.ndarray:
        p = axes @ x + place[:, None]
        rho = np.hypot(p[0], p[1])
        faces = [-p[2], rho - hole.reach]
        if hole.chamfer > 0.0:
            faces.append(SLANT * (rho - hole.reach - hole.chamfer - p[2]))
        depth: np.ndarray = np.min(faces, axis=0)
        return depth

    def in_peg(x: np.ndarray) -> np.ndarray:
        q = axes.T @ (x - place[:, None])
        side = peg.reach - np.hypot(q[0], q[1])
        faces = [side, q[2]]
        if peg.chamfer > 0.0:
            faces.append(SLANT * (side - peg.chamfer + q[2]))
        depth: np.ndarray = np.min(faces, axis=0)
        return depth

    rims = {(peg.reach - peg.chamfer, 0.0), (peg.reach, peg.chamfer)}
    edges = {(hole.reach + hole.chamfer, 0.0), (hole.reach, -hole.chamfer)}
    found = [_most(in_plate, circle) for circle in rims] + [_most(in_peg, circle) for circle in edges]
    for share in np.linspace(0.0, 1.0, 9):
        # Lines between the circles, and up the peg's side and down the bore.
        radius, height = peg.reach - (1.0 - share) * peg.chamfer, share * peg.chamfer
        found += [_most(in_plate, (radius, height)), _most(in_plate, (peg.reach, peg.chamfer + share**2 * HEIGHT))]
        radius, height = hole.reach + (1.0 - share) * hole.chamfer, -share * hole.chamfer
        found += [_most(in_peg, (radius, height)), _most(in_peg, (hole.reach, -hole.chamfer - share**2 * HEIGHT))]
    return max(found)


def _most(depth: Callable[[np.ndarray], np.ndarray], circle: tuple[float, float]) -> float:
    """Return the largest depth on a circle, given by radius and height, m: of 720 points, and of 400 about the deepest one."""
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    for _ in range(2):
        deep = depth(np.array([circle[0] * np.cos(angle), circle[0] * np.sin(angle), np.full(angle.size, circle[1])]))
        middle, step = angle[deep.argmax()], angle[1] - angle[0]
        angle = np.linspace(middle - step, middle + step, 401)
    return float(deep.max())
