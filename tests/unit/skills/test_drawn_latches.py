"""Drawn curves of force against height: noise neither hides a latch nor makes one."""

import numpy as np
import pytest

from drivers.parts import Latch
from skills.seating.latch_likelihood import SHEAR, Way, resistance, told_by
from skills.seating.latch_looks import MOST_LOOKS, is_enough

DETENT = Latch(kind="detent", force=5.0, height=0.003)
NOISES = ((0.3, 0.3), (1.0, 0.5), (1.0, 1.0))
"""White noise of the force per scan, N, up to the largest of `arm.wrench_noise`, and root mean square of the friction
force that wanders along the path, N; assumed, up to the same value."""
SCANS, WAY, PUSH = 70, 0.006, 11.0
"""Number of scans on the path, its length, m, and the force of the bottom, N, as in simulated insertions."""
SPREAD, PLACE = 1.2, 1e-4
"""Largest factor of the latch's force, and standard deviation of its position, m, as in config/reality.toml."""
CURVES = 40


def is_seated(shallow: float, wear: float, noise: tuple[float, float], rng: np.random.Generator) -> bool:
    """Return True if a drawn part is judged as seated on one of its downward motions."""
    place = float(np.clip(rng.normal(0.0, PLACE), -3.0 * PLACE, 3.0 * PLACE))
    share, ways = (1.0 - wear) * SPREAD ** rng.uniform(-1.0, 1.0), []
    for looks in range(1, MOST_LOOKS + 1):
        height = np.sort(np.concatenate([[0.0, WAY], rng.uniform(0.0, WAY, SCANS)]))
        walk = np.cumsum(rng.standard_normal(height.size))
        walk -= walk.mean()
        force = share * resistance(height + shallow - place, DETENT)
        force += noise[0] * rng.standard_normal(height.size) + noise[1] * walk / walk.std()
        force[0] = PUSH
        ways.append(Way(tuple((height - SHEAR * force)[::-1].tolist()), tuple(force[::-1].tolist())))
        told = told_by(ways, DETENT)
        if told.is_sure or is_enough(looks, told):
            return told.is_sure
    return False


@pytest.mark.parametrize(
    ("shallow", "wear", "noises", "least", "most"),
    [
        (0.0, 0.0, NOISES, 39, CURVES),
        (0.0, 1.0, NOISES, 0, 0),
        (0.0015, 0.0, NOISES, 0, 0),
        (0.001, 0.0, NOISES[:2], 0, 0),
    ],
    ids=["seated", "worn out", "bottom 1.5 mm higher", "bottom 1 mm higher"],
)
def test_noise_alone_neither_hides_a_latch_nor_makes_one(shallow, wear, noises, least, most):
    rng = np.random.default_rng(1)
    for noise in noises:
        assert least <= sum(is_seated(shallow, wear, noise, rng) for _ in range(CURVES)) <= most
