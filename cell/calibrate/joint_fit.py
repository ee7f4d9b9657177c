"""Friction and gravity residual of a joint, from its torques at constant speed in both directions; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cell.records.statistics import student
from drivers.arm.learning import DRY_RATE, SMOOTH_RATE
from drivers.quantities import Vector

ROTOR = 0.3
"""Assumed inertia of a rotor, which the arm's model lacks, and its equally large uncertainty, kg·m²; published values are 0 to 0.61, see `config/arms/fr3.toml`."""


@dataclass(frozen=True, slots=True)
class Pass:
    """Mean of one pass of one joint at constant speed."""

    speed: float
    """Commanded velocity, rad/s, with the sign of its direction."""
    rate: float
    """Measured velocity of the joint, rad/s."""
    torque: float
    """Torque of the joint beyond the arm's model, N·m."""
    drift: float = 0.0
    """Acceleration during the pass, rad/s²; it causes rotor torque, which is not in the model."""


@dataclass(frozen=True, slots=True)
class JointFit:
    """Dry friction, friction that grows with speed, and offset of one joint, each with half the width of its 95 % interval, N·m."""

    dry: tuple[float, float]
    smooth: tuple[float, float]
    offset: tuple[float, float]
    friction: tuple[tuple[float, float], ...]
    """Friction at each speed."""


def fit(passes: Sequence[Pass], speeds: Sequence[float]) -> JointFit:
    """Return the figures of one joint from its passes.

    For any friction law, the friction at a speed is half the difference of the mean torques in the two directions. The
    offset is half the sum of these torques, averaged over the speeds. The estimated rotor torque of the acceleration in a pass is
    subtracted, and the same amount is added to the interval. Dry and smooth friction are fitted to the passes, both >= 0.

    Args:
        passes: Passes at each of the speeds, at least two in each direction.
        speeds: Speeds for which friction is returned, rad/s.
    """
    passes = [replace(each, torque=each.torque - ROTOR * each.drift) for each in passes]
    groups = {(s, sense): [p.torque for p in passes if p.speed == sense * s] for s in speeds for sense in (-1.0, 1.0)}
    dry, smooth = _levels(passes, float(np.mean([*map(np.mean, groups.values())])))
    error = _error([*groups.values()])
    frictions = tuple(
        _friction([p for p in passes if abs(p.speed) == speed], smooth[0], speed, error) for speed in speeds
    )
    middles = [0.5 * (float(np.mean(groups[s, 1.0])) + float(np.mean(groups[s, -1.0]))) for s in speeds]
    offset = float(np.mean(middles))
    apart = student(len(speeds) - 1) * float(np.std(middles, ddof=1)) / math.sqrt(len(speeds))
    return JointFit(dry, smooth, (offset, _interval(offset, apart)), frictions)


def _error(groups: Sequence[Sequence[float]]) -> float:
    """Return the half width of the interval of a single pass, N·m, from the scatter within groups of like passes."""
    freedom = sum(len(group) - 1 for group in groups)
    scatter = math.sqrt(sum(float(np.var(group)) * len(group) for group in groups) / freedom)
    return student(freedom) * scatter


def _friction(passes: Sequence[Pass], smooth: float, speed: float, error: float) -> tuple[float, float]:
    """Return the friction of the passes at one speed with its interval, N·m.

    Args:
        passes: Passes at this speed in both directions.
        smooth: Level of the smooth friction, N·m.
        speed: Commanded speed, rad/s.
        error: Half width of the interval of a single pass, N·m, from the scatter of all passes.
    """
    back, there = ([each.torque for each in passes if each.speed * sense > 0.0] for sense in (-1.0, 1.0))
    drift = float(np.mean([each.drift * math.copysign(1.0, each.speed) for each in passes]))
    had = float(np.mean([abs(each.rate) for each in passes]))
    # If a joint was slightly slower than commanded, the fitted curve corrects its torque to the commanded speed.
    slower = smooth * (math.tanh(speed / SMOOTH_RATE) - math.tanh(had / SMOOTH_RATE))
    half = 0.5 * (float(np.mean(there)) - float(np.mean(back))) + slower
    statistical = 0.5 * error * math.sqrt(1 / len(there) + 1 / len(back))
    return half, _interval(half, math.hypot(statistical, ROTOR * drift))


def _levels(passes: Sequence[Pass], offset: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the best-fit levels of dry and smooth friction for a given offset, N·m, each with its interval."""
    rates, torques = np.array([p.rate for p in passes]), np.array([p.torque for p in passes]) - offset
    rows = np.column_stack([np.tanh(rates / DRY_RATE), np.tanh(rates / SMOOTH_RATE)])
    used, values, spread = [0, 1], np.zeros(2), np.zeros((2, 2))
    found, covariance = _least_squares(rows, torques)
    if found.min() < 0.0:
        used = [int(np.argmax(found))]
        found, covariance = _least_squares(rows[:, used], torques)
    values[used] = np.maximum(found, 0.0)
    spread[np.ix_(used, used)] = covariance
    quantile = student(len(passes) - 2)
    dry, smooth = ((float(values[k]), _interval(float(values[k]), quantile * math.sqrt(spread[k, k]))) for k in (0, 1))
    return dry, smooth


def _interval(value: float, statistical: float) -> float:
    """Return half the width of an interval, N·m, from scatter and from the resolution of the observer."""
    # A momentum observer that models neither rotors nor the delay of torques has an error of 0.03 N·m and 2 % of the value.
    return math.hypot(statistical, 0.03, 0.02 * value)


def _least_squares(rows: Vector, torques: Vector) -> tuple[Vector, Vector]:
    found, *_ = np.linalg.lstsq(rows, torques, rcond=None)
    left = torques - rows @ found
    variance = float(left @ left) / max(len(torques) - rows.shape[1], 1)
    covariance: Vector = variance * np.linalg.pinv(rows.T @ rows)
    return np.asarray(found, dtype=float), covariance
