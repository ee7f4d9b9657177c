"""The switch board on its serial line as a SuccessSwitch."""

import logging

from drivers.errors import DeviceNotOpenedError
from drivers.protocols import Clock
from drivers.quantities import SwitchState
from drivers.switch.board_config import SerialSwitchConfig
from drivers.switch.wire import BAUD_RATE, TIME_RANGE, Contacts, Decoder, SwitchReport
from drivers.transport.serial_line import SerialLine
from drivers.transport.wires import ByteLink, LineLostError

logger = logging.getLogger(__name__)

FIRMWARE = 2
"""Number of the supported firmware."""
STALE = 0.1
"""Age at which a report is too old, s; four heartbeats."""
REOPEN_PERIOD = 0.5
"""Time between two attempts to reopen a lost port, s."""
_STATES = {Contacts.OPEN: SwitchState.OPEN, Contacts.CLOSED: SwitchState.CLOSED}


class SerialSuccessSwitch:
    """Uses the board's newest report while it is fresh; otherwise the state is unknown.

    Every report carries the board's own time. If reports are delayed or repeated on the line, this time lags behind the
    cell's clock, and they count as stale, like missing reports. A lost port is reopened automatically.
    """

    def __init__(self, config: SerialSwitchConfig, clock: Clock, line: ByteLink | None = None) -> None:
        """Describe the board; `clock` is the cell's clock, `line` replaces the port if traffic is recorded or played."""
        self._line: ByteLink = line or SerialLine(config.port, BAUD_RATE)
        self._clock = clock
        self._port = config.port
        self._is_open = False
        self._forget()

    def open(self) -> None:
        """Open the port and wait for a valid report."""
        if self._is_open:
            return
        self._line.open()
        self._is_open = True
        self._forget()
        # Longest time from opening the port to the first report, s: opening resets the board, whose boot loader waits.
        end = self._clock.now() + 2.5
        while self.read() is SwitchState.UNKNOWN and self._clock.now() < end:
            # Time between two polls for the first report, s.
            self._clock.wait_until(self._clock.now() + 0.01)
        if problem := self.problem():
            self.close()
            raise DeviceNotOpenedError(problem)

    def close(self) -> None:
        """Close the port."""
        self._line.close()
        self._is_open = False
        self._forget()

    def read(self) -> SwitchState:
        """Return the state in the newest report, without waiting."""
        if not self._is_open:
            return SwitchState.UNKNOWN
        now = self._clock.now()
        if now >= self._reopen_at:
            self._listen(now)
        if self.problem():
            return SwitchState.UNKNOWN
        assert self._report is not None
        return _STATES[self._report.contacts]

    def problem(self) -> str:
        """Return the reason why the state is unknown, from the bytes read so far, in one line; empty if it is known."""
        report, where = self._report, f"switch on {self._port}"
        if self._lost:
            return self._lost
        if report is None:
            return f"{where}: {self._silence()}"
        age = self._clock.now() - self._stamp
        if age > STALE:
            return f"{where}: newest report {age:.3f} s old > {STALE} s limit; check supply and cable"
        if report.firmware != FIRMWARE:
            return f"{where}: firmware {report.firmware}; {FIRMWARE} allowed: make -C drivers/switch/firmware flash"
        wrong = _wrong_in(report)
        return f"{where}: {wrong}" if wrong else ""

    def _silence(self) -> str:
        """Return the reason why no report has arrived."""
        if not self._decoder.refused:
            return "silent; check supply and cable, and whether this is the board's port"
        return (
            f"{self._decoder.refused} bytes came, none of them a valid report; "
            f"another board, a baud rate other than {BAUD_RATE}, or a bad cable"
        )

    def _forget(self) -> None:
        self._decoder = Decoder()
        self._report: SwitchReport | None = None
        self._heard = self._stamp = self._reopen_at = 0.0
        self._lost = ""

    def _listen(self, now: float) -> None:
        try:
            if self._lost:
                self._line.open()
                self._forget()
            data = self._line.read(0.0)
        except (LineLostError, DeviceNotOpenedError) as error:
            if not self._lost:
                self._lost = f"switch on {self._port}: port lost; plug the board in again, or check its cable"
                logger.warning("%s (%s)", self._lost, error)
            self._line.close()
            self._reopen_at = now + REOPEN_PERIOD
            return
        for report in self._decoder.feed(data):
            self._take(report, now)

    def _take(self, report: SwitchReport, now: float) -> None:
        """Take a report; its age is the lag of the board's clock behind the cell's, relative to earlier reports."""
        last = self._report
        if last is None:
            self._stamp = now
        else:
            elapsed = now - self._heard
            passed = ((report.time - last.time) % TIME_RANGE) / 1000.0
            # Largest relative error of the board's clock, fraction; its ceramic resonator is accurate to 0.5 %.
            lag = self._heard - self._stamp + (1.0 - 0.02) * elapsed - passed
            self._stamp = now - max(lag, 0.0)
        self._heard, self._report = now, report
        if report.was_hung and (last is None or not last.was_hung):
            logger.warning("switch on %s: its watchdog has restarted it", self._port)
        if report.was_starved and (last is None or not last.was_starved):
            logger.warning("switch on %s: its supply fell too low and it restarted", self._port)


def _wrong_in(report: SwitchReport) -> str:
    """Return the reason why the state in a report is unknown; empty if it is known."""
    if report.is_memory_broken or report.is_program_broken:
        part = "memory" if report.is_memory_broken else "program"
        return f"its self-test found the {part} broken; flash it again, then change the board"
    if report.contacts is Contacts.DISAGREE:
        both = "both contacts conduct: a short" if report.normally_open else "no contact conducts: a broken wire"
        return f"{both}, or a stuck lever"
    return "started again, contacts not yet debounced" if report.contacts is Contacts.UNKNOWN else ""
