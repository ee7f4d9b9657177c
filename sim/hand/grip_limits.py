"""Largest loads that friction of the two pads bears on a held peg, compiled."""

import math
from typing import NamedTuple

import numpy as np

from drivers.compiled import njit
from drivers.quantities import Vector

LINE: Vector = np.array([[0.0, 1.0]])
FACE: Vector = np.array([[-math.sqrt(0.6), 5 / 18], [0.0, 8 / 18], [math.sqrt(0.6), 5 / 18]])
"""Points across a round peg and across a flat face, from -1 to 1, and their weights in a mean (Gauss-Legendre), rows of two."""


class GripLimits(NamedTuple):
    """Largest force without a moment, and largest moment without a force, that the pads' friction bears in their plane."""

    force: float
    """Largest force along the pads, in any direction, N."""
    torque: float
    """Largest moment about the closing axis through the centre of the contact, N·m."""
    middle: float
    """Centre of the contact, m along the peg from the finger centre towards its tip."""
    length: float
    """Length of the contact along the peg, m; 0 if the peg is not between the pads."""


@njit(cache=True)
def span(
    theta: float, offset: float, reach_tip: float, reach_back: float, half_length: float, half_width: float
) -> tuple[float, float]:  # pragma: no cover
    """Return the ends of the contact line on a pad, m along the peg from the finger centre; equal if the peg misses the pad.

    The arguments are those of `grip_limits`.
    """
    c, s = math.cos(theta), math.sin(theta)
    low, high = -reach_back, reach_tip
    for start, step, half in ((-offset * s, c, half_length), (offset * c, s, half_width)):
        if abs(step) > 1e-9:
            reach, middle = half / abs(step), -start / step
            low, high = max(low, middle - reach), min(high, middle + reach)
        elif abs(start) > half:
            high = low
    return low, max(low, high)


@njit(cache=True)
def grip_limits(
    theta: float,
    offset: float,
    grip_force: float,
    reach: tuple[float, float],
    half: tuple[float, float],
    friction: float,
    flat: float,
) -> GripLimits:  # pragma: no cover
    """Return the largest force and moment from friction in the pads, by Coulomb's law under uniform pressure.

    The two pads' normal forces add up to twice the grip force N, so that a force of 2·mu·N slides the peg. A moment
    rotates the peg about the centre of the contact, and each pad resists with mu·N·(integral of |r| ds)/l. For a line of
    length l, each pad resists with mu·N·l/4. A flat face consists of many such lines.

    Args:
        theta: In-hand angle, rad.
        offset: Distance of the peg's axis from the finger centre along (-sin t, cos t, 0), m.
        grip_force: Grip force of the hand, N.
        reach: Lengths of the peg from the finger centre towards its tip and towards its back end, m.
        half: Half the length and half the width of a pad, m.
        friction: Coulomb coefficient of peg on pad.
        flat: Width of a flat face, m; 0 for the line contact of a round peg.
    """
    lines = FACE if flat > 0.0 else LINE
    spans = np.empty((lines.shape[0], 2))
    length = moment = lever = 0.0
    for k in range(lines.shape[0]):
        low, high = span(theta, offset + flat / 2 * lines[k, 0], reach[0], reach[1], half[0], half[1])
        spans[k, 0], spans[k, 1] = low, high
        length += lines[k, 1] * (high - low)
        moment += lines[k, 1] * (high**2 - low**2) / 2
    if length <= 0.0:
        return GripLimits(0.0, 0.0, 0.0, 0.0)
    middle = moment / length
    for k in range(lines.shape[0]):
        beside = flat / 2 * lines[k, 0]
        lever += lines[k, 1] * (_lever(spans[k, 1] - middle, beside) - _lever(spans[k, 0] - middle, beside))
    force = 2.0 * friction * grip_force
    return GripLimits(force, force * lever / length, middle, length)


@njit(cache=True)
def _lever(s: float, offset: float) -> float:  # pragma: no cover
    """Return the integral of sqrt(s² + offset²) from 0 to s."""
    if abs(offset) < 1e-9:
        return s * abs(s) / 2
    return (s * math.hypot(s, offset) + offset**2 * math.asinh(s / abs(offset))) / 2
