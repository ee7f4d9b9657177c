"""Calibration of the taxels' gains and the pads' point spread from a sweep of a long rod over known angles; pure.

The model is that of the templates. At every angle, the load of each finger is a constant plus a part that rises along
the rod. A taxel's reading is its gain times the template of that angle. For each candidate of the point spread, loads and
gains are fitted alternately by linear least squares. The result is the point spread with the least residual, interpolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.parts import Peg
from drivers.quantities import Mask, Vector
from drivers.skin.layout import Layout, positions
from skills.tactile.templates import TemplateParams, make_templates

SPREADS = np.arange(0.6e-3, 2.41e-3, 0.2e-3)
"""Point spreads to try, m. Source: chosen, not measured."""
ROUNDS = 20
LEAST_SIGNAL = 0.3
"""Least peak of a taxel's template readings, fraction of the largest peak of all taxels; below it the gain is not fitted."""

END = 3e-3
"""Distance from a pad's ends within which the end of the rod's groove affects the taxels, m. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class SkinGains:
    """Result of the fit to a sweep."""

    gains: Vector
    """Gain of each taxel, shape (2, taxels); the measured gains have mean 1 on each finger, the others are 1."""
    measured: Mask
    """True for each taxel whose gain was measured, shape (2, taxels)."""
    point_spread: float
    """Standard deviation of the elastomer's point spread, m."""
    residual: float
    """RMS of the residual over RMS of the readings, fraction."""


def rod_angles(step: float) -> Vector:
    """Return angles over half a turn, rad, that are multiples of `step`, rad."""
    angles: Vector = np.arange(round(np.pi / step), dtype=np.float64) * step - np.pi / 2
    return angles


def fit_gains(
    angles: Sequence[float], readings: Vector, trusted: Mask, rod: Peg, layout: Layout, spreads: Vector = SPREADS
) -> SkinGains:
    """Return gains and point spread.

    Args:
        angles: Angles of the rod in the hand, shape (n,), rad, multiples of the templates' step of half a degree.
        readings: Mean readings at each angle, counts above the baseline, shape (n, 2, taxels).
        trusted: Mask of the taxels trusted throughout the sweep, shape (2, taxels).
        rod: The rod, long enough to cross the whole pad, held at its middle.
        layout: Layout of the taxels.
        spreads: Point spreads to try, evenly spaced, m.

    Raises:
        ValueError: There are fewer than four angles, or no touch.
    """
    if len(angles) < 4 or not (readings[:, trusted] > 0.0).any():
        raise ValueError(f"{len(angles)} angles, no touch in them or fewer than 4: no sweep")
    fits = [_fit(np.asarray(angles), readings, trusted, rod, layout, float(spread)) for spread in spreads]
    left = np.array([residual for _, _, residual in fits])
    best = int(left.argmin())
    spread = float(spreads[best])
    if 0 < best < len(fits) - 1:
        # Vertex of the parabola through the squared residuals b, a, c at s - h, s, s + h: s + h/2 (b - c) / (b - 2a + c)
        before, at, after = left[best - 1 : best + 2] ** 2
        spread += 0.5 * float((before - after) / (before - 2 * at + after)) * float(spreads[1] - spreads[0])
    gains, measured, residual = fits[best]
    # At the pad's ends the model is least accurate, with the same error at both ends of both fingers. The gains there are
    # therefore divided by their mean, so that only the differences between them count.
    along = np.abs(positions(layout)[:, 0])
    at_end = measured & (along > along.max() - END)
    if at_end.any():
        gains[at_end] /= gains[at_end].mean()
    return SkinGains(gains, measured, spread, float(residual))


def _fit(
    angles: Vector, readings: Vector, trusted: Mask, rod: Peg, layout: Layout, spread: float
) -> tuple[Vector, Mask, float]:
    params = TemplateParams().model_copy(update={"blur": spread, "offset_step": 2e-3, "offset_reach": 4e-3})
    templates = make_templates(layout, rod, params)
    centre = int(np.abs(templates.offset).argmin())
    step = float(templates.theta[1] - templates.theta[0])
    index = np.rint((angles - templates.theta[0]) / step).astype(int) % len(templates.theta)
    shape = readings.shape
    model = np.stack(
        [templates.even[0, index, centre].reshape(shape), templates.rising[0, index, centre].reshape(shape)]
    )
    signal = model[0].max(axis=0)
    measured = trusted & (signal > LEAST_SIGNAL * signal.max())
    gains = np.ones(shape[1:])
    predicted = np.zeros(shape)
    for _ in range(ROUNDS):
        for finger in range(shape[1]):
            use = measured[finger]
            for k in range(len(angles)):
                # Loads at angle k: min |y - g (a even + b rising)|²
                basis = (model[:, k, finger] * gains[finger])[:, use].T
                load = np.linalg.lstsq(basis, readings[k, finger, use], rcond=None)[0]
                predicted[k, finger] = load @ model[:, k, finger]
            # Gain of each taxel: min |y - g m|² over all angles, g = sum(m y) / sum(m²), scaled to mean 1
            power = (predicted[:, finger] ** 2).sum(axis=0)
            fitted = (predicted[:, finger] * readings[:, finger]).sum(axis=0) / np.maximum(power, 1e-9)
            gains[finger, use] = fitted[use] / fitted[use].mean()
    missed = (readings - gains * predicted)[:, measured]
    scale = np.linalg.norm(readings[:, measured])
    return gains, measured, float(np.linalg.norm(missed) / scale)
