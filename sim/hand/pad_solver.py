"""Equilibrium of a peg between two pads, and the pressure on each taxel: the compiled part of `sim.hand.pads`."""

import math

import numpy as np

from drivers.compiled import njit
from drivers.impedance import solve
from drivers.quantities import FINGERS, Vector

CELL = 1e-3
"""Side of a cell of the grid on the pad, m."""
FURTHEST = 0.9
"""Largest step of Newton's method, as a share of the remaining compression of the pad, fraction."""


@njit(cache=True)
def _secant(depth: float, thickness: float, exponent: float) -> float:  # pragma: no cover
    """Return force over depth of a pad at this depth, m, in units of the foundation; see `sim.hand.pads`."""
    share = max(depth, 0.0) / thickness
    room = 1.0 / (1.0 - share)
    if exponent == 1.0:
        return room
    # With x = d/t: t (x^n + x²/(1 - x)) / d; for n = 1 this is 1/(1 - x).
    other: float = share ** (exponent - 1.0) + share * room if share > 0.0 else 0.0
    return other


@njit(cache=True)
def _slope(depth: float, thickness: float, exponent: float) -> float:  # pragma: no cover
    """Return the derivative of a pad's force at a depth, m, > 0."""
    room = 1.0 / (1.0 - depth / thickness)
    if exponent == 1.0:
        return room * room
    # n x^(n-1) + 1/(1 - x)² - 1
    other: float = exponent * (depth / thickness) ** (exponent - 1.0) + room * room - 1.0
    return other


@njit(cache=True)
def _energy(depth: Vector, thickness: float, exponent: float) -> float:  # pragma: no cover
    """Return the energy stored at these depths, the integral of the pads' force, in units of the foundation."""
    total = 0.0
    for k in range(depth.size):
        share = max(depth[k], 0.0) / thickness
        total += share + math.log1p(-share)
        if exponent != 1.0:
            # Difference from n = 1: t² (x^(n+1)/(n + 1) - x²/2).
            total -= share ** (exponent + 1.0) / (exponent + 1.0) - share * share / 2.0
    return -total * thickness**2


@njit(cache=True)
def lie(  # noqa: C901  one Newton iteration, compiled, whose loops share its arrays
    motions: Vector, wanted: Vector, start: Vector, rest: float, thickness: float, exponent: float
) -> Vector:  # pragma: no cover
    """Return the amplitudes of the motions for which the pads' load, in units of the foundation, equals `wanted`.

    Args:
        motions: Depth per unit of each motion at each point of both pads, shape (m, n).
        wanted: Required sums of the pads' load weighted by each motion, shape (m,).
        start: Initial amplitudes, shape (m,).
        rest: Constant part of the depth, m.
        thickness: Depth at which a pad is fully compressed, m.
        exponent: Exponent of force over depth at small depth.
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
    # E(a) = sum of stored energy at depth d = rest + Mᵀa, minus wanted · a.
    energy = _energy(depth, thickness, exponent)
    for i in range(m):
        energy -= wanted[i] * amounts[i]
        largest = max(largest, abs(wanted[i]))
    # Residual load at which Newton's method ends: the factor 1e-4 is relative to the largest required load, or to 1e-3 of
    # the pads' initial load if that is larger.
    enough = 1e-4 * max(largest, 1e-3 * pressed)
    matrix, missing, move = np.empty((m, m)), np.empty(m), np.empty(m)
    for _ in range(40):
        for i in range(m):
            missing[i] = wanted[i]
            for j in range(m):
                matrix[i, j] = 0.0
        for k in range(n):
            room = _secant(depth[k], thickness, exponent)
            # Slope of an untouched pad, so that Newton's matrix is invertible.
            slope = _slope(depth[k], thickness, exponent) if depth[k] > 0.0 else 1e-3
            for i in range(m):
                # Residual r = wanted - M g(d) and Hessian H = M diag(g'(d)) Mᵀ.
                missing[i] -= motions[i, k] * max(depth[k], 0.0) * room
                for j in range(m):
                    matrix[i, j] += motions[i, k] * slope * motions[j, k]
        worst = 0.0
        for i in range(m):
            worst = max(worst, abs(missing[i]))
            move[i] = missing[i]
        if worst < enough:
            break
        solve(matrix, move)
        # A step covers at most the share `FURTHEST` of the remaining compression.
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
        # Shortest step of the line search, Newton steps.
        while size > 1e-6:
            for k in range(n):
                trial[k] = depth[k] + size * change[k]
            reached = _energy(trial, thickness, exponent)
            for i in range(m):
                reached -= wanted[i] * (amounts[i] + size * move[i])
            # Armijo's condition: E(a + s H⁻¹r) <= E(a) - 1e-4 s r·H⁻¹r.
            if reached <= energy - 1e-4 * size * gain:
                break
            size /= 2.0
        energy = reached
        for i in range(m):
            amounts[i] += size * move[i]
        for k in range(n):
            depth[k] += size * change[k]
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
    """Add up the pressure on each taxel.

    Args:
        ends: Ends of the contact line, m along the peg from the finger centre.
        pressing: delta0, u and phi, as in `Pressing`.
        peg: theta, offset, diameter or width of its face, and True if a face lies on the pads.
        pad: Stiffness of the pad's foundation, N/m², thickness, m, and exponent of force over depth.
        cells: Cells of the grid, shape (n, 2), m.
        weights: Share of each cell's pressure on a taxel, shape (2, taxels, n).
        taxels: Pressures, shape (2, taxels), Pa; must be zero before the call, filled in.
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
                # A cylinder makes a groove of half width b, b² = d·depth, with the depth profile depth·(1 - (y/b)²).
                square = max(width * depth, 1e-12)
                shape = max(1.0 - beside * beside / square, 0.0) * 0.75 / math.sqrt(square)
            # Pressure of a cell: profile(y) · k depth / (1 - depth/t), with the general exponent below.
            pressure = inside * shape * foundation * depth / (1.0 - depth / thickness)
            if exponent != 1.0:
                pressure = inside * shape * foundation * depth * _secant(depth, thickness, exponent)
            if pressure != 0.0:
                for taxel in range(taxels.shape[1]):
                    taxels[finger, taxel] += weights[finger, taxel, k] * pressure
