"""Emulated skin boards: they speak the real bytes and measure what the simulated hand holds; see `sim.board_links`."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np

from drivers.protocols import Clock
from drivers.quantities import FINGERS, TAXELS
from drivers.skin.board_config import BOARD_MODULES, FIRST_MODULE, TEMPERATURE, HubConfig, IcubConfig
from drivers.skin.cyskin_wire import (
    LONGEST,
    CanAssembler,
    Channels,
    HubCommand,
    Message,
    Module,
    WireError,
    decode,
    decode_period,
    encode,
    encode_module,
    to_can,
)
from drivers.skin.health import ERROR_COUNT, Counts
from drivers.skin.icub_wire import COUNTS_PER_STEP, SETUP, SETUP_CLASS, TriangleReading, encode_triangle
from drivers.skin.icub_wire import TAXELS as TRIANGLE_TAXELS
from drivers.skin.layout import MODULE_TAXELS
from drivers.transport.cobs import Deframer, frame
from drivers.transport.wires import CanFrame
from sim.config import SimSkinConfig
from sim.pads import Pads
from sim.skin import PadSource, Taxels

DEFAULT_PERIOD = 0.05
"""Scan period of a hub that was given none, s."""
ICUB_PERIOD = 0.04
"""Scan period of an iCub board, s."""
TEMPERATURE_COUNTS = 21_000
"""Reading of a module's temperature channel, counts; its last digit is the module's number."""
FIRST_SUI = 3500
"""Own number (sui) of the first module of an emulated hub whose modules the config does not name."""
ERROR_NO_COMMAND = 0xE2
T = TypeVar("T")
F = TypeVar("F", CanAssembler, Deframer)


class SkinSource(PadSource, Clock, Protocol):
    """The surroundings of an emulated board: pads that hold something, and time."""


class Fingers:
    """The taxels of both fingers, between the pads of the simulated hand."""

    def __init__(self, config: SimSkinConfig, source: PadSource, rng: np.random.Generator) -> None:
        """Draw one skin."""
        self._source = source
        self._pads = Pads(config.pad, config.layout)
        self.taxels = Taxels(config, rng)
        self._measured = source.now()

    def measure(self) -> Counts:
        """Return what the converters read now, shape (2, 20), counts."""
        now, load = self._source.now(), self._source.pad_load()
        pressure = np.zeros((FINGERS, TAXELS)) if load is None else self._pads.pressure(load)
        elapsed, self._measured = now - self._measured, now
        return self.taxels.measure(pressure, elapsed)


class Board(Protocol[T]):
    """A board, seen from its wire."""

    @property
    def next_scan(self) -> float:
        """Time of the next measurement, s; infinite while the board does not measure."""

    def power(self, at: float) -> None:
        """Restart the board."""

    def take(self, item: T, at: float) -> list[T]:
        """Take what has arrived; return the answer."""

    def scan(self) -> list[T]:
        """Measure; return what the board sends."""


class EmulatedHub:
    """A CySkin hub: it answers the host and sends scans; `CanBoard` and `SerialBoard` carry its messages."""

    def __init__(self, config: HubConfig, measure: Callable[[], Counts]) -> None:
        """Build a hub whose modules are those of `config`, and whose taxels read what `measure` returns."""
        self._config, self.measure = config, measure
        self.replace_modules(config.modules or range(FIRST_SUI, FIRST_SUI + BOARD_MODULES))

    def power(self, at: float) -> None:
        """Restart the hub, which sends nothing until the host starts it."""
        self.next_scan, self._period, self._sequence = math.inf, DEFAULT_PERIOD, 0

    def replace_modules(self, suis: Sequence[int]) -> None:
        """Put modules with these own numbers (sui) on the hub, at most four, left finger first, and restart it.

        The first ones are the left finger's.
        """
        mask = sum(1 << name for name in (TEMPERATURE, *self._config.channels))
        self.modules = [Module(FIRST_MODULE + row, sui, 12, uncut=mask) for row, sui in enumerate(suis)]
        self.channels = Channels(self.modules)
        uids = {uid: number for number, uid in enumerate(self.channels.uid)}
        self._taxels = [uids[sui << 4 | name] for sui in suis for name in self._config.channels]
        self._temperatures = [uids[sui << 4 | TEMPERATURE] for sui in suis]
        self.power(0.0)

    def take(self, message: Message, at: float) -> list[Message]:
        """Take a message of the host; return the answers."""
        payload = message.payload
        try:
            if message.command == HubCommand.DECLARE:
                counts = bytes(module.channels for module in self.modules)
                return [Message(HubCommand.DECLARE, bytes([len(counts)]) + counts)]
            if message.command == HubCommand.DETAILS:
                return [
                    Message(HubCommand.DETAILS, encode_module(module))
                    for module in self.modules
                    if not payload or module.number == payload[0]
                ]
            if message.command == HubCommand.PERIOD:
                self._period = decode_period(payload, self._config.wire)
                return [message]
            if message.command == HubCommand.AUTO_SYNC:
                self.next_scan = at + self._period if any(payload) else math.inf
                return [message]
        except WireError:
            pass
        return [Message(HubCommand.ERROR, bytes([ERROR_NO_COMMAND]))]

    def scan(self) -> list[Message]:
        """Measure, and return the messages of the scan."""
        self.next_scan += self._period
        readings = np.zeros(len(self.channels), dtype=np.uint16)
        readings[self._taxels] = self.measure().reshape(-1)[: len(self._taxels)]
        readings[self._temperatures] = TEMPERATURE_COUNTS + np.arange(len(self._temperatures))
        sequence, self._sequence = self._sequence, (self._sequence + 1) % 16
        return self.channels.encode(readings, self._config.wire, sequence)


class _HubBoard(Generic[F]):
    """A hub on a wire; `_frames` joins what arrives to messages."""

    def __init__(self, hub: EmulatedHub, config: HubConfig, frames: F) -> None:
        """Connect the hub."""
        self.hub, self._wire = hub, config.wire
        self._frames: F = frames

    @property
    def next_scan(self) -> float:
        """Time of the hub's next measurement, s."""
        return self.hub.next_scan

    def power(self, at: float) -> None:
        """Restart the hub."""
        self.hub.power(at)
        self._frames.reset()


class CanBoard(_HubBoard[CanAssembler]):
    """A hub on a CAN bus."""

    def __init__(self, hub: EmulatedHub, config: HubConfig) -> None:
        """Connect the hub."""
        super().__init__(hub, config, CanAssembler(config.wire.hub))

    def take(self, item: CanFrame, at: float) -> list[CanFrame]:
        """Take a frame; return the answer when it ends a message."""
        data = self._frames.feed(item)
        if data is None:
            return []
        try:
            return self._framed(self.hub.take(decode(data, self._wire), at))
        except WireError:
            return []

    def scan(self) -> list[CanFrame]:
        """Measure, and return the frames of the scan."""
        return self._framed(self.hub.scan())

    def _framed(self, messages: Iterable[Message]) -> list[CanFrame]:
        return [part for message in messages for part in to_can(encode(message, self._wire), self._wire.hub)]


class SerialBoard(_HubBoard[Deframer]):
    """A hub on a serial line."""

    def __init__(self, hub: EmulatedHub, config: HubConfig) -> None:
        """Connect the hub."""
        super().__init__(hub, config, Deframer(LONGEST))

    def take(self, item: int, at: float) -> list[int]:
        """Take a byte; return the answer when it ends a message."""
        answers: list[int] = []
        for content in self._frames.feed(bytes([item])):
            try:
                answers += self._framed(self.hub.take(decode(content, self._wire), at))
            except WireError:
                continue
        return answers

    def scan(self) -> list[int]:
        """Measure, and return the bytes of the scan."""
        return self._framed(self.hub.scan())

    def _framed(self, messages: Iterable[Message]) -> list[int]:
        return [byte for message in messages for byte in frame(encode(message, self._wire))]


class IcubBoard:
    """An iCub skin board: sends from the first setup frame on."""

    def __init__(self, config: IcubConfig, measure: Callable[[], Counts]) -> None:
        """Build a board whose taxels read what `measure` returns."""
        self._config, self.measure = config, measure
        self.power(0.0)

    def power(self, at: float) -> None:
        """Restart the board, which sends nothing until the host starts it."""
        self.next_scan = math.inf

    def take(self, item: CanFrame, at: float) -> list[CanFrame]:
        """Take a frame; the one that sets the board up starts it."""
        if item.id == SETUP_CLASS << 8 | self._config.board and item.data[:1] == bytes([SETUP]):
            self.next_scan = at + ICUB_PERIOD
        return []

    def scan(self) -> list[CanFrame]:
        """Measure, and return the frames of the scan."""
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
