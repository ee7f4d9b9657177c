"""Calibration of the skin: a sweep of a rod over known angles gives a dated file."""

import math
from collections.abc import Callable
from datetime import date
from threading import Thread
from typing import Protocol

import numpy as np

from cell.config.cell_config import CellConfig
from cell.devices.assembly import bench_skin, real_skin
from drivers.errors import ConfigError
from drivers.parts import Peg
from drivers.protocols import Clock, Skin
from drivers.quantities import Mask, TaxelFrame, Vector
from drivers.skin.calibration import SkinCalibration
from skills.tactile.skin_gains import fit_gains, rod_angles

ROD_HALF = 0.05
"""Half the length of the rod, m; the rod crosses the whole pad on both sides of the finger centre."""
STEP_BY_HAND = math.radians(15.0)
"""Step between the angles if a person turns the rod, rad; this gives twelve angles."""
RECOVERY = 3.0
"""Recovery time of the elastomer after each angle, s."""


def calibrate_skin(
    config: CellConfig, today: date, turned: Callable[[int, int], None], ask: Callable[[str], object]
) -> SkinCalibration:
    """Sweep a rod as thick as the peg over half a turn, and return the calibration.

    A simulated skin or an emulated board is swept on a bench. At a real skin, a person holds the rod.

    Args:
        config: Config of the cell.
        today: Date of the calibration.
        turned: Function called with the number of angles done and of all.
        ask: Function that shows a request to a person, and returns when the person has done it.

    Raises:
        ConfigError: The readings do not match a rod.
        CellError: The skin cannot be opened, or has timed out.
    """
    period = 1.0 / config.scan_rate
    skin: Skin
    clock: Clock
    rod_in_hand: Rod
    if config.is_skin_simulated():
        skin, clock, rod_in_hand = bench_skin(config, ROD_HALF)
        angles = rod_angles(math.radians(5.0))
    else:
        felt = real_skin(config)
        skin, clock = felt.skin, felt.clock
        rod_in_hand = HandHeldRod(skin, clock, period, ask)
        angles = rod_angles(STEP_BY_HAND)
    skin.open()
    try:
        readings, trusted = sweep(skin, clock, rod_in_hand, angles, period, turned)
    finally:
        skin.close()
    rod = Peg(diameter=config.peg.part.thickness, length=ROD_HALF, overhang=ROD_HALF, mass=config.peg.mass)
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
    """A rod, and the hand around it."""

    def hold(self, theta: float) -> None:
        """Close the fingers around the middle of the rod at an in-hand angle, rad."""

    def release(self) -> None:
        """Open the fingers."""


class HandHeldRod:
    """A rod held by a person, who follows the requests and presses Enter after each."""

    def __init__(self, skin: Skin, clock: Clock, period: float, ask: Callable[[str], object]) -> None:
        """Keep the skin; it is read every `period`, s, while the person works, because an unread board times out."""
        self._skin, self._clock, self._period, self._ask = skin, clock, period, ask

    def hold(self, theta: float) -> None:
        """Request that the person turns the rod and closes the fingers."""
        self._have_done(
            f"turn a rod as thick as the peg, 0.1 m or longer, to {math.degrees(theta):+.0f} degrees, its middle between "
            "the pads, and close the fingers on it; then Enter: "
        )

    def release(self) -> None:
        """Request that the person opens the fingers."""
        self._have_done("open the fingers, take the rod away, touch nothing; then Enter: ")

    def _have_done(self, text: str) -> None:
        asked = Thread(target=self._ask, args=(text,), daemon=True)
        asked.start()
        while asked.is_alive():
            self._clock.wait_until(self._clock.now() + self._period)
            self._skin.read()


def sweep(
    skin: Skin, clock: Clock, rod: Rod, angles: Vector, period: float, turned: Callable[[int, int], None]
) -> tuple[Vector, Mask]:
    """Return the rod's readings at each angle, and the mask of taxels trusted in all of them.

    Before every angle the fingers stay open for `RECOVERY`, because offsets drift and the elastomer keeps a trace of the
    last angle. At the end they are open and empty.

    Args:
        skin: The opened skin.
        clock: The clock of the skin.
        rod: The rod in the hand.
        angles: The angles, shape (n,), rad.
        period: Polling period of the skin, s.
        turned: Function called with the number of angles done and of all.

    Returns:
        Mean readings, counts, shape (n, 2, taxels), and a mask, shape (2, taxels).
    """
    readings, trusted = [], np.array(True)
    for number, theta in enumerate(angles, 1):
        rod.release()
        empty, is_empty_trusted = _mean(skin, clock, RECOVERY, period)
        rod.hold(float(theta))
        # Time from a new angle to the first frame used, s.
        held, is_held_trusted = _mean(skin, clock, 0.5, period)
        readings.append(held - empty)
        trusted = trusted & is_empty_trusted & is_held_trusted
        turned(number, len(angles))
    rod.release()
    return np.array(readings), trusted


def _mean(skin: Skin, clock: Clock, settle: float, period: float) -> tuple[Vector, Mask]:
    """Return the mean of the frames after `settle`, s, and the mask of taxels trusted in all of them."""
    start = clock.now() + settle
    frames: list[TaxelFrame] = []
    # Number of frames averaged at each angle.
    while len(frames) < 20:
        clock.wait_until(clock.now() + period)
        frame = skin.read()
        if frame.stamp >= start and (not frames or frame.sequence != frames[-1].sequence):
            frames.append(frame)
    values: Vector = np.mean([frame.values for frame in frames], axis=0)
    return values, np.all([frame.trusted for frame in frames], axis=0)
