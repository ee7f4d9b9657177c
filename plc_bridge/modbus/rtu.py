"""Modbus RTU server on a serial line: one thread, one line, one link.

The cell does not answer requests to other units. Requests to unit 0 are broadcasts: writes are executed without an
answer. A lost line is reopened with growing pauses.
"""

import logging
import threading
import time
from collections.abc import Callable

from drivers.errors import CellError
from drivers.transport.serial_line import SerialLine
from plc_bridge.config import RtuConfig
from plc_bridge.modbus.pdu import is_exception, respond
from plc_bridge.modbus.rtu_frames import BROADCAST, Receiver, with_check_sum
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.station import LinkStation, LinkWords

logger = logging.getLogger(__name__)

PATIENCE = 0.05
"""Longest pause within a frame, s: USB adapters deliver bytes up to 16 ms late, a busy computer even later."""
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 10.0
"""Shortest and longest pause before a lost line is reopened, s."""


class RtuServer:
    """Answers the requests on one line; `start` and `close` may be called from any thread.

    Args:
        config: Unit and time-out.
        line: The line, not yet open.
        mailbox: The bridge.
        now: Monotonic time, s.
        pause: First pause before a lost line is reopened, s.
    """

    def __init__(
        self,
        config: RtuConfig,
        line: SerialLine,
        mailbox: Mailbox,
        now: Callable[[], float] = time.monotonic,
        pause: float = FIRST_PAUSE,
    ) -> None:
        self._unit, self._idle_timeout = config.unit, config.idle_timeout
        self._line, self._mailbox, self._now, self._first_pause = line, mailbox, now, pause
        # Silence after a frame, s: 3.5 characters, above 19200 baud constant; Modbus over Serial Line V1.02, 2.5.1.1.
        self._silence = max(3.5 * line.character_time, 0.00175)
        self.source = f"rtu:{line.port.rpartition('/')[2]}"
        self.counts = Diagnostics()
        self._receiver = Receiver(config.unit)
        self._station: LinkStation | None = None
        self._heard = 0.0
        self._is_noisy = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the line, then serve in a separate thread.

        Raises:
            DeviceNotOpenedError: The port is missing, not permitted, or in use.
        """
        self._line.open()
        self._stop.clear()
        self._thread = threading.Thread(target=self._serve, name="rtu", daemon=True)
        self._thread.start()
        logger.info("Modbus RTU: listening on %s as unit %d", self._line.port, self._unit)

    def close(self) -> None:
        """End the thread and close the line; may be called again."""
        if self._thread is not None:
            self._stop.set()
            self._thread.join()
            self._thread = None

    def _serve(self) -> None:
        pause, is_told = self._first_pause, False
        while not self._stop.is_set():
            try:
                self._line.open()
                while not self._stop.is_set():
                    self.turn()
                    if is_told:
                        logger.info("Modbus RTU: %s is open again", self._line.port)
                    pause, is_told = self._first_pause, False
            except Exception as error:  # any error: if it ended the thread, the cell would never answer again
                if not is_told:
                    logger.warning("Modbus RTU: %s", error, exc_info=not isinstance(error, CellError))
                    is_told = True
                self._end_link()
                self._line.close()
                self._stop.wait(pause)
                pause = min(2 * pause, LONGEST_PAUSE)
        self._end_link()
        self._line.close()

    def turn(self) -> None:
        """Read until the line is silent, then answer; or drop a frame that stays incomplete.

        Raises:
            LineLostError: The line is lost.
        """
        # Time between two checks for a call of `close` while the line is idle, s.
        data = self._line.read(PATIENCE if self._receiver.is_waiting else 0.1)
        if not data:
            self._receiver.give_up()
            if self._now() - self._heard > self._idle_timeout:
                self._end_link()  # this also releases a stop coil that a dead PLC has left at 1
        while data:
            self._receiver.feed(data)
            if self._receiver.is_full:
                break
            data = self._line.read(self._silence)
        frames = self._receiver.take()
        self._count_noise(is_clean=bool(frames))
        for frame in frames:
            # if another frame follows a request, its client no longer waits for the answer
            self._take(frame, is_last=frame is frames[-1])

    def _count_noise(self, is_clean: bool) -> None:
        if self._receiver.bad > self.counts.bad_frames:
            self.counts.bad_frames = self._receiver.bad
            if not self._is_noisy:
                logger.warning("%s: frame dropped: wrong check sum; look at cable, baud rate and parity", self.source)
            self._is_noisy = True
        elif is_clean:
            self._is_noisy = False

    def _take(self, frame: bytes, is_last: bool) -> None:
        unit, request = frame[0], frame[1:]
        # Functions that are valid as broadcasts.
        if unit not in (self._unit, BROADCAST) or (unit == BROADCAST and request[0] not in {5, 6, 15, 16, 22}):
            return
        station = self._link()
        self._mailbox.heard(self.source)
        response = respond(request, station)
        self.counts.requests += 1
        if unit == BROADCAST:
            return
        if is_exception(response):
            self.counts.exceptions += 1
            station.refused(request[0], response[1])
        if is_last:
            self._line.write(with_check_sum(bytes([unit]) + response))

    def _link(self) -> LinkStation:
        """Return the station of the link for a request; after a long silence, begin a new link."""
        now = self._now()
        if now - self._heard > self._idle_timeout:
            self._end_link()
        self._heard = now
        if self._station is None:
            self._mailbox.opened(self.source, self.source)
            self._station = LinkStation(self._mailbox, LinkWords(self.source), self.counts)
        return self._station

    def _end_link(self) -> None:
        if self._station is not None:
            self._mailbox.closed(self.source)
            self._station = None
