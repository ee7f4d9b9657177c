"""The health of taxels: the mask of trusted taxels and their baseline, the same for hardware and simulation; pure, no I/O.

The functions accept arrays of any shape, so that a recording of another patch is treated like the live skin.
"""

import math
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Quantity, Source
from drivers.errors import SkinUntrustedError
from drivers.quantities import FINGER_NAMES, FINGERS, Mask, TaxelFrame, Vector
from drivers.skin.layout import Layout, layout_of, module_of

Counts = NDArray[np.uint16]

ERROR_COUNT = 43000
"""First count that marks an error instead of a pressure; host software of [cyskin]."""
SILENT_FRAMES = 3.5
"""Time without a frame after which a skin counts as silent, multiple of its period; chosen, not measured."""
BASELINE_FRAMES = 50
"""Least number of frames of a baseline; with fewer, their noise would remain in the baseline."""

FAINT, UNEVEN = 3.8, 1.4
"""Thresholds of a touch that no single taxel shows; both must be exceeded. `FAINT` is the mean height of all taxels above their
baselines, in standard deviations of the mean's noise. `UNEVEN` is the scatter of these heights, in standard deviations of the
noise. Noise alone gives 1 of both; a peg gripped with 10 N gives 7.6 and 1.8. Warming raises all taxels alike, and drift
scatters them to either side. Source: docs/tried/angle.md.
"""


class SkinHealthConfig(ConfigModel):
    """Conditions under which a taxel is not trusted."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    baseline_frames: Annotated[int, Field(ge=BASELINE_FRAMES, le=10_000)] = BASELINE_FRAMES
    """Number of frames without a load whose mean is the baseline."""
    saturation: Annotated[
        int, Figure("counts"), Field(exclude=True), Source("chosen just below the error codes of [cyskin]")
    ] = 42_900
    """Reading at which the converter saturates, counts; the pressure is then at least this reading."""
    stuck_frames: Annotated[int, Figure("count"), Field(exclude=True)] = 30
    """Number of equal readings in a row that mark a taxel as stuck, because noise changes a live taxel."""
    frozen_frames: Annotated[int, Figure("count"), Field(exclude=True)] = 5
    """Number of identical frames in a row that mark the board as frozen."""
    drift_time: Annotated[float, Figure("s"), Field(exclude=True), Source("docs/tried/angle.md")] = 3.0
    """Time constant with which the baseline follows the untouched skin, s; derived from the noise and drift of [cyskin]."""
    touch: Annotated[float, Figure("standard deviations"), Field(exclude=True)] = 5.0
    """Height above the baseline at which a taxel counts as touched, standard deviations of its noise."""
    least_touch: Annotated[float, Field(gt=0.0, le=0.25), Quantity("fraction")] = 0.0025
    """Smallest change that counts as a touch, fraction of the skin's full scale, independent of the noise."""


class SkinHealth:
    """Baseline and mask of one skin, updated from frame to frame.

    A taxel is masked at the start if it was dead (all zero), stuck (no change) or marked an error in most frames of the
    baseline; it stays masked until the next baseline. While the skin runs, a taxel is masked as long as its reading marks an
    error, is saturated, is unchanged for too long, or is zero far below its baseline. All taxels are masked while the whole
    frame is frozen. The baseline follows drift only while nothing touches the skin.
    """

    def __init__(self, config: SkinHealthConfig, still: Counts, full_scale: float) -> None:
        """Measure the baseline.

        Args:
            config: Conditions under which a taxel is not trusted.
            still: Raw frames without a load, shape (n, …), n >= `config.baseline_frames`.
            full_scale: Largest reading under a firm touch, counts.

        Raises:
            ValueError: There are too few frames.
        """
        if len(still) < config.baseline_frames:
            raise ValueError(f"baseline: {len(still)} frames < {config.baseline_frames} frames")
        self._config = config
        valid = still < config.saturation
        count = valid.sum(axis=0)
        total = np.maximum(count, 1)
        clean = np.where(valid, still, 0).astype(float)
        mean = clean.sum(axis=0) / total
        spread = np.sqrt(np.maximum((clean**2).sum(axis=0) / total - mean**2, 0.0))
        self.dead: Mask = (still == 0).all(axis=0)
        """Mask of taxels that read zero throughout the baseline."""
        self.stuck: Mask = (still == still[0]).all(axis=0) & ~self.dead
        """Mask of taxels with one constant value other than zero throughout the baseline."""
        self.usable: Mask = ~(self.dead | self.stuck) & (2 * count > len(still))
        """Mask of taxels with a valid baseline."""
        self.baseline: Vector = mean
        """Reading without a load, counts."""
        self.noise: Vector = spread
        """Standard deviation of a reading without a load, counts."""
        self._touch = np.maximum(config.touch * spread, config.least_touch * full_scale)
        """Height above the baseline at which a single taxel counts as touched, counts."""
        # Random walk of a reading without a load in one second, fraction of full scale. Source: [cyskin].
        self._walk = config.touch * 1e-3 * full_scale
        """Height above the baseline that drift alone reaches within one second, `config.touch` standard deviations, counts."""
        self._behind = 0.0
        """Time of the random walk that the baseline has not followed, s."""
        self._last = still[-1].copy()
        self._equal = np.ones(still.shape[1:], dtype=np.int64)
        self._stamp: float | None = None

    def update(self, raw: Counts, stamp: float) -> tuple[Vector, Mask]:
        """Take one raw frame; return readings and mask.

        Args:
            raw: Readings, counts, of the baseline's shape.
            stamp: Time of the measurement, s.

        Returns:
            Signed counts above the baseline (0 if not trusted), and the mask of trusted taxels.
        """
        self._equal = np.where(raw == self._last, self._equal + 1, 1)
        self._last = raw.copy()
        is_dead = (raw == 0) & (self.baseline > self._touch)
        trusted = self.usable & ~is_dead & (raw < self._config.saturation) & (self._equal < self._config.stuck_frames)
        if (self._equal[self.usable] >= self._config.frozen_frames).all():
            trusted = np.zeros_like(trusted)
        values = np.where(trusted, raw - self.baseline, 0.0)
        elapsed = 0.0 if self._stamp is None else max(stamp - self._stamp, 0.0)
        self._stamp = stamp
        if not self._is_touched(values, trusted):
            share = min(elapsed / self._config.drift_time, 1.0)
            self.baseline = self.baseline + share * values
            self._behind *= (1.0 - share) ** 2  # variance of the remaining random walk
        self._behind += elapsed
        return values, trusted

    def _is_touched(self, values: Vector, trusted: Mask) -> bool:
        """Return True if one taxel, or all of them together, show a touch: a light grip raises no single taxel far above its noise."""
        # Longest time of drift in the threshold of a touch, s; after more drift, the threshold would hide a held peg.
        drift = self._walk * math.sqrt(min(self._behind, 600.0))  # during a grip, baselines do not follow
        heights = values * self._config.touch / np.maximum(self._touch, drift)
        if (np.abs(heights) > self._config.touch).any():
            return True
        known = heights[trusted]
        return bool(known.size and known.mean() * math.sqrt(known.size) > FAINT and known.std() > UNEVEN)


def dead_groups(dead: Mask, group: NDArray[np.int64]) -> list[int]:
    """Return the groups, such as modules, in which every taxel is dead.

    Args:
        dead: Mask of dead taxels.
        group: Number of each taxel's group, of the same shape.
    """
    return [int(number) for number in np.unique(group) if dead[group == number].all()]


def require_trust(frame: TaxelFrame, layout: Layout) -> TaxelFrame:
    """Return `frame`, of a skin with the layout `layout`, if all its taxels can be trusted.

    Raises:
        SkinUntrustedError: A taxel is not trusted; the message names dead modules and single taxels.
    """
    wrong = []
    modules, number = layout_of(layout).modules, module_of(layout)
    size = frame.trusted.shape[1] // modules
    dead = dead_groups(~frame.trusted, number)
    for group in dead:
        finger, module = divmod(group, modules)
        first = module * size
        wrong.append(
            f"{FINGER_NAMES[finger]} finger, module {module} (taxels {first} to {first + size - 1}): dead; "
            "check its plug, or change the finger"
        )
    single = ~frame.trusted & ~np.isin(number, dead)
    for finger in range(FINGERS):
        if single[finger].any():
            numbers = ", ".join(map(str, np.flatnonzero(single[finger])))
            wrong.append(f"{FINGER_NAMES[finger]} finger, taxels {numbers}: dead, stuck, saturated or in error")
    if wrong:
        raise SkinUntrustedError("skin: " + "; ".join(wrong))
    return frame
