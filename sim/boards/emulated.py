"""Emulated skin boards with the real protocol and the taxels of the simulated hand; see `sim.boards.board_links`."""

import math
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from drivers.protocols import Clock
from drivers.skin.board_config import BOARD_MODULES, IcubConfig
from drivers.skin.health import ERROR_COUNT, Counts
from drivers.skin.icub_wire import COUNTS_PER_STEP, SETUP, SETUP_CLASS, TriangleReading, encode_triangle
from drivers.skin.icub_wire import TAXELS as TRIANGLE_TAXELS
from drivers.skin.layout import MODULE_TAXELS, shape_of
from drivers.transport.wires import CanFrame
from sim.config import SimSkinConfig
from sim.hand.pads import Pads
from sim.hand.skin import PadSource, Taxels

ICUB_PERIOD = 0.04
"""Scan period of an iCub board, s."""
T = TypeVar("T")


class SkinSource(PadSource, Clock, Protocol):
    """Surroundings of an emulated board: the load between the pads, and time."""


class Fingers:
    """Taxels of both fingers, between the pads of the simulated hand."""

    def __init__(self, config: SimSkinConfig, source: PadSource, rng: np.random.Generator) -> None:
        self._source = source
        self._pads, self._shape = Pads(config.pad, config.layout), shape_of(config.layout)
        self.taxels = Taxels(config, rng)
        self._measured = source.now()

    def measure(self) -> Counts:
        """Return the present readings of the converters, shape (2, n), counts."""
        now, load = self._source.now(), self._source.pad_load()
        pressure = np.zeros(self._shape) if load is None else self._pads.pressure(load)
        elapsed, self._measured = now - self._measured, now
        return self.taxels.measure(pressure, elapsed)


class Board(Protocol[T]):
    """Interface of a board to its wire."""

    @property
    def next_scan(self) -> float:
        """Time of the next measurement, s; infinite if the board is not measuring."""

    def power(self, at: float) -> None:
        """Restart the board at time `at`, s."""

    def take(self, item: T, at: float) -> list[T]:
        """Process an item that has arrived at time `at`, s; return the answer."""

    def scan(self) -> list[T]:
        """Measure; return the board's output."""


class IcubBoard:
    """An iCub skin board; it starts to send after the first setup frame."""

    def __init__(self, config: IcubConfig, measure: Callable[[], Counts]) -> None:
        """Build a board with taxel readings from `measure`."""
        self._config, self.measure = config, measure
        self.power(0.0)

    def power(self, at: float) -> None:
        """Restart the board; it sends nothing until the host starts it."""
        self.next_scan = math.inf

    def take(self, item: CanFrame, at: float) -> list[CanFrame]:
        """Process a frame; the setup frame starts the board."""
        if item.id == SETUP_CLASS << 8 | self._config.board and item.data[:1] == bytes([SETUP]):
            self.next_scan = at + ICUB_PERIOD
        return []

    def scan(self) -> list[CanFrame]:
        """Measure; return the frames of the scan."""
        self.next_scan += ICUB_PERIOD
        counts = self.measure().reshape(BOARD_MODULES, MODULE_TAXELS).astype(int)
        frames: list[CanFrame] = []
        for triangle, row in zip(self._config.triangles, counts, strict=True):
            steps = np.zeros(TRIANGLE_TAXELS, dtype=int)
            steps[list(self._config.channels)] = row // COUNTS_PER_STEP
            values = tuple(int(value) for value in 0xFF - np.minimum(steps, 0xFF))
            errors = sum(
                1 << channel for channel, c in zip(self._config.channels, row, strict=True) if c >= ERROR_COUNT
            )
            frames += encode_triangle(self._config.board, triangle, TriangleReading(values, errors))
        return frames
