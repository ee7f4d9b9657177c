"""Compiled readings of all taxels under a line load; `skills.tactile.templates` tabulates them once.

The module is separate so that the config and the register map, which only name the estimators, do not import the
compiler.
"""

import math

import numpy as np

from drivers.compiled import njit

HALF_LINE = 0.02
"""Distance from the finger centre at which a load with a rise of 1 has grown by 1, m. Source: chosen, a unit."""
FAR = 25.0
"""Squared distance from a taxel beyond which a line load is neglected, in squared standard deviations of the blur."""
SURE = 4.5
"""Distance from an end of the line beyond which the end is neglected, in standard deviations times sqrt(2); the error is 2e-10."""


@njit(cache=True, inline="always")
def _end(distance):  # type: ignore[no-untyped-def]
    """Return the integral of the blur up to an end of the line, erf(u), and exp(-u²), for u = `distance`."""
    if distance > SURE:
        return 1.0, 0.0
    if distance < -SURE:
        return -1.0, 0.0
    return math.erf(distance), math.exp(-distance * distance)


@njit(cache=True, inline="always")
def _spread(beside, groove, groove_weights, blur):  # type: ignore[no-untyped-def]
    """Return the load of the blurred groove at the distance `beside` from the groove's middle, m."""
    # sum over g of w_g exp(-((beside - groove_g) / blur)² / 2)
    spread = 0.0
    for g in range(groove.size):
        square = ((beside - groove[g]) / blur) ** 2
        if square < FAR:
            spread += groove_weights[g] * math.exp(-0.5 * square)
    return spread


@njit(cache=True, nogil=True)
def fill(  # type: ignore[no-untyped-def] # noqa: C901  compiled nested loops over one sum
    theta,
    offset,
    taxels,
    half_length,
    half_width,
    tip,
    backs,
    disc,
    disc_weights,
    groove,
    groove_weights,
    blur,
    even,
    rising,
    first,
    last,
):
    """Fill in the readings of all taxels for every angle, offset and length of the line behind the finger centre (`backs`).

    The function fills the angles with index `first` to `last` - 1. If the line misses the pad, its readings stay unchanged.
    Readings are in units of the load over 2·sqrt(2 pi)·blur. `backs` must decrease, so that lines with the same end at the
    pad's edge are adjacent.
    """
    scale = 1.0 / (blur * math.sqrt(2.0))
    density = 1.0 / (scale * math.sqrt(math.pi))
    widest = 0.0  # by a loop: numpy's maximum takes the compiler seconds
    for away in groove:
        widest = max(widest, away)
    felt = widest + math.sqrt(FAR) * blur
    sums = np.empty((2, backs.size))
    for i in range(first, last):
        c, s = math.cos(theta[i]), math.sin(theta[i])
        for j in range(offset.size):
            begin, high = -math.inf, tip
            for start, step, half in ((-offset[j] * s, c, half_length), (offset[j] * c, s, half_width)):
                if abs(step) > 1e-9:
                    begin = max(begin, -start / step - abs(half / step))
                    high = min(high, -start / step + abs(half / step))
                elif abs(start) > half:
                    high = -math.inf
            if high <= max(begin, -backs[0]):
                continue
            for k in range(taxels.shape[0]):
                sums[:] = 0.0
                for m in range(disc.shape[0]):
                    x, y = taxels[k, 0] + disc[m, 0], taxels[k, 1] + disc[m, 1]
                    along, beside = c * x + s * y, c * y - s * x - offset[j]
                    to_high = (high - along) * scale
                    if to_high < -SURE or abs(beside) > felt:
                        continue
                    spread = disc_weights[m] * _spread(beside, groove, groove_weights, blur)
                    upper, at_upper = _end(to_high)
                    before, area, slope = math.nan, 0.0, 0.0
                    for b in range(backs.size):
                        low = max(begin, -backs[b])
                        if low >= high:
                            break
                        if low != before:
                            lower, at_lower = _end((low - along) * scale)
                            # area = spread (erf(u_high) - erf(u_low)), u = (end - along) scale
                            # slope = along · area - spread (exp(-u_high²) - exp(-u_low²)) / (scale sqrt(pi))
                            area = spread * (upper - lower)
                            slope = along * area - spread * (at_upper - at_lower) * density
                            before = low
                        sums[0, b] += area
                        sums[1, b] += slope
                for b in range(backs.size):
                    even[b, i, j, k], rising[b, i, j, k] = sums[0, b], sums[1, b] / HALF_LINE
