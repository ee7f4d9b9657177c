"""Friction and remainder of gravity of a joint, from the torques that passes to and fro took; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cell.statistics import student
from drivers.arm.learning import DRY_RATE, SMOOTH_RATE
from drivers.quantities import Vector

RESOLVED = 0.03
"""Least half width of an interval, N·m: what a momentum observer errs by where rotors and torque path are not in the model."""
RESOLVED_SHARE = 0.02
"""Share of a figure by which the observer errs beside that, fraction."""
ROTOR = 0.3
"""Inertia that a rotor may add to the model's, kg·m², and by how much it may add more or less: 0 to 0.61 are published, see `config/arms/fr3.toml`."""


@dataclass(frozen=True, slots=True)
class Pass:
    """Mean of one pass of one joint at an even speed."""

    joint: int
    """Number of the joint, from 0."""
    speed: float
    """Commanded speed, rad/s; its sign tells the sense."""
    rate: float
    """Velocity that the joint had, rad/s."""
    torque: float
    """Torque that it took beside what moves the arm's model, N·m."""
    drift: float = 0.0
    """Rate at which that velocity changed, rad/s²: rotors, which are not in the model, take torque for it."""


@dataclass(frozen=True, slots=True)
class JointFit:
    """Figures of one joint, each with half the width of its 95 % interval; N·m."""

    dry: tuple[float, float]
    smooth: tuple[float, float]
    offset: tuple[float, float]
    friction: tuple[tuple[float, float], ...]
    """Friction at each speed."""


def fit(passes: Sequence[Pass], speeds: Sequence[float]) -> JointFit:
    """Return what the passes of one joint tell.

    Friction at a speed is half the difference between the mean torques there and back, whatever its law; the offset is the mean of
    all such means. What a rotor may have taken to change its velocity during a pass is taken off, and stands in the interval as often again. Dry and smooth friction are fitted to the passes, neither less than 0.

    Args:
        passes: Passes at each of the speeds, two or more in either sense.
        speeds: Speeds whose friction is told, rad/s.
    """
    passes = [replace(each, torque=each.torque - ROTOR * each.drift) for each in passes]
    groups = {(s, sense): [p.torque for p in passes if p.speed == sense * s] for s in speeds for sense in (-1.0, 1.0)}
    freedom = sum(len(group) - 1 for group in groups.values())
    scatter = math.sqrt(sum(float(np.var(group)) * len(group) for group in groups.values()) / freedom)
    quantile = student(freedom)
    frictions, middles = [], []
    dry, smooth = _levels(passes, float(np.mean([np.mean(group) for group in groups.values()])))
    for speed in speeds:
        back, there = groups[speed, -1.0], groups[speed, 1.0]
        drift = float(
            np.mean([each.drift * math.copysign(1.0, each.speed) for each in passes if abs(each.speed) == speed])
        )
        had = float(np.mean([abs(p.rate) for p in passes if abs(p.speed) == speed]))
        # A joint that was a little slower than asked for is taken to the speed by the fitted curve.
        slower = smooth[0] * (math.tanh(speed / SMOOTH_RATE) - math.tanh(had / SMOOTH_RATE))
        half = 0.5 * (float(np.mean(there)) - float(np.mean(back))) + slower
        statistical = 0.5 * quantile * scatter * math.sqrt(1 / len(there) + 1 / len(back))
        frictions.append((half, _interval(half, math.hypot(statistical, ROTOR * drift))))
        middles.append(0.5 * (float(np.mean(there)) + float(np.mean(back))))
    offset = float(np.mean(middles))
    apart = student(len(speeds) - 1) * float(np.std(middles, ddof=1)) / math.sqrt(len(speeds))
    return JointFit(dry, smooth, (offset, _interval(offset, apart)), tuple(frictions))


def _levels(passes: Sequence[Pass], offset: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the levels of dry and smooth friction that fit the passes best beside an offset, N·m, each with its interval."""
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
    """Return half the width of an interval, N·m: what scatters, and what the observer resolves."""
    return math.hypot(statistical, RESOLVED, RESOLVED_SHARE * value)


def _least_squares(rows: Vector, torques: Vector) -> tuple[Vector, Vector]:
    found, *_ = np.linalg.lstsq(rows, torques, rcond=None)
    left = torques - rows @ found
    variance = float(left @ left) / max(len(torques) - rows.shape[1], 1)
    covariance: Vector = variance * np.linalg.pinv(rows.T @ rows)
    return np.asarray(found, dtype=float), covariance
