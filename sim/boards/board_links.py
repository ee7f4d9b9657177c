"""Wires of emulated skin boards, in simulated time and with configurable faults.

A link powers and connects its board, and replaces a CAN bus or a serial line on the driver's side. Transport takes as
long as on the real wire. The cell's clock decides which items have arrived. The result is therefore independent of the
computer's speed, and no call waits for an item.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from drivers.errors import DeviceNotOpenedError
from drivers.skin.board_config import BoardSkinConfig, CanSkinConfig, IcubConfig, SerialSkinConfig
from drivers.transport.wires import CanFrame, LineLostError
from sim.boards.cyskin_board import CanBoard, EmulatedHub, SerialBoard
from sim.boards.emulated import Board, Fingers, IcubBoard
from sim.config import SimSkinConfig, SkinBoardConfig, WireFaults
from sim.hand.skin import PadSource

FAULT_STREAM = 4
"""Key of the random stream of the wire's faults."""
T = TypeVar("T")


class _Link(Generic[T]):
    """A wire with a board at its end; the items that travel are CAN frames or bytes."""

    port = "emulated"

    def __init__(self, board: Board[T], now: Callable[[], float], faults: WireFaults, seed: int) -> None:
        self.faults = faults
        """Faults of the wire; callers may replace them at any time."""
        self.is_unplugged = False
        """True if the board has neither power nor connection, whatever `faults` contains."""
        self.board, self._now = board, now
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(FAULT_STREAM,)))
        self._to_board: deque[tuple[float, T]] = deque()
        self._to_host: deque[tuple[float, T]] = deque()
        self._free_at = 0.0
        self._seen = -math.inf
        self._is_open = self._was_plugged = False

    def open(self) -> None:
        """Connect; discard all items sent before.

        Raises:
            DeviceNotOpenedError: The board and its wire are unplugged.
        """
        self.advance()
        self._to_host.clear()
        self._is_open = True

    def close(self) -> None:
        """Disconnect; the board continues to send."""
        self._is_open = False

    def due(self) -> float:
        """Return the time of the board's next scan, s; infinite if the board was not plugged at the last advance."""
        return self.board.next_scan if self._was_plugged else math.inf

    def is_plugged(self, at: float) -> bool:
        """True if the board has power and connection."""
        return not self.is_unplugged and not any(start <= at < end for start, end in self.faults.unplugged)

    def advance(self) -> None:
        """Advance the board to the present time."""
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
    """A CAN bus to an emulated board, with the driver's bus interface."""

    def __init__(
        self, board: Board[CanFrame], now: Callable[[], float], bitrate: int, faults: WireFaults, seed: int
    ) -> None:
        """Connect a board to a bus of `bitrate` bits per second."""
        super().__init__(board, now, faults, seed)
        self._bit = 1.0 / bitrate

    def read(self, timeout: float) -> CanFrame | None:
        """Return the next frame that has arrived; simulated time stands still."""
        self.advance()
        arrival = self._to_host[0][0] if self._to_host else 0.0
        frame = self._arrived()
        return frame and replace(frame, waited=self._now() - arrival)

    def write(self, frame: CanFrame) -> None:
        """Send a frame; the frame is lost if no board is connected."""
        self.advance()
        self._send(self._to_board, [frame], self._now())

    def _duration(self, item: CanFrame) -> float:
        return frame_bits(len(item.data)) * self._bit

    def _spoilt(self, item: CanFrame) -> CanFrame:
        return replace(item, data=_flipped(item.data, self._rng)) if item.data else item


class EmulatedLine(_Link[int]):
    """A serial line to an emulated board, with the driver's line interface; unplugging the board removes the line."""

    def __init__(
        self, board: Board[int], now: Callable[[], float], baud_rate: int, faults: WireFaults, seed: int
    ) -> None:
        """Connect a board to a line of `baud_rate` bits per second."""
        super().__init__(board, now, faults, seed)
        self.character_time = 10.0 / baud_rate

    def open(self) -> None:
        """Connect; discard all bytes sent before."""
        if not self.is_plugged(self._now()):
            raise DeviceNotOpenedError(f"serial port {self.port}: no such port: plug it in, or name another one")
        super().open()

    def read(self, timeout: float) -> bytes:
        """Return the bytes that have arrived; simulated time stands still."""
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


def emulated_can(
    config: CanSkinConfig, model: SkinBoardConfig, source: PadSource, rng: np.random.Generator, seed: int
) -> EmulatedCan:
    """Return a CAN bus with the board from `config`, between the pads of `source`."""
    fingers = Fingers(_taxels(config, model), source, rng)
    board: Board[CanFrame] = (
        IcubBoard(config.board, fingers.measure)
        if isinstance(config.board, IcubConfig)
        else CanBoard(EmulatedHub(config.board, fingers.measure))
    )
    return EmulatedCan(board, source.now, config.bitrate, model.faults, seed)


def emulated_line(
    config: SerialSkinConfig, model: SkinBoardConfig, source: PadSource, rng: np.random.Generator, seed: int
) -> EmulatedLine:
    """Return a serial line with the board from `config`, between the pads of `source`."""
    fingers = Fingers(_taxels(config, model), source, rng)
    board = SerialBoard(EmulatedHub(config.board, fingers.measure))
    return EmulatedLine(board, source.now, config.baud_rate, model.faults, seed)


def _taxels(config: BoardSkinConfig, model: SkinBoardConfig) -> SimSkinConfig:
    keys = model.model_dump(exclude={"faults"})
    return SimSkinConfig(kind="sim", rate=config.rate, layout=config.layout, health=config.health, **keys)


def frame_bits(length: int) -> int:
    """Return the largest bit count of a CAN frame: 11-bit id, `length` data bytes, stuffing and interframe gap.

    Frame and gap have 47 bits, each data byte 8. Stuffing adds at most one bit per four of the 34 stuffable bits and
    the data.
    """
    return 47 + 8 * length + (34 + 8 * length - 1) // 4


def _flipped(data: bytes, rng: np.random.Generator) -> bytes:
    spoilt = bytearray(data)
    bit = int(rng.integers(8 * len(data)))
    spoilt[bit // 8] ^= 1 << bit % 8
    return bytes(spoilt)
