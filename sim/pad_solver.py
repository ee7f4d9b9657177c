"""The equilibrium of a peg between two pads, and the pressure that each taxel sees: the compiled part of `sim.pads`."""

import math

import numpy as np

from drivers.compiled import njit
from drivers.impedance import solve
from drivers.quantities import FINGERS, Vector

CELL = 1e-3
"""Side of a cell of the grid on the pad, m."""
NEWTON_STEPS = 40
NEWTON_TOLERANCE = 1e-4
LIGHTEST = 1e-3
"""Share of the grip's own load below which loads need not be resolved by Newton's method, fraction."""
FURTHEST = 0.9
"""Largest share of the distance to the solid pad that one step may cover, fraction."""
LIFTED_SLOPE = 1e-3
"""Slope of a pad that is not touched, so that Newton's matrix has an inverse."""
SMALLEST = 1e-6
"""Shortest step, in Newton steps."""


@njit(cache=True)
def _secant(depth: float, thickness: float, exponent: float) -> float:  # pragma: no cover
    """Return what a pad answers over the depth, m, in units of the foundation; see `sim.pads`."""
    share = max(depth, 0.0) / thickness
    room = 1.0 / (1.0 - share)
    if exponent == 1.0:
        return room
    # t (x^n + x^2 / (1 - x)) over d = t x; for n = 1 it is 1 / (1 - x).
    other: float = share ** (exponent - 1.0) + share * room if share > 0.0 else 0.0
    return other


@njit(cache=True)
def _slope(depth: float, thickness: float, exponent: float) -> float:  # pragma: no cover
    """Return the derivative of the answer at a depth, m, > 0."""
    room = 1.0 / (1.0 - depth / thickness)
    if exponent == 1.0:
        return room * room
    # n x^(n-1) + 1 / (1 - x)^2 - 1
    other: float = exponent * (depth / thickness) ** (exponent - 1.0) + room * room - 1.0
    return other


@njit(cache=True)
def _energy(depth: Vector, thickness: float, exponent: float) -> float:  # pragma: no cover
    """Return the energy stored at these depths, the integral of the answer, in units of the foundation."""
    total = 0.0
    for k in range(depth.size):
        share = max(depth[k], 0.0) / thickness
        total += share + math.log1p(-share)
        if exponent != 1.0:
            # t^2 (x^(n+1) / (n+1) - x^2 / 2) beside that of n = 1.
            total -= share ** (exponent + 1.0) / (exponent + 1.0) - share * share / 2.0
    return -total * thickness**2


@njit(cache=True)
def lie(  # noqa: C901  one Newton iteration, compiled, whose loops share its arrays
    motions: Vector, wanted: Vector, start: Vector, rest: float, thickness: float, exponent: float
) -> Vector:  # pragma: no cover
    """Return the amounts of the motions at which the pads' answer, in units of the foundation, equals `wanted`.

    Args:
        motions: Depth that a unit of each motion adds at each point of both pads, shape (m, n).
        wanted: Required sums of the answers, each times its motion, shape (m,).
        start: First guess of the amounts, shape (m,).
        rest: Part of the depth that no motion changes, m.
        thickness: Depth at which a pad is solid, m.
        exponent: Exponent of the answer at small depth.
    """
    m, n = motions.shape
    amounts = start.copy()
    depth, trial, change = np.empty(n), np.empty(n), np.empty(n)
    pressed, largest = 0.0, 0.0
    for k in range(n):
        depth[k] = rest
        for i in range(m):
            depth[k] += amounts[i] * motions[i, k]
        pressed += max(depth[k], 0.0)
    energy = _energy(depth, thickness, exponent)
    for i in range(m):
        energy -= wanted[i] * amounts[i]
        largest = max(largest, abs(wanted[i]))
    enough = NEWTON_TOLERANCE * max(largest, LIGHTEST * pressed)
    matrix, missing = np.empty((m, m)), np.empty(m)
    for _ in range(NEWTON_STEPS):
        missing[:] = wanted
        matrix[:] = 0.0
        for k in range(n):
            room = _secant(depth[k], thickness, exponent)
            slope = _slope(depth[k], thickness, exponent) if depth[k] > 0.0 else LIFTED_SLOPE
            for i in range(m):
                missing[i] -= motions[i, k] * max(depth[k], 0.0) * room
                for j in range(m):
                    matrix[i, j] += motions[i, k] * slope * motions[j, k]
        if np.abs(missing).max() < enough:
            break
        move = solve(matrix, missing.copy())
        # A step covers at most the share `FURTHEST` of the way to the solid pad.
        share, gain = 0.0, 0.0
        for k in range(n):
            change[k] = 0.0
            for i in range(m):
                change[k] += move[i] * motions[i, k]
            share = max(share, change[k] / (thickness - depth[k]))
        for i in range(m):
            gain += missing[i] * move[i]
        size = min(1.0, FURTHEST / share if share > 0.0 else 1.0)
        reached = energy
        while size > SMALLEST:
            trial[:] = depth + size * change
            reached = _energy(trial, thickness, exponent)
            for i in range(m):
                reached -= wanted[i] * (amounts[i] + size * move[i])
            if reached <= energy - 1e-4 * size * gain:
                break
            size /= 2.0
        energy = reached
        amounts += size * move
        depth += size * change
    return amounts


@njit(cache=True)
def spread(
    ends: tuple[float, float],
    pressing: tuple[float, float, float],
    peg: tuple[float, float, float, bool],
    pad: tuple[float, float, float],
    cells: Vector,
    weights: Vector,
    taxels: Vector,
) -> None:  # pragma: no cover
    """Add up the pressure that each taxel sees.

    Args:
        ends: Ends of the contact line, m along the peg from the finger centre.
        pressing: delta0, u and phi, as in `Pressing`.
        peg: theta, offset, diameter or width of its face, and whether a face lies on the pads.
        pad: Stiffness of the pad's foundation, N/m², thickness, m, and exponent of its answer.
        cells: Cells of the grid, shape (n, 2), m.
        weights: Share of each cell's pressure that a taxel sees, shape (2, 20, n).
        taxels: Pressures, shape (2, 20), Pa, at zero; filled in.
    """
    low, high = ends
    delta0, u, phi = pressing
    theta, offset, width, is_flat = peg
    foundation, thickness, exponent = pad
    c, s = math.cos(theta), math.sin(theta)
    reach = width / 2.0 + CELL if is_flat else math.sqrt(width * thickness)
    for k in range(cells.shape[0]):
        along = c * cells[k, 0] + s * cells[k, 1]
        beside = c * cells[k, 1] - s * cells[k, 0] - offset
        if abs(beside) >= reach or along <= low - CELL or along >= high + CELL:
            continue
        inside = min(max((along - low) / CELL + 0.5, 0.0), 1.0) * min(max((high - along) / CELL + 0.5, 0.0), 1.0)
        for finger in range(FINGERS):
            move = u + phi * along
            depth = max(delta0 + (move if finger == 0 else -move), 0.0)
            if is_flat:
                shape = min(max((width / 2.0 - abs(beside)) / CELL + 0.5, 0.0), 1.0) / width
            else:
                # A cylinder leaves a groove of half width b, b² = d·depth, and depth·(1 - (y/b)²) across it.
                square = max(width * depth, 1e-12)
                shape = max(1.0 - beside * beside / square, 0.0) * 0.75 / math.sqrt(square)
            pressure = inside * shape * foundation * depth / (1.0 - depth / thickness)
            if exponent != 1.0:
                pressure = inside * shape * foundation * depth * _secant(depth, thickness, exponent)
            if pressure != 0.0:
                for taxel in range(taxels.shape[1]):
                    taxels[finger, taxel] += weights[finger, taxel, k] * pressure
