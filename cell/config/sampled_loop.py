"""Stability limit of the gains of an impedance loop with sampled errors, by exact discretisation; pure.

The tip obeys M x'' = -K x(t_k) - C x - D x', as in [gibbons], Eq. (6). The error of Eq. (5) is measured every `period`
seconds, late by `delay` periods, and held in between; C x is the part measured without delay. Between two frames this is
a linear system under a constant force, so one period is one matrix. The loop is stable if the eigenvalues of this matrix
are inside the unit circle.
"""

import math
from collections.abc import Callable

import numpy as np

from drivers.quantities import Vector

Loop = tuple[Vector, Vector, Vector, Vector]
"""Inertia, stiffness on the held error, stiffness on the present error, damping, each shape (n, n)."""

MOST = 1e6
"""Factor above which a gain counts as unlimited."""


def one_period(
    inertia: Vector, held: Vector, continuous: Vector, damping: Vector, period: float, delay: float
) -> Vector:
    """Return the transition matrix of the loop from one frame to the next.

    Args:
        inertia: M, shape (n, n), kg and kg·m².
        held: K, stiffness on the error held from frame to frame, shape (n, n), N/m and N·m/rad.
        continuous: C, stiffness on the present error, shape (n, n), N/m and N·m/rad.
        damping: D, shape (n, n), N·s/m and N·m·s/rad.
        period: Time between frames, s.
        delay: Age of a frame at its first use, in periods, >= 0, fractions included.

    Returns:
        Matrix over position, velocity and the positions of earlier frames, shape (m, m), m = (3 + floor(delay)) n.
    """
    n = len(inertia)
    flow = np.zeros((3 * n, 3 * n))  # d/dt [x, x', x_held] = flow [x, x', x_held]
    flow[:n, n : 2 * n] = np.eye(n)
    flow[n : 2 * n] = np.linalg.solve(inertia, -np.hstack([continuous, damping, held]))
    whole = math.floor(delay)
    early, late = (exponential(flow * part * period) for part in (delay - whole, 1.0 - (delay - whole)))
    # The state is position and velocity, then the positions at frame k-1, k-2, ...
    places = [slice(0, n), *(slice((2 + j) * n, (3 + j) * n) for j in range(whole + 1))]
    step = np.zeros(((3 + whole) * n,) * 2)
    moving = slice(0, 2 * n)
    step[moving, moving] = late[moving, moving] @ early[moving, moving]
    step[moving, places[whole + 1]] += late[moving, moving] @ early[moving, 2 * n :]
    step[moving, places[whole]] += late[moving, 2 * n :]
    for older, newer in zip(places[1:], places, strict=False):
        step[older, newer] = np.eye(n)
    return step


def radius(step: Vector) -> float:
    """Return the largest magnitude of the eigenvalues; below 1 the loop is stable."""
    return float(np.abs(np.linalg.eigvals(step)).max())


def largest_factor(loop: Callable[[float], Loop], period: float, delay: float) -> float:
    """Return the factor on a gain at which the loop becomes unstable.

    Args:
        loop: Inertia, held and continuous stiffness and damping at a factor, as in `one_period`.
        period: Time between frames, s.
        delay: Age of a frame at its first use, in periods.

    Returns:
        Factor at the limit, from `first_unstable`.
    """
    return first_unstable(lambda factor: radius(one_period(*loop(factor), period, delay)) < 1.0)


def first_unstable(is_stable: Callable[[float], bool], most: float = MOST) -> float:
    """Return the factor at the limit of stability; `most` if there is no limit below it, 0 if 1e-3 is already unstable."""
    growth = 1.25  # Ratio of neighbouring factors in the search for the limit.
    high = 1e-3
    if not is_stable(high):
        return 0.0
    while is_stable(high):
        high *= growth
        if high > most:
            return most
    low = high / growth
    # Relative accuracy of the limit.
    while high / low > 1.0 + 1e-4:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if is_stable(middle) else (low, middle)
    return low


def exponential(matrix: Vector) -> Vector:
    """Return the exponential of a square matrix by scaling, a Taylor series and squaring."""
    size = float(np.abs(matrix).sum(axis=1).max())
    halvings = max(0, math.ceil(math.log2(max(size, 1e-300))) + 4)
    scaled = matrix / 2.0**halvings
    term = total = np.eye(len(matrix))
    # Twelve terms of the exponential series are enough for a matrix scaled below 1/16.
    for k in range(1, 13):
        term = term @ scaled / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total
