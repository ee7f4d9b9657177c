"""The readings of all taxels under a line of load, compiled: the sums that `skills.tactile.templates` tabulates once.

The module stands apart so that modules which only name the estimators, as the config and the register map do, import no
compiler.
"""

import math

from drivers.compiled import njit

HALF_LINE = 0.02
"""Distance from the finger centre at which a load of unit rise has grown by 1, m."""
FAR = 25.0
"""Squared distance beyond which a line of load is not felt, in squared standard deviations of the blur."""


@njit(cache=True)
def fill(  # type: ignore[no-untyped-def] # noqa: C901  compiled nested loops over one sum
    theta,
    offset,
    taxels,
    half_length,
    half_width,
    tip,
    back,
    disc,
    disc_weights,
    groove,
    groove_weights,
    blur,
    even,
    rising,
):
    """Fill in the readings of all taxels for every angle and offset, in units of the load over 2·sqrt(2 pi)·blur."""
    scale = 1.0 / (blur * math.sqrt(2.0))
    for i in range(theta.size):
        c, s = math.cos(theta[i]), math.sin(theta[i])
        for j in range(offset.size):
            low, high = -back, tip
            for start, step, half in ((-offset[j] * s, c, half_length), (offset[j] * c, s, half_width)):
                if abs(step) > 1e-9:
                    low = max(low, -start / step - abs(half / step))
                    high = min(high, -start / step + abs(half / step))
                elif abs(start) > half:
                    high = low
            if high <= low:
                continue
            for k in range(taxels.shape[0]):
                constant, slope = 0.0, 0.0
                for m in range(disc.shape[0]):
                    x, y = taxels[k, 0] + disc[m, 0], taxels[k, 1] + disc[m, 1]
                    along, beside = c * x + s * y, c * y - s * x - offset[j]
                    spread = 0.0
                    for g in range(groove.size):
                        square = ((beside - groove[g]) / blur) ** 2
                        if square < FAR:
                            spread += groove_weights[g] * math.exp(-0.5 * square)
                    if spread == 0.0:
                        continue
                    to_high, to_low = (high - along) * scale, (low - along) * scale
                    area = math.erf(to_high) - math.erf(to_low)
                    bend = (math.exp(-to_high * to_high) - math.exp(-to_low * to_low)) / (scale * math.sqrt(math.pi))
                    constant += disc_weights[m] * spread * area
                    slope += disc_weights[m] * spread * (along * area - bend)
                even[i, j, k] = constant
                rising[i, j, k] = slope / HALF_LINE
