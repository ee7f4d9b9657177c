"""A simulated skin board: it reads the pads' pressure through taxels with drift and noise, ten times a second."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from drivers.errors import DeviceNotOpenedError, SkinSilentError
from drivers.quantities import Mask, TaxelFrame, Vector
from drivers.skin.health import SILENT_FRAMES, Counts, SkinHealth
from drivers.skin.layout import Layout, layout_of, module_of, shape_of
from drivers.skin.order import TaxelOrder
from sim.config import SimSkinConfig
from sim.hand.pads import PadLoad, Pads
from sim.world.reality import Drawn

Disturb = Callable[[Counts], Counts | None]
"""Function from raw counts to received counts; None is a frame lost in transmission."""


@dataclass(frozen=True, slots=True, eq=False)
class SkinTruth:
    """Errors of a skin relative to its layout and the config's noise; hidden from skills and drivers."""

    noise_level: Vector
    """Noise of each taxel divided by that of the config, shape (2, n), ratio."""
    misplaced: Vector
    """Offset of each taxel from its position in the layout, shape (2, n, 2), m."""
    dead: Mask
    """Mask of taxels that read zero, in addition to those of the config, shape (2, n)."""
    age: float
    """Time from the measurement of a frame to its delivery, s."""

    def pads(self, config: SimSkinConfig) -> Pads:
        """Return the pads over these taxels."""
        return Pads(config.pad, config.layout, self.misplaced if self.misplaced.any() else None)


def skin_truth(drawn: Drawn, layout: Layout) -> SkinTruth:
    """Return the skin of a cell with these errors, drawn for this layout."""
    return SkinTruth(
        noise_level=drawn["skin.module_noise"][module_of(layout)] * drawn["skin.noise_level"],
        misplaced=drawn["skin.taxel_place"],
        dead=drawn["skin.dead_taxel"] > 0.0,
        age=float(drawn["skin.age"]),
    )


def as_believed(layout: Layout) -> SkinTruth:
    """Return a skin that agrees with layout and config."""
    shape = shape_of(layout)
    return SkinTruth(np.ones(shape), np.zeros((*shape, 2)), np.zeros(shape, dtype=bool), 0.0)


class PadSource(Protocol):
    """Interface of the physics to a skin."""

    def now(self) -> float:
        """Return the time, s."""

    def pad_load(self) -> PadLoad | None:
        """Return the present load of the pads; None if nothing is between them."""


class Taxels:
    """Taxels and their converter: pressure in, raw counts out.

    Gain, offset and dead taxels are drawn once. The offset then follows a random walk.
    """

    def __init__(self, config: SimSkinConfig, rng: np.random.Generator, truth: SkinTruth | None = None) -> None:
        """Draw one skin; without a `truth` it agrees with layout and config."""
        truth = truth or as_believed(config.layout)
        self._config, self._rng, self._shape = config, rng, shape_of(config.layout)
        number = module_of(config.layout)
        self._noise = config.noise * config.full_scale * truth.noise_level
        self._gain = config.sensitivity * rng.normal(1.0, config.gain_spread, self._shape)
        self._offset: Vector = config.offset * rng.normal(1.0, config.gain_spread, self._shape)
        self.dead: Mask = np.isin(number, rng.permutation(int(number.max()) + 1)[: config.dead_modules])
        """Mask of taxels that read zero, shape (2, n)."""
        living = rng.permutation(np.flatnonzero(~self.dead))
        self.dead.flat[living[: config.dead_taxels]] = True
        self.dead |= truth.dead

    def measure(self, pressure: Vector, elapsed: float) -> Counts:
        """Return raw counts, shape (2, n).

        Args:
            pressure: Pressure on each taxel, shape (2, n), Pa.
            elapsed: Time since the last measurement, s.
        """
        config, rng = self._config, self._rng
        self._offset += config.drift * config.full_scale * math.sqrt(elapsed) * rng.standard_normal(self._shape)
        reading = self._offset + self._gain * pressure + self._noise * rng.standard_normal(self._shape)
        # The converter saturates at its rail; a higher pressure must not produce the error code.
        reading = np.clip(np.rint(reading), 0, config.health.saturation)
        return np.where(self.dead, 0, reading).astype(np.uint16)


class SimSkin:
    """Skin of both fingers; it measures a frame when simulated time passes the instant of the next frame.

    The simulated skin measures only during a read, so it must be read at least once per scan. The first read at or after
    a frame's instant measures the frame and stamps it with the time of the read. If the instants of several frames pass
    between two reads, only the newest frame is measured, as on a board that keeps only the newest.
    """

    def __init__(
        self,
        config: SimSkinConfig,
        source: PadSource,
        rng: np.random.Generator,
        disturb: Disturb = lambda counts: counts,
        truth: SkinTruth | None = None,
    ) -> None:
        """Store the skin's properties; `disturb` can corrupt or lose frames."""
        self._config, self._source, self._rng, self._disturb = config, source, rng, disturb
        self._truth = truth or as_believed(config.layout)
        self._pads = self._truth.pads(config)
        self._under_way: deque[TaxelFrame] = deque()
        """Measured frames that are not delivered yet."""
        self._taxels: Taxels | None = None
        self._health: SkinHealth | None = None
        self._order = TaxelOrder(config.layout)
        self._frame: TaxelFrame | None = None
        self._start = self._measured = 0.0
        self._due = 0
        self.is_unplugged = False
        """True if the board's cable is unplugged; its measurements do not arrive."""

    def open(self) -> None:
        """Draw a skin on the first call, and record the baseline, which takes no simulated time.

        The pads must be empty: an object between them would become part of the baseline.
        """
        if self._taxels is None:
            self._taxels = Taxels(self._config, self._rng, self._truth)
        pressure = self._pressure()
        frames = self._config.health.baseline_frames
        still = np.array([self._taxels.measure(pressure, 0.0) for _ in range(frames)])
        self._health = SkinHealth(self._config.health, still, layout_of(self._config.layout).full_scale)
        self._order = TaxelOrder(self._config.layout, self._health.noise)
        self._start = self._measured = self._source.now()
        self._due, self._frame = 0, None
        self._under_way.clear()

    def close(self) -> None:
        """Stop measuring."""
        self._health = None

    def read(self) -> TaxelFrame:
        """Return the newest frame; see `drivers.protocols.Skin`."""
        if self._health is None or self._taxels is None:
            raise DeviceNotOpenedError("skin: read before it was opened")
        now = self._source.now()
        passed = (now - self._start) * self._config.rate + 1e-6
        if passed >= self._due:
            self._measure(self._taxels, self._health, now, math.floor(passed))
        # A real board measures before it is opened; the first frame is therefore available at once, without its age.
        while self._under_way and (self._frame is None or now >= self._under_way[0].stamp + self._truth.age):
            self._frame = self._under_way.popleft()
        last = self._start if self._frame is None else self._frame.stamp
        limit = SILENT_FRAMES / self._config.rate
        if self._frame is None or now - last > limit:
            raise SkinSilentError(f"skin: no frame for {now - last:.3f} s > {limit:.3f} s limit")
        self._order.require()
        return self._frame

    def _measure(self, taxels: Taxels, health: SkinHealth, now: float, sequence: int) -> None:
        raw = taxels.measure(self._pressure(), now - self._measured)
        self._measured, self._due = now, sequence + 1
        arrived = self._disturb(raw)
        if arrived is not None and not self.is_unplugged:
            values, trusted = health.update(arrived, now)
            self._order.take(arrived, values, trusted)
            self._under_way.append(TaxelFrame(values, trusted, now, sequence))

    def _pressure(self) -> Vector:
        load = self._source.pad_load()
        return np.zeros(shape_of(self._config.layout)) if load is None else self._pads.pressure(load)
