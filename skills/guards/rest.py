"""Bring an arm to rest: brake briefly, then hold; the same rule for hold, stop, abort and faults.

A halt holds the arm's position at the time of the halt, so a fast arm would swing back to that position. If the arm is
halted again at every scan, the held position moves with the arm until it is slow. Then the last halt must hold: under
repeated halts, errors of the gravity model would make the arm sink, and it would never rest.
"""

from collections.abc import Callable

import numpy as np

from drivers.errors import ArmRestlessError, CellError
from drivers.protocols import Arm, Clock
from drivers.quantities import ArmState, Vector

REST_SPEED = 0.01
"""Largest speed of every joint of an arm at rest, rad/s. Source: chosen, not measured."""
REST_SCANS = 5
"""Number of successive scans below `REST_SPEED` after which the arm is at rest; a single scan can be a turning point of an oscillation."""
BRAKE_SPEED = 0.03
"""Speed of the fastest joint above which the arm is halted again at every scan, rad/s; a slower arm stops at the held position without
swinging back. Source: decision 0014.
"""
BRAKE_TIME = 0.1
"""Longest time of repeated halts, s: five time constants of an arm with the assumed inertia. If the arm is still fast after this time, an
external force pulls the arm, and the last halt must hold it. Source: decision 0014.
"""
REST_TIME = 1.0
"""Time after which an arm that stays in place is at rest at any measured speed, s; the measured speed of a real arm may never be zero. Source: chosen, not measured."""
PLACE_TIME = 0.1
"""Time over which the arm must stay in place, s; each joint may move by `REST_SPEED` times this time. Source: chosen, not measured."""
LONGEST = 3.0
"""Longest time for an arm to come to rest, s; a longer motion is a fault. Source: chosen, not measured."""


class Rest:
    """Brings one arm to rest and reports whether it is at rest."""

    def __init__(self, arm: Arm) -> None:
        """Store the arm; it may move until `seek` is called."""
        self._arm = arm
        self._since, self._calm = 0.0, 0
        self._place: tuple[Vector, float] | None = None
        """Joint positions, rad, and time, s, with which the next positions are compared."""
        self._is_in_place = False
        self.is_sought = False
        """True if the arm is being brought to rest, or is at rest."""
        self.is_reached = False
        """True if the arm has come to rest and has not been released since."""

    def leave(self) -> None:
        """Release the arm: it may move from now on."""
        self.is_sought = self.is_reached = False

    def seek(self, now: float) -> None:
        """Halt the arm at the time `now`, s, and start to bring it to rest.

        Raises:
            CellError: The arm rejects the halt.
        """
        self._since, self._calm = now, 0
        self.is_sought, self.is_reached = True, False
        self._place, self._is_in_place = None, False
        self._arm.halt()

    def take(self, arm: ArmState, now: float) -> bool:
        """Process the arm's state of one scan at the time `now`, s: brake or hold; return True if the arm is at rest.

        Raises:
            ArmRestlessError: The arm still moves `LONGEST` seconds after the halt.
            CellError: The arm rejects the halt.
        """
        if not self.is_sought or self.is_reached:
            return self.is_reached
        passed = now - self._since
        speed = float(np.max(np.abs(arm.dq)))
        self._calm = self._calm + 1 if speed < REST_SPEED else 0
        self._watch_place(arm.q, now)
        self.is_reached = self._calm >= REST_SCANS or (passed > REST_TIME and self._is_in_place)
        if speed > BRAKE_SPEED and passed <= BRAKE_TIME and not self.is_reached:
            self._arm.halt()
        if not self.is_reached:
            _require_time_left(arm, passed)
        return self.is_reached

    def _watch_place(self, q: Vector, now: float) -> None:
        """Compare the joint positions, rad, with those `PLACE_TIME` ago."""
        if self._place is None:
            self._place = q, now
        before, since = self._place
        if now - since >= PLACE_TIME:
            self._is_in_place = bool(np.max(np.abs(q - before)) <= REST_SPEED * (now - since))
            self._place = q, now

    def wait(self, clock: Clock, period: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Bring the arm to rest, unless it is at rest; call `meanwhile` at every scan, once per `period`, s.

        If the arm's state cannot be read, this function still halts the arm at every scan of the braking time, because after
        a single halt the arm would swing back.

        Raises:
            CellError: The arm times out, rejects the halt or keeps moving.
        """
        if not self.is_sought:
            self.seek(clock.now())
        while not self._take_newest(clock.now()):
            clock.wait_until(clock.now() + period)
            meanwhile()

    def _take_newest(self, now: float) -> bool:
        """Process the arm's newest state; if it cannot be read during the braking time, halt. Return True if the arm is at rest."""
        try:
            arm = self._arm.read()
        except CellError:
            if now - self._since > BRAKE_TIME:
                raise
            self._arm.halt()
            return False
        return self.take(arm, now)


def _require_time_left(arm: ArmState, passed: float) -> None:
    """Check that a moving arm was halted at most `LONGEST` seconds ago."""
    if passed > LONGEST:
        joint = int(np.argmax(np.abs(arm.dq)))
        raise ArmRestlessError(
            f"arm: joint {joint + 1} moves at {abs(arm.dq[joint]):.3f} rad/s {passed:.1f} s after the halt; "
            f"{REST_SPEED:g} rad/s allowed"
        )
