"""Supervision of the scan by wall time: late scans are counted, and a blocked scan halts the arm."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable

from drivers.errors import ScanOverrunError
from skills.guards.scan_guards import OVERRUN_WINDOW as WINDOW
from skills.guards.scan_guards import ScanLimits

GIVEN_UP = 2.0
"""Longest wait for a scan after the end of the process has been requested, s."""
HANG = 60.0
"""Time without a scan beyond which an idle cell counts as blocked, s. A device may need seconds to reset or reconnect, and
the templates of a new part take some seconds on a busy computer.
"""
LOOK_PERIOD = 0.02
"""Period of the watchdog, s."""
WARNED = 5
"""Number of late scans in the window above which the cell warns."""


class LateScans:
    """Counts the scans that took longer than two periods of wall time; pure, time is passed in."""

    def __init__(self, period: float, limits: ScanLimits) -> None:
        """Start at zero.

        Args:
            period: Period of the scan, s.
            limits: Permitted share of late scans.
        """
        self._period, self._allowed = period, round(limits.late * WINDOW)
        self._before: float | None = None
        self._late: deque[bool] = deque(maxlen=WINDOW)
        self.count = 0
        """Late scans since the start."""

    @property
    def is_warned(self) -> bool:
        """True if more than `WARNED` of the last scans were late."""
        return sum(self._late) > WARNED

    def rest(self) -> None:
        """Skip the interval until the next scan, because it has no nominal period."""
        self._before = None

    def take(self, now: float) -> None:
        """Register the start of a scan at the monotonic time `now`, s.

        Raises:
            ScanOverrunError: More of the last scans were late than the limits allow.
        """
        before, self._before = self._before, now
        if before is None:
            return
        is_late = now - before > 2.0 * self._period
        self._late.append(is_late)
        self.count += is_late
        if sum(self._late) > self._allowed:
            late, self._late = sum(self._late), deque(maxlen=WINDOW)
            raise ScanOverrunError(
                f"scan: {late} of the last {WINDOW} took longer than {2e3 * self._period:g} ms by the wall clock; "
                f"{self._allowed} allowed by scan.late: stop other programs, or lower scan_rate"
            )


class ScanWatchdog:
    """Supervises the scan from a separate thread."""

    def __init__(
        self,
        longest: float,
        *,
        is_simulated: bool,
        halt: Callable[[str], None],
        stop: threading.Event,
        give_up: Callable[[str], None],
    ) -> None:
        """Keep the limits and the callbacks for a blocked scan.

        Args:
            longest: Time without a scan beyond which a program counts as blocked, s; outside a program it is `HANG`. It is
                infinite for a simulation that is not timed, because its first run may compile for a minute.
            is_simulated: True if the arm stands still while the scan waits.
            halt: Function that halts the arm; its argument is the reason.
            stop: Event that requests the end of the process.
            give_up: Function that ends the process without the scan; its argument is the reason.
        """
        self._longest, self._is_simulated = longest, is_simulated
        self._halt, self._stop, self._give_up = halt, stop, give_up
        self._thread: threading.Thread | None = None
        self._end = threading.Event()
        self._beats = 0
        self._allowed = math.inf
        """Time without a scan beyond which it counts as blocked, s; infinite for the first scan, because it compiles."""
        self._blocked = ""

    def start(self) -> None:
        """Start the supervision."""
        self._end.clear()
        self._thread = threading.Thread(target=self._look, name="watchdog", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the supervision; idempotent."""
        self._end.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def watch(self, is_program: bool) -> None:
        """Set the limit for the scans of a program (True) or of an idle cell (False), and clear an earlier blocked state."""
        self._beats += 1
        self._allowed, self._blocked = self._longest if is_program else HANG, ""

    def beat(self, skill: str) -> None:
        """Register the start of a scan; `skill` is its name in messages.

        Raises:
            ScanOverrunError: The scan was so late that the watchdog halted the arm.
        """
        self._allowed = min(self._allowed, HANG) if self._beats else math.inf
        self._beats += 1
        if self._blocked:
            raise ScanOverrunError(f"{skill}: {self._blocked}")

    def alive(self) -> None:
        """Register activity while the arm comes to rest and no regular scan starts."""
        self._beats += 1

    def _look(self) -> None:
        age, beats, before = 0.0, -1, time.monotonic()
        while not self._end.wait(LOOK_PERIOD):
            now = time.monotonic()
            passed, before = now - before, now
            # If the watchdog wakes late, it was starved together with the scan. A simulated arm stood still during that
            # time, so that only the watchdog's own period counts. A real arm moved on, so that all of it counts.
            age += min(passed, 2.0 * LOOK_PERIOD) if self._is_simulated else passed
            if beats != self._beats:
                age, beats = 0.0, self._beats
                continue
            allowed = min(self._allowed, GIVEN_UP) if self._stop.is_set() else self._allowed
            if age > allowed and not self._blocked:
                self._blocked = f"no scan for {age:.2f} s; {allowed:g} s allowed: it computes or waits too long"
                self._halt(self._blocked)
            if age > GIVEN_UP and self._stop.is_set():
                self._give_up(self._blocked)
