"""Skin boards as a Skin: on a CAN bus, on a serial line, and behind the makers' host program."""

import logging
import math
from collections import deque

import numpy as np

from drivers.errors import CellError, DeviceNotOpenedError, SkinSilentError
from drivers.protocols import Clock
from drivers.quantities import TaxelFrame, Vector
from drivers.skin.board_config import (
    BOARD_MODULES,
    BoardSkinConfig,
    CanSkinConfig,
    HostSkinConfig,
    IcubConfig,
    SerialSkinConfig,
)
from drivers.skin.dialogue import RETRY, RawScan
from drivers.skin.figures import SkinFigures
from drivers.skin.health import SILENT_FRAMES, SkinHealth
from drivers.skin.host_file import HostFile
from drivers.skin.layout import layout_of, shape_of
from drivers.skin.order import TaxelOrder
from drivers.skin.port import HubOnCan, HubOnSerial, IcubOnCan, SkinPort
from drivers.transport.wires import ByteLink, CanLink

logger = logging.getLogger(__name__)

LEAST_RATE = 0.8
"""Least measured rate for opening a skin, fraction of the configured rate."""


class BoardSkin:
    """Common parts of a skin on every wire: baseline, mask, time stamps, and the restart of a lost board."""

    def __init__(self, config: BoardSkinConfig, port: SkinPort, clock: Clock) -> None:
        self._config, self._port, self._clock = config, port, clock
        self._limit = SILENT_FRAMES / config.rate
        self._is_open = False
        self._forget()

    def _forget(self) -> None:
        self._health: SkinHealth | None = None
        self._order = TaxelOrder(self._config.layout)
        self._frame: TaxelFrame | None = None
        self._is_connected = False
        self._lost_line = ""
        self._connect_at = -math.inf
        self._polled = self._listening_since = -math.inf
        self._scans = self._lost = 0
        # Number of scans over which the rate is measured.
        self._recent: deque[float] = deque(maxlen=50)
        self._temperature: Vector = np.full(BOARD_MODULES, np.nan)
        self._port.forget()

    def open(self) -> None:
        """Find the modules, start the board and measure the baseline; nothing may touch the skin meanwhile.

        Raises:
            DeviceNotOpenedError: The bus or port cannot be opened, or the board is slower than `LEAST_RATE` permits.
            SkinSilentError: The board does not answer; the message names the frames received instead.
        """
        if self._is_open:
            return
        self._forget()
        self._port.link.open()
        self._is_open = self._is_connected = True
        try:
            self._take_baseline()
        except CellError:
            self.close()
            raise

    def close(self) -> None:
        """Close the bus or port; the board continues to send."""
        self._is_open = False
        self._disconnect()

    def read(self) -> TaxelFrame:
        """Return the newest frame; see `drivers.protocols.Skin`.

        While the skin is silent, every call also tries to restart it; the baseline of `open` stays in use.
        """
        health, frame = self._health, self._frame
        if not self._is_open or health is None or frame is None:
            raise DeviceNotOpenedError("skin: read before it was opened")
        for scan in self._poll():
            values, trusted = health.update(scan.counts, scan.stamp)
            self._order.take(scan.counts, values, trusted)
            frame = TaxelFrame(values, trusted, scan.stamp, frame.sequence + 1 + scan.missed)
        self._frame = frame
        silence = self._silence()
        if silence > self._limit:
            raise SkinSilentError(f"skin: no frame for {silence:.3f} s > {self._limit:.3f} s limit: {self._trouble()}")
        if self._port.changed:
            raise SkinSilentError(f"skin: {self._port.changed}: open it again, for a new baseline")
        self._order.require()
        return frame

    def figures(self) -> SkinFigures:
        """Return the reception figures of the skin."""
        recent = self._recent
        span = recent[-1] - recent[0] if len(recent) > 1 else 0.0
        return SkinFigures(
            scans=self._scans,
            lost=self._lost,
            refused=self._port.refused(),
            rate=(len(recent) - 1) / span if span > 0.0 else math.nan,
            age=self._age(),
            temperature=self._temperature.copy(),
        )

    def _age(self) -> float:
        return self._clock.now() - self._recent[-1] if self._recent else math.inf

    def _silence(self) -> float:
        """Return the time since the last reception, counted only while the wire is polled, s."""
        return min(self._age(), self._clock.now() - self._listening_since)

    def _take_baseline(self) -> None:
        config, clock = self._config, self._clock
        wanted = config.health.baseline_frames
        longest = wanted / (LEAST_RATE * config.rate) + self._limit
        begun = clock.now()
        still = self._poll()
        while len(still) < wanted:
            if not still and clock.now() - begun > config.open_timeout:
                raise SkinSilentError(f"skin: {self._trouble()}")
            if still and clock.now() - still[0].stamp > longest:
                break
            # Time between two polls of the board while it is opened, s.
            clock.wait_until(clock.now() + 0.005)
            still += self._poll()
        rate = (len(still) - 1) / (clock.now() - still[0].stamp)
        if rate < LEAST_RATE * config.rate:
            raise DeviceNotOpenedError(
                f"skin: {rate:.1f} scans/s < {LEAST_RATE * config.rate:.1f} scans/s, {LEAST_RATE:.0%} of skin.rate, "
                f"{self._lost} lost, {self._port.refused()} messages refused: mend the wiring, or lower skin.rate"
            )
        if still[0].counts.shape != (wanted_shape := shape_of(config.layout)):
            raise DeviceNotOpenedError(
                f"skin: {still[0].counts.size} taxels read; {wanted_shape[0] * wanted_shape[1]} in skin.layout = "
                f'"{config.layout}": name the layout of this skin'
            )
        self._health = SkinHealth(
            config.health, np.array([scan.counts for scan in still]), layout_of(config.layout).full_scale
        )
        self._order = TaxelOrder(config.layout, self._health.noise)
        values, trusted = self._health.update(still[-1].counts, still[-1].stamp)
        self._frame = TaxelFrame(values, trusted, still[-1].stamp, 0)

    def _poll(self) -> list[RawScan]:
        """Send what is due, and return the received scans."""
        now = self._clock.now()
        # Time without a poll after which a full buffer may have lost scans, s, for example while a program starts.
        if now - self._polled > 1.0:
            # Without polls the wire's buffer overflows, which is not a silence of the board.
            self._listening_since = now
        self._polled = now
        if not self._is_connected:
            self._connect(now)
        scans = self._exchange(now) if self._is_connected else []
        for scan in scans:
            self._scans += 1
            self._lost += scan.missed
            self._recent.append(scan.stamp)
            self._temperature = scan.temperature
        if self._port.is_started and self._silence() > self._limit:
            self._port.restart()
        return scans

    def _exchange(self, now: float) -> list[RawScan]:
        try:
            return self._port.exchange(now)
        except CellError as error:
            self._lost_line = str(error)
            logger.warning("skin: %s", error)
            self._disconnect()
            return []

    def _connect(self, now: float) -> None:
        if now < self._connect_at:
            return
        self._connect_at = now + RETRY
        try:
            self._port.link.open()
        except CellError as error:
            self._lost_line = str(error)
            return
        self._is_connected, self._lost_line = True, ""

    def _disconnect(self) -> None:
        self._is_connected = False
        self._port.link.close()

    def _trouble(self) -> str:
        return self._lost_line or self._port.trouble()


class CanSkin(BoardSkin):
    """A skin board on a CAN bus: a CySkin hub, or an iCub board."""

    def __init__(self, config: CanSkinConfig, bus: CanLink, clock: Clock) -> None:
        board = config.board
        port: SkinPort
        port = IcubOnCan(bus, board) if isinstance(board, IcubConfig) else HubOnCan(bus, board, 1.0 / config.rate)
        super().__init__(config, port, clock)


class SerialSkin(BoardSkin):
    """A skin board on a serial line."""

    def __init__(self, config: SerialSkinConfig, line: ByteLink, clock: Clock) -> None:
        super().__init__(config, HubOnSerial(line, config.board, 1.0 / config.rate), clock)


class HostSkin(BoardSkin):
    """A skin board that the makers' host program reads."""

    def __init__(self, config: HostSkinConfig, clock: Clock) -> None:
        super().__init__(config, HostFile(config), clock)
