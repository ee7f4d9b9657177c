"""Emulated skin boards behind a wire: they speak the real bytes, keep simulated time, and break down when asked to.

A board is powered and connected by its link, which stands in for a CAN bus or a serial line on the driver's side.
Everything takes the time that it takes on the wire; what has arrived is decided by the cell's clock, so nothing
waits and nothing depends on how fast the computer is.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np

from drivers.cobs import Deframer, frame
from drivers.errors import DeviceNotOpenedError
from drivers.icub_wire import COUNTS_PER_STEP, SETUP, SETUP_CLASS, TriangleReading, encode_triangle
from drivers.icub_wire import TAXELS as TRIANGLE_TAXELS
from drivers.quantities import FINGERS, TAXELS
from drivers.skin import BoardSkinConfig, CanSkinConfig, SerialSkinConfig
from drivers.skin_health import ERROR_COUNT, Counts
from drivers.skin_hub import BOARD_MODULES, FIRST_MODULE, TEMPERATURE, HubConfig, IcubConfig
from drivers.skin_layout import MODULE_TAXELS
from drivers.skin_port import ByteLink, CanLink
from drivers.skin_wire import (
    LONGEST,
    CanAssembler,
    CanFrame,
    Channels,
    Command,
    Message,
    Module,
    WireError,
    decode,
    decode_period,
    encode,
    encode_module,
    to_can,
)
from drivers.transport import LineLostError
from sim.config import SimSkinConfig, SkinBoardConfig, WireFaults
from sim.pads import Pads
from sim.skin import PadSource, Taxels

FAULT_STREAM = 4
"""Key of the random stream for what goes wrong on the wire."""
DEFAULT_PERIOD = 0.05
"""Of a hub that was told none, s."""
ICUB_PERIOD = 0.04
"""Of an iCub board, s."""
TEMPERATURE_COUNTS = 21_000
"""What a module's temperature channel reads; it tells the module's number in its last digit."""
FIRST_SUI = 3500
"""Own number of the first module of an emulated hub that the config names no modules for."""
ERROR_NO_COMMAND = 0xE2
T = TypeVar("T")


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
        """When it measures next, s; infinite while it does not."""

    def power(self, at: float) -> None:
        """Start anew."""

    def take(self, item: T, at: float) -> list[T]:
        """Take what has come; return what it answers."""

    def scan(self) -> list[T]:
        """Measure; return what it sends."""


class Hub:
    """A CySkin hub: answers the host and sends scans; what carries its messages is the business of others."""

    def __init__(self, config: HubConfig, measure: Callable[[], Counts]) -> None:
        """Build a hub whose modules are those of `config`, and whose taxels read what `measure` returns."""
        self._config, self.measure = config, measure
        self.replace_modules(config.modules or range(FIRST_SUI, FIRST_SUI + BOARD_MODULES))

    def power(self, at: float) -> None:
        """Start anew: nothing is sent until the host says so."""
        self.next_scan, self._period, self._sequence = math.inf, DEFAULT_PERIOD, 0

    def replace_modules(self, suis: Sequence[int]) -> None:
        """Put modules with these own numbers on the hub, at most four, and start anew.

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
        """Take what the host says; return the answers."""
        payload = message.payload
        try:
            if message.command == Command.DECLARE:
                counts = bytes(module.channels for module in self.modules)
                return [Message(Command.DECLARE, bytes([len(counts)]) + counts)]
            if message.command == Command.DETAILS:
                return [
                    Message(Command.DETAILS, encode_module(module))
                    for module in self.modules
                    if not payload or module.number == payload[0]
                ]
            if message.command == Command.PERIOD:
                self._period = decode_period(payload, self._config.wire)
                return [message]
            if message.command == Command.AUTO_SYNC:
                self.next_scan = at + self._period if any(payload) else math.inf
                return [message]
        except WireError:
            pass
        return [Message(Command.ERROR, bytes([ERROR_NO_COMMAND]))]

    def scan(self) -> list[Message]:
        """Measure, and return the messages of the scan."""
        self.next_scan += self._period
        readings = np.zeros(len(self.channels), dtype=np.uint16)
        readings[self._taxels] = self.measure().reshape(-1)[: len(self._taxels)]
        readings[self._temperatures] = TEMPERATURE_COUNTS + np.arange(len(self._temperatures))
        sequence, self._sequence = self._sequence, (self._sequence + 1) % 16
        return self.channels.encode(readings, self._config.wire, sequence)


class CanBoard:
    """A hub on a CAN bus."""

    def __init__(self, hub: Hub, config: HubConfig) -> None:
        """Connect the hub."""
        self.hub, self._wire = hub, config.wire
        self._frames = CanAssembler(config.wire.hub)

    @property
    def next_scan(self) -> float:
        """When the hub measures next, s."""
        return self.hub.next_scan

    def power(self, at: float) -> None:
        """Start anew."""
        self.hub.power(at)
        self._frames.reset()

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


class SerialBoard:
    """A hub on a serial line."""

    def __init__(self, hub: Hub, config: HubConfig) -> None:
        """Connect the hub."""
        self.hub, self._wire = hub, config.wire
        self._frames = Deframer(LONGEST)

    @property
    def next_scan(self) -> float:
        """When the hub measures next, s."""
        return self.hub.next_scan

    def power(self, at: float) -> None:
        """Start anew."""
        self.hub.power(at)
        self._frames.reset()

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
        """Start anew: nothing is sent until the host says so."""
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


class _Link(Generic[T]):
    """A board at the end of a wire; what travels is an item, a CAN frame or a byte."""

    def __init__(
        self, board: Board[T], now: Callable[[], float], faults: WireFaults, seed: int, name: str = "emulated"
    ) -> None:
        self.faults = faults
        """What goes wrong; may be replaced at any time."""
        self.port = name
        self.board, self._now = board, now
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(FAULT_STREAM,)))
        self._to_board: deque[tuple[float, T]] = deque()
        self._to_host: deque[tuple[float, T]] = deque()
        self._free_at = 0.0
        self._seen = -math.inf
        self._is_open = self._was_plugged = False

    def open(self) -> None:
        """Connect; what the board sent before is not heard.

        Raises:
            DeviceNotOpenedError: The board is not plugged in, and its wire went with it.
        """
        self.advance()
        self._to_host.clear()
        self._is_open = True

    def close(self) -> None:
        """Disconnect; the board goes on."""
        self._is_open = False

    def due(self) -> float:
        """Return when the board has to be advanced next, at the latest, s."""
        return self.board.next_scan if self._was_plugged else math.inf

    def is_plugged(self, at: float) -> bool:
        """Whether the board is powered and connected."""
        return not any(start <= at < end for start, end in self.faults.unplugged)

    def advance(self) -> None:
        """Let the board live until now."""
        now = self._now()
        is_plugged = self.is_plugged(now)
        was_reset = any(self._seen < instant <= now for instant in self.faults.resets)
        self._seen = now
        if not is_plugged or was_reset or not self._was_plugged:
            self._to_board.clear()
            self._to_host.clear()
            self.board.power(now)
            self._was_plugged = is_plugged
        if not is_plugged:
            return
        while self._to_board and self._to_board[0][0] <= now:
            at, item = self._to_board.popleft()
            self._send(self._to_host, self.board.take(item, at), at)
        while self.board.next_scan <= now:
            at = self.board.next_scan
            self._send(self._to_host, self.board.scan(), at)

    def _send(self, queue: deque[tuple[float, T]], items: Iterable[T], at: float) -> None:
        faults = self.faults
        for item in items:
            self._free_at = max(self._free_at, at) + self._duration(item)
            if faults.drop and self._rng.random() < faults.drop:
                continue
            if faults.corrupt and self._rng.random() < faults.corrupt:
                item = self._spoilt(item)
            queue.append((self._free_at + faults.delay, item))

    def _arrived(self) -> T | None:
        if self._is_open and self._to_host and self._to_host[0][0] <= self._now():
            return self._to_host.popleft()[1]
        return None

    def _duration(self, item: T) -> float:
        raise NotImplementedError

    def _spoilt(self, item: T) -> T:
        raise NotImplementedError


class EmulatedCan(_Link[CanFrame]):
    """A CAN bus with an emulated board on it, as the driver sees a bus."""

    def __init__(
        self, board: Board[CanFrame], now: Callable[[], float], bitrate: int, faults: WireFaults, seed: int
    ) -> None:
        """Connect a board to a bus of `bitrate` bits a second."""
        super().__init__(board, now, faults, seed)
        self._bit = 1.0 / bitrate

    def read(self, timeout: float) -> CanFrame | None:
        """Return the next frame that has arrived; simulated time does not pass meanwhile."""
        self.advance()
        return self._arrived()

    def write(self, frame: CanFrame) -> None:
        """Send a frame; it is lost when nobody is there."""
        self.advance()
        self._send(self._to_board, [frame], self._now())

    def _duration(self, item: CanFrame) -> float:
        return frame_bits(len(item.data)) * self._bit

    def _spoilt(self, item: CanFrame) -> CanFrame:
        return CanFrame(item.id, _flipped(item.data, self._rng)) if item.data else item


class EmulatedLine(_Link[int]):
    """A serial line with an emulated board at its end, as the driver sees a line; unplugged it is gone."""

    def __init__(
        self, board: Board[int], now: Callable[[], float], baud_rate: int, faults: WireFaults, seed: int
    ) -> None:
        """Connect a board to a line of `baud_rate` bits a second."""
        super().__init__(board, now, faults, seed)
        self.character_time = 10.0 / baud_rate

    def open(self) -> None:
        """Connect; what the board sent before is not heard."""
        if not self.is_plugged(self._now()):
            raise DeviceNotOpenedError(f"serial port {self.port}: no such port: plug it in, or name another one")
        super().open()

    def read(self, timeout: float) -> bytes:
        """Return the bytes that have arrived; simulated time does not pass meanwhile."""
        self._check()
        data = bytearray()
        while (byte := self._arrived()) is not None:
            data.append(byte)
        return bytes(data)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._check()
        self._send(self._to_board, data, self._now())

    def _check(self) -> None:
        self.advance()
        if not self._is_open or not self.is_plugged(self._now()):
            self._is_open = False
            raise LineLostError(f"serial port {self.port}: the device is gone")

    def _duration(self, item: int) -> float:
        return self.character_time

    def _spoilt(self, item: int) -> int:
        return _flipped(bytes([item]), self._rng)[0]


class CanCable:
    """Connects an emulated board to a real CAN bus, whatever its interface, on which a driver listens elsewhere."""

    def __init__(self, board: EmulatedCan, bus: CanLink) -> None:
        """Take both ends, opened."""
        self._board, self._bus = board, bus

    def advance(self) -> None:
        """Pass on what has arrived at either end."""
        while (part := self._bus.read(0.0)) is not None:
            self._board.write(part)
        while (part := self._board.read(0.0)) is not None:
            self._bus.write(part)


class SerialCable:
    """Connects an emulated board to the far end of a serial line, as a pseudo-terminal's."""

    def __init__(self, board: EmulatedLine, line: ByteLink) -> None:
        """Take both ends, opened."""
        self._board, self._line = board, line

    def advance(self) -> None:
        """Pass on what has arrived at either end."""
        if data := self._line.read(0.0):
            self._board.write(data)
        if data := self._board.read(0.0):
            self._line.write(data)


def emulated_can(
    config: CanSkinConfig, model: SkinBoardConfig, source: PadSource, rng: np.random.Generator, seed: int
) -> EmulatedCan:
    """Return a CAN bus with the board that `config` asks for, between the pads of `source`."""
    fingers = Fingers(_taxels(config, model), source, rng)
    board: Board[CanFrame] = (
        IcubBoard(config.board, fingers.measure)
        if isinstance(config.board, IcubConfig)
        else CanBoard(Hub(config.board, fingers.measure), config.board)
    )
    return EmulatedCan(board, source.now, config.bitrate, model.faults, seed)


def emulated_line(
    config: SerialSkinConfig, model: SkinBoardConfig, source: PadSource, rng: np.random.Generator, seed: int
) -> EmulatedLine:
    """Return a serial line with the board that `config` asks for, between the pads of `source`."""
    fingers = Fingers(_taxels(config, model), source, rng)
    board = SerialBoard(Hub(config.board, fingers.measure), config.board)
    return EmulatedLine(board, source.now, config.baud_rate, model.faults, seed)


def _taxels(config: BoardSkinConfig, model: SkinBoardConfig) -> SimSkinConfig:
    keys = model.model_dump(exclude={"faults"})
    return SimSkinConfig(kind="sim", rate=config.rate, layout=config.layout, health=config.health, **keys)


def frame_bits(length: int) -> int:
    """Return how many bits a CAN frame with an 11-bit id and `length` data bytes takes at most, stuffed, with the gap.

    47 bits of frame and gap and 8 a byte; of 34 of them and the data every fourth may need a stuffed one.
    """
    return 47 + 8 * length + (34 + 8 * length - 1) // 4


def _flipped(data: bytes, rng: np.random.Generator) -> bytes:
    spoilt = bytearray(data)
    bit = int(rng.integers(8 * len(data)))
    spoilt[bit // 8] ^= 1 << bit % 8
    return bytes(spoilt)
