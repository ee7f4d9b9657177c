"""Upper bound of the information on the angle in a frame: the posterior with known simulated pads and noise.

Everything except the pose is known: pads, gains' spread, noise, and the lift of the peg by the push. The posterior over
angle, offset, push and the peg's end is summed over a grid. If the load is unknown, each pose is compared at the load
of best fit. The difference is the information in the height of a print alone.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cell.config.cell_config import CellConfig
from cell.lab.tactile.measure import (
    BETWEEN,
    CONDITIONS,
    FRAMES_A_SKIN,
    GRIP,
    LEVER,
    OFFSET,
    PUSH,
    WIDEST,
    TactileLine,
    made,
    read,
    simulated_skin,
    summed,
)
from drivers.quantities import TaxelFrame, Vector
from drivers.skin.layout import LAYOUTS, Layout
from sim.config import SimSkinConfig
from sim.pads import PadLoad, Pads
from skills.tactile.pose import PegPose

FRAMES, QUICK_FRAMES = 200, 20
BOUNDED = tuple(condition for condition in CONDITIONS if condition.name in ("first frame", "half contact"))
"""Conditions with a computed bound."""
LOADS = {"load known": True, "load unknown": False}
"""Knowledge of the load, by its name in the table."""
STEP = math.radians(0.5)
OFFSETS = np.arange(-10, 11) * 2e-4
"""Offsets of the grid, m."""
PUSHES = np.linspace(-PUSH, PUSH, 7)
"""Pushes of the grid, N."""
ENDS = 9
"""Number of positions of the peg's end in the grid, if it is unknown."""
BEYOND = math.radians(10.0)
"""Range of the grid beyond the angles of the frames, rad."""


class Bound:
    """Posterior over a grid of poses, with the simulation's own pads as the model."""

    def __init__(self, skin: SimSkinConfig, layout: Layout, config: CellConfig, ends: tuple[float, float]) -> None:
        """Compute the pads' readings at every pose of the grid, which takes seconds.

        Args:
            skin: The simulated skin.
            layout: Arrangement of the taxels.
            config: Config of the cell, for the peg.
            ends: Shortest and longest length of the peg beyond the finger centre, m.
        """
        self._theta = np.arange(-WIDEST - BEYOND, WIDEST + BEYOND, STEP)
        backs = np.unique(np.linspace(*ends, ENDS))
        pads, face, length = Pads(skin.pad, layout), config.peg.part.face, config.peg.length
        poses = [(offset, push, back) for offset in OFFSETS for push in PUSHES for back in backs]
        late = skin.creep * math.exp(-BETWEEN / skin.creep_time)
        self._readings: NDArray[np.float32] = np.array(
            [
                [
                    pads.pressure(PadLoad(t, o, GRIP, p, LEVER * p, length, b, face.width, face.is_flat)).ravel()
                    for o, p, b in poses
                ]
                for t in self._theta
            ],
            np.float32,
        ) * np.float32(skin.sensitivity * (1.0 - late))
        """Readings, counts, shape (n, k, 40)."""
        self._squares = self._readings**2
        self._prior: Vector = -0.5 * (np.array([offset for offset, _, _ in poses]) / OFFSET) ** 2
        self._gains = skin.gain_spread
        # Noise of the frame and of the baseline, and the drift up to the middle of a skin's frames.
        drift = skin.drift**2 * BETWEEN * FRAMES_A_SKIN / 2
        self._variance = skin.full_scale**2 * (skin.noise**2 * (1.0 + 1.0 / skin.health.baseline_frames) + drift)

    def estimate(self, frame: TaxelFrame, *, is_load_known: bool) -> PegPose:
        """Return mean and spread of the posterior over the angle; the offset is not returned."""
        values = frame.values.ravel()
        weights = frame.trusted.ravel() / (self._variance + (self._gains * np.maximum(values, 0.0)) ** 2)
        likeness = self._readings @ (weights * values).astype(np.float32)
        power = self._squares @ weights.astype(np.float32)
        # An unknown load takes its best fit: likeness / power of the known load.
        told = likeness - power / 2 if is_load_known else np.maximum(likeness, 0.0) ** 2 / np.maximum(2 * power, 1e-9)
        chances = self._prior + told.astype(np.float64)
        shares = np.exp(chances - chances.max()).sum(axis=-1)
        shares /= shares.sum()
        best = self._theta[chances.max(axis=-1).argmax()]
        away = np.remainder(self._theta - best + math.pi / 2, math.pi) - math.pi / 2
        mean = float(shares @ away)
        sigma = math.sqrt(float(shares @ away**2) - mean**2 + STEP**2 / 12.0)
        return PegPose(float(best) + mean, 0.0, sigma, 0.0, True, frame.stamp)


def parts() -> int:
    """Return the number of calls of `done` by `bounds`."""
    return len(LAYOUTS) * len(BOUNDED)


def bounds(config: CellConfig, is_quick: bool, done: Callable[[], None]) -> list[TactileLine]:
    """Return the bound for frames on the bed of springs, for both layouts, with the load known and unknown.

    Args:
        config: Config of a cell with a simulated skin.
        is_quick: True for a tenth of the frames, and only those of a peg with a known end.
        done: Called after every kind of frames.
    """
    skin, count = simulated_skin(config), QUICK_FRAMES if is_quick else FRAMES
    lines = []
    for layout in LAYOUTS:
        for condition in BOUNDED:
            if is_quick and condition.reach_back:
                done()
                continue
            back = config.peg.overhang
            bound = Bound(skin, layout, config, condition.reach_back or (back, back))
            frames = list(made(skin, layout, "springs", condition, count, config))
            for name, is_load_known in LOADS.items():
                estimate = partial(bound.estimate, is_load_known=is_load_known)
                reads = [read(estimate, theta, frame) for theta, frame in frames]
                lines.append(summed(layout, "springs", condition.name, name, reads))
            done()
    return lines
