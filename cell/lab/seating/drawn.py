"""Thousands of drawn curves of force against height: rate at which noise hides a latch or lets another end pass for the bottom."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.parts import Latch
from drivers.quantities import Vector
from skills.latch_likelihood import SHEAR, Way, resistance, told_by
from skills.latch_looks import MOST_LOOKS, is_enough

NOISES = ((0.3, 0.3), (1.0, 0.5), (1.0, 1.0))
"""White noise of the force per scan, N, up to the largest of `arm.wrench_noise`, and root mean square of the friction
force that wanders along the path, N; assumed, up to the same value."""
SCANS, WAY = 70, 0.006
"""Number of scans on the path, and its length, m, as in simulated insertions."""
PUSH = 11.0
"""Force of the bottom against the default push, N."""
SPREAD, PLACE = 1.2, 1e-4
"""Largest factor of the latch's force, and standard deviation of its position, m: `latch.force` and `latch.place` of
config/reality.toml."""
ENDS = (
    ("seated", 0.0, 0.0),
    ("worn out", 0.0, 1.0),
    ("three quarters worn", 0.0, 0.75),
    *((f"bottom {height:g} mm higher", 1e-3 * height, 0.0) for height in (0.5, 0.8, 1.0, 1.5, 2.0, 3.0)),
)
"""Ends of a path by name: height of the true bottom above the stated one, m, and lost share of the latch's force."""


@dataclass(frozen=True, slots=True)
class DrawnLine:
    """Curves of one end."""

    end: str
    curves: int
    """Number of curves at each of `NOISES`."""
    told: tuple[int, ...]
    """Number of curves judged as a seated part."""


def drawn(latch: Latch, curves: int, seed: int, done: Callable[[], None] = lambda: None) -> list[DrawnLine]:
    """Return the number of curves of each end that match the stated latch; `done` is called after each end."""
    lines = []
    for name, shallow, wear in ENDS:
        rng = np.random.default_rng(seed)
        told = tuple(sum(_is_told(latch, shallow, wear, noise, rng) for _ in range(curves)) for noise in NOISES)
        lines.append(DrawnLine(name, curves, told))
        done()
    return lines


def _is_told(latch: Latch, shallow: float, wear: float, noise: tuple[float, float], rng: np.random.Generator) -> bool:
    """Return True if a part passes for seated on one of the downward motions of a skill."""
    place = float(np.clip(rng.normal(0.0, PLACE), -3.0 * PLACE, 3.0 * PLACE))
    share, ways = (1.0 - wear) * SPREAD ** rng.uniform(-1.0, 1.0), []
    for looks in range(1, MOST_LOOKS + 1):
        height = np.sort(np.concatenate([[0.0, WAY], rng.uniform(0.0, WAY, SCANS)]))
        force = share * resistance(height + shallow - place, latch) + _noise(noise, height.size, rng)
        force[0] = PUSH
        ways.append(Way(tuple((height - SHEAR * force)[::-1].tolist()), tuple(force[::-1].tolist())))
        told = told_by(ways, latch)
        if told.is_sure or is_enough(looks, told):
            return told.is_sure
    return False


def _noise(noise: tuple[float, float], count: int, rng: np.random.Generator) -> Vector:
    """Return white noise and a random walk, each with its own size, N, shape (count,)."""
    walk = np.cumsum(rng.standard_normal(count))
    walk -= walk.mean()
    return np.asarray(noise[0] * rng.standard_normal(count) + noise[1] * walk / walk.std())
