"""The CANopen node on its bus: one thread, which opens the bus, serves it, and reopens it after a loss.

python-can's own notifier ends silently at the first error, and its periodic tasks at the first frame that cannot be
sent (4.6.1). Here one loop reads frames, and sends heartbeats and reports by its own clock. While the bus is lost, the
node continues to watch the PLC, so that the PLC counts as lost after its time-out.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.errors import CellError
from drivers.transport.can_bus import CanBus
from drivers.transport.wires import CanFrame, CanLostError
from plc_bridge.canopen.node import CanopenNode
from plc_bridge.config import CanConfig
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.registers import Register

logger = logging.getLogger(__name__)

TICK = 0.01
"""Time between two calls of the node's `tick`, which polls the report and the timers, s."""
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 10.0
"""Shortest and longest pause before a lost bus is reopened, s."""
FIRST_QUIET, LONGEST_QUIET = 5.0, 60.0
"""Shortest and longest silence after which a bus with previous traffic is reopened, s; some buses fail without an error."""


@dataclass(slots=True)
class BusHealth:
    """The state of a bus that can fail with or without an error; time is passed in."""

    is_lost: bool = False
    """True if the bus was lost and no frame has arrived since."""
    _heard: float | None = None
    _pause: float = FIRST_PAUSE
    _quiet: float = FIRST_QUIET

    def hear(self, now: float) -> bool:
        """Record a received frame; return True if it ends a loss of the bus."""
        is_back, self.is_lost = self.is_lost, False
        self._heard, self._pause, self._quiet = now, FIRST_PAUSE, FIRST_QUIET
        return is_back

    def has_died(self, now: float) -> bool:
        """Return True if frames have arrived before, but none for too long; the permitted silence then doubles."""
        if self._heard is None or now - self._heard <= self._quiet:
            return False
        self._heard, self._quiet = now, min(2 * self._quiet, LONGEST_QUIET)
        return True

    def lose(self) -> tuple[bool, float]:
        """Record a loss; return True if the bus was not lost before, and the pause before the next attempt, s."""
        is_news, self.is_lost = not self.is_lost, True
        pause, self._pause = self._pause, min(2 * self._pause, LONGEST_PAUSE)
        return is_news, pause


class CanopenServer:
    """Serves one bus; `start` and `close` may be called from any thread.

    Args:
        config: Node-IDs and times.
        registers: The whole map.
        bus: The bus, not yet open.
        mailbox: The bridge.
        now: Monotonic time, s.
        wait: Waits this number of seconds, or less; None waits until `close` at the latest.
    """

    def __init__(
        self,
        config: CanConfig,
        registers: Sequence[Register],
        bus: CanBus,
        mailbox: Mailbox,
        now: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] | None = None,
    ) -> None:
        self._stop = threading.Event()
        self._bus, self._now, self._wait = bus, now, wait or self._stop.wait
        self._node = CanopenNode(config, registers, mailbox, self._send)
        self._health = BusHealth()
        self._is_open = False
        self._next_tick = self._retry = 0.0
        self._behind_since: float | None = None
        self._thread: threading.Thread | None = None

    @property
    def counts(self) -> Diagnostics:
        """Counts since the start."""
        counts = self._node.counts
        counts.bad_frames = self._bus.bad_frames
        return counts

    def start(self) -> None:
        """Open the bus, then serve in a separate thread.

        Raises:
            DeviceNotOpenedError: The interface or port is missing, not permitted, or in use.
        """
        self.open()
        self._stop.clear()
        self._thread = threading.Thread(target=self._serve, name="canopen", daemon=True)
        self._thread.start()
        logger.info("CANopen: on %s", self._bus.name)

    def close(self) -> None:
        """End the thread and close the bus; may be called again."""
        if self._thread is not None:
            self._stop.set()
            self._thread.join()
            self._thread = None
        self._node.shut()
        self._is_open = False
        self._bus.close()

    def open(self) -> None:
        """Open the bus and boot the node; without a thread, the caller calls `step`.

        Raises:
            DeviceNotOpenedError: The interface or port is missing, not permitted, or in use.
        """
        self._bus.open()
        self._is_open = True
        self._node.boot()

    def _serve(self) -> None:
        while not self._stop.is_set():
            self.step()

    def step(self) -> None:
        """Process a frame if one arrives, send the frames that are due, and reopen a lost bus after its pause."""
        now = self._now()
        try:
            if not self._is_open and now < self._retry:
                self._wait(TICK)
                self._node.tick(now)
                return
            if not self._is_open:
                self._bus.open()
                self._is_open = True
                self._node.recover()
            self._turn()
        except CellError as error:
            self._lose(error)

    def _turn(self) -> None:
        frame = self._bus.read(TICK)
        now = self._now()
        if frame is None:
            self._behind_since = None
        elif self._behind_since is None:
            self._behind_since = now
        if frame is not None:
            if self._health.hear(now):
                logger.info("CANopen: %s is back", self._bus.name)
            self._node.receive(frame, now)
        elif self._health.has_died(now):
            raise CanLostError(f"CAN bus {self._bus.name}: nobody is heard any more")
        if frame is None or now >= self._next_tick:
            self._next_tick = now + TICK
            # After a pause of this process, it must first read the waiting frames. Longest time for this, s; until all
            # of them are read, the PLC does not count as silent.
            self._node.tick(now, self._behind_since is None or now - self._behind_since > 1.0)

    def _lose(self, error: CellError) -> None:
        self._is_open = False
        self._bus.close()
        is_news, pause = self._health.lose()
        self._retry = self._now() + pause
        if is_news:
            self._node.counts.dropped += 1
            logger.warning("CANopen: %s", error)

    def _send(self, frame: CanFrame) -> None:
        if self._is_open:
            self._bus.write(frame)
