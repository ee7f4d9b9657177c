"""Whether the scan keeps its time by the wall clock: late scans are counted, and one that does not come halts the arm."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable

from drivers.errors import ScanOverrunError
from skills.scan_guards import OVERRUN_WINDOW as WINDOW
from skills.scan_guards import ScanLimits

GIVEN_UP = 2.0
"""Delay of a scan beyond which a program that shall end does not wait for it, s."""
HANG = 60.0
"""Delay of a scan of a cell that waits for commands beyond which whatever it waits for never comes, s; devices may need seconds for a reset or to be
found again, and the templates of a new part some seconds of a busy computer.
"""
LOOK_PERIOD = 0.02
"""Time between two looks of the watchdog, s."""
WARNED = 5
"""Number of late scans in the window beyond which there is a warning."""


class LateScans:
    """Counts the scans that took longer than two periods of wall time; pure, time is passed in."""

    def __init__(self, period: float, limits: ScanLimits) -> None:
        """Begin with none; the period is that of the scan, s."""
        self._period, self._allowed = period, round(limits.late * WINDOW)
        self._before: float | None = None
        self._late: deque[bool] = deque(maxlen=WINDOW)
        self.count = 0
        """Late scans since the start."""

    @property
    def is_warned(self) -> bool:
        """Whether too many of the last scans were late."""
        return sum(self._late) > WARNED

    def rest(self) -> None:
        """Count nothing until the next scan: what was done since the last one has no period."""
        self._before = None

    def take(self, now: float) -> None:
        """Take the start of a scan by the wall clock, s.

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


def older(age: float, passed: float, *, is_simulated: bool) -> float:
    """Return the age of the last scan, s, after `passed` seconds between two looks at it.

    A watchdog that wakes late was starved together with the scan. A simulated arm stood still meanwhile, and only the
    time that the watchdog itself was awake counts against the scan; a real arm moved on.
    """
    return age + (min(passed, 2.0 * LOOK_PERIOD) if is_simulated else passed)


class ScanWatchdog:
    """Looks at the scan from a thread of its own, whatever the cell does."""

    def __init__(
        self,
        longest: float,
        *,
        is_simulated: bool,
        halt: Callable[[str], None],
        stop: threading.Event,
        give_up: Callable[[str], None],
    ) -> None:
        """Take what the watchdog does when a scan does not come.

        Args:
            longest: Time without a scan of a program beyond which it counts as blocked, s; outside a program it is `HANG`. It is infinite for a
                simulation that is not timed, whose first run may compile for a minute.
            is_simulated: Whether the arm stands still while the scan waits.
            halt: Function that halts the arm, and is told why.
            stop: Event that is set when the program shall end.
            give_up: Function that ends the program without the scan, and is told why.
        """
        self._longest, self._is_simulated = longest, is_simulated
        self._halt, self._stop, self._give_up = halt, stop, give_up
        self._thread: threading.Thread | None = None
        self._end = threading.Event()
        self._beats = 0
        self._allowed = math.inf
        """Time without a scan beyond which it counts as blocked, s; the first scan compiles, and may take its time."""
        self._blocked = ""

    def start(self) -> None:
        """Begin to look."""
        self._end.clear()
        self._thread = threading.Thread(target=self._look, name="watchdog", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Look no more; harmless when repeated."""
        self._end.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def watch(self, is_program: bool) -> None:
        """Say whether the scans to come are those of a program; one that was blocked before is forgotten."""
        self._beats += 1
        self._allowed, self._blocked = self._longest if is_program else HANG, ""

    def beat(self, skill: str) -> None:
        """Take the start of a scan; `skill` is what it belongs to.

        Raises:
            ScanOverrunError: It came so late that the arm was halted meanwhile.
        """
        self._allowed = min(self._allowed, HANG) if self._beats else math.inf
        self._beats += 1
        if self._blocked:
            raise ScanOverrunError(f"{skill}: {self._blocked}")

    def alive(self) -> None:
        """Take it that the scan goes on, while the arm comes to rest and no scan of a program or of the waiting cell begins."""
        self._beats += 1

    def _look(self) -> None:
        age, beats, before = 0.0, -1, time.monotonic()
        while not self._end.wait(LOOK_PERIOD):
            now = time.monotonic()
            age = older(age, now - before, is_simulated=self._is_simulated)
            before = now
            if beats != self._beats:
                age, beats = 0.0, self._beats
                continue
            allowed = min(self._allowed, GIVEN_UP) if self._stop.is_set() else self._allowed
            if age > allowed and not self._blocked:
                self._blocked = f"no scan for {age:.2f} s; {allowed:g} s allowed: it computes or waits too long"
                self._halt(self._blocked)
            if age > GIVEN_UP and self._stop.is_set():
                self._give_up(self._blocked)
