"""Calibration of the skin: a sweep of a rod over known angles, and the dated file that comes of it."""

import math
from collections.abc import Callable
from datetime import date
from typing import Protocol

import numpy as np

from cell.assembly import bench_skin
from cell.config import CellConfig
from drivers.errors import ConfigError
from drivers.parts import Peg
from drivers.protocols import Clock, Skin
from drivers.quantities import FINGERS, TAXELS, Mask, TaxelFrame, Vector
from drivers.skin_calibration import SkinCalibration
from skills.tactile.skin_gains import fit_gains, rod_angles

ROD_HALF = 0.05
"""The rod lies across the whole pad, to either side of the finger centre so far, m."""
STEP = math.radians(5.0)
FRAMES = 20
"""Read at every angle; their mean counts."""
SETTLE = 0.5
"""Time between a new angle and the first frame that counts, s."""
RECOVERY = 3.0
"""Time that the elastomer gets to forget the angle before, s."""


def calibrate_skin(config: CellConfig, today: date, turned: Callable[[int, int], None]) -> SkinCalibration:
    """Sweep a rod of the peg's diameter over half a turn on the simulated bench, and return what that tells.

    Args:
        config: Of a cell whose skin is simulated, or has an emulated board.
        today: The date to write down.
        turned: Told how many of how many angles are done.

    Raises:
        ConfigError: The skin is a real one.
        CellError: The skin cannot be opened, or fell silent.
    """
    skin, clock, bench = bench_skin(config, ROD_HALF)
    angles = rod_angles(STEP)
    skin.open()
    try:
        readings, trusted = sweep(skin, clock, bench, angles, 1.0 / config.scan_rate, turned)
    finally:
        skin.close()
    rod = Peg(diameter=config.peg.diameter, length=ROD_HALF, overhang=ROD_HALF, mass=config.peg.mass)
    try:
        found = fit_gains(angles.tolist(), readings, trusted, rod, config.skin.layout)
    except ValueError as error:
        raise ConfigError(f"calibrate skin: {error}") from None
    left, right = found.gains.round(4).tolist()
    missing = [tuple(np.flatnonzero(~finger).tolist()) for finger in found.measured]
    return SkinCalibration(
        date=today,
        layout=config.skin.layout,
        point_spread=found.point_spread,
        residual=found.residual,
        unmeasured=(missing[0], missing[1]),
        left=tuple(left),
        right=tuple(right),
    )


class Rod(Protocol):
    """A rod, and the hand about it."""

    def hold(self, theta: float) -> None:
        """Close the fingers about the middle of the rod at this in-hand angle, rad."""

    def release(self) -> None:
        """Open the fingers."""


def sweep(
    skin: Skin, clock: Clock, rod: Rod, angles: Vector, period: float, turned: Callable[[int, int], None]
) -> tuple[Vector, Mask]:
    """Return what the rod adds to the readings at each angle, and which taxels were trusted throughout.

    Before every angle the fingers are open for a while: offsets drift, and the elastomer remembers the angle before.

    Args:
        skin: Opened.
        clock: That it keeps.
        rod: In the hand.
        angles: The angles, rad, n of them.
        period: Between two looks at the skin, s.
        turned: Told how many of how many angles are done.

    Returns:
        Mean readings, counts, shape (n, 2, 20), and a mask, shape (2, 20).
    """
    readings, trusted = [], np.ones((FINGERS, TAXELS), dtype=bool)
    for number, theta in enumerate(angles, 1):
        rod.release()
        empty, is_empty_trusted = _mean(skin, clock, RECOVERY, period)
        rod.hold(float(theta))
        held, is_held_trusted = _mean(skin, clock, SETTLE, period)
        readings.append(held - empty)
        trusted &= is_empty_trusted & is_held_trusted
        turned(number, len(angles))
    return np.array(readings), trusted


def _mean(skin: Skin, clock: Clock, settle: float, period: float) -> tuple[Vector, Mask]:
    """Return the mean of the frames after `settle` s, and which taxels were trusted in all of them."""
    start = clock.now() + settle
    frames: list[TaxelFrame] = []
    while len(frames) < FRAMES:
        clock.wait_until(clock.now() + period)
        frame = skin.read()
        if frame.stamp >= start and (not frames or frame.sequence != frames[-1].sequence):
            frames.append(frame)
    values: Vector = np.mean([frame.values for frame in frames], axis=0)
    return values, np.all([frame.trusted for frame in frames], axis=0)
