"""How an arm is brought to rest: braked for a moment, then held; one rule for hold, stop, abort and faults.

A single halt would hold the place where a fast arm was, so that it swings back; halts at every scan let it run out. Then
the last one must hold: many would let the arm sink by what its model of gravity lacks, and it would never rest.
"""

from collections.abc import Callable

import numpy as np

from drivers.errors import ArmRestlessError, CellError
from drivers.protocols import Arm, Clock
from drivers.quantities import ArmState, Vector

REST_SPEED = 0.01
"""Largest speed of every joint of an arm that stands still, rad/s."""
REST_SCANS = 5
"""Number of scans in a row below that speed after which an arm stands still: one may be where a swing turns."""
BRAKE_SPEED = 0.03
"""Speed of the fastest joint above which an arm is halted anew at every scan, rad/s: what is slower the held place stops without a
swing back. Source: decision 0009.
"""
BRAKE_TIME = 0.1
"""Longest time for which an arm is halted anew, s: five time constants of an arm whose inertia is as believed, after which one that is still
fast is pulled by something, and has to be held. Source: decision 0014.
"""
REST_TIME = 1.0
"""Time from which on an arm that stays in place is at rest whatever speed it reads, s: that of a real one may never read zero."""
PLACE_TIME = 0.1
"""Time over which an arm has to stay in place, s: it may move on by `REST_SPEED` times that."""
LONGEST = 3.0
"""Longest time for an arm to come to rest, s; one that moves for longer does not obey, which is a fault."""


class Rest:
    """Brings one arm to rest, and knows whether it has come to rest."""

    def __init__(self, arm: Arm) -> None:
        """Take the arm; it may move until `seek` is called."""
        self._arm = arm
        self._since: float | None = None
        self._calm = 0
        self._place: tuple[Vector, float] | None = None
        """Joints and time from which on it is seen whether the arm stays in place."""
        self._is_in_place = False
        self.is_reached = False
        """Whether the arm was brought to rest and nobody has moved it since."""

    @property
    def is_sought(self) -> bool:
        """Whether the arm is being brought to rest, or is at rest."""
        return self._since is not None

    def leave(self) -> None:
        """Note that the arm is to move from now on."""
        self._since, self.is_reached = None, False

    def seek(self, now: float) -> None:
        """Halt the arm at the time `now`, s, and begin to bring it to rest.

        Raises:
            CellError: The arm does not take the halt.
        """
        self._since, self._calm, self.is_reached = now, 0, False
        self._place, self._is_in_place = None, False
        self._arm.halt()

    def take(self, arm: ArmState, now: float) -> bool:
        """Take the arm's state of one scan at the time `now`, s: brake or hold; return whether rest is reached.

        Raises:
            ArmRestlessError: The arm still moves long after it was halted.
            CellError: The arm does not take the halt.
        """
        if self._since is None or self.is_reached:
            return self.is_reached
        passed = now - self._since
        speed = float(np.max(np.abs(arm.dq)))
        self._calm = self._calm + 1 if speed < REST_SPEED else 0
        self._watch_place(arm.q, now)
        self.is_reached = self._calm >= REST_SCANS or (passed > REST_TIME and self._is_in_place)
        if speed > BRAKE_SPEED and passed <= BRAKE_TIME and not self.is_reached:
            self._arm.halt()
        if passed > LONGEST and not self.is_reached:
            joint = int(np.argmax(np.abs(arm.dq)))
            raise ArmRestlessError(
                f"arm: joint {joint + 1} moves at {abs(arm.dq[joint]):.3f} rad/s {passed:.1f} s after the halt; "
                f"{REST_SPEED:g} rad/s allowed"
            )
        return self.is_reached

    def _watch_place(self, q: Vector, now: float) -> None:
        """See whether the joints, rad, are where they were some scans ago."""
        if self._place is None:
            self._place = q, now
        before, since = self._place
        if now - since >= PLACE_TIME:
            self._is_in_place = bool(np.max(np.abs(q - before)) <= REST_SPEED * (now - since))
            self._place = q, now

    def wait(self, clock: Clock, period: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Bring the arm to rest if it is not there yet, and do something `meanwhile` in every scan, one a period, s.

        An arm whose state cannot be read is braked without it, for one halt alone would let it swing back.

        Raises:
            CellError: The arm is silent, does not take the halt or goes on moving.
        """
        if not self.is_sought:
            self.seek(clock.now())
        while not self._take_newest(clock.now()):
            clock.wait_until(clock.now() + period)
            meanwhile()

    def _take_newest(self, now: float) -> bool:
        """Take the arm's newest state, or brake without one; return whether rest is reached."""
        try:
            arm = self._arm.read()
        except CellError:
            if self._since is None or now - self._since > BRAKE_TIME:
                raise
            self._arm.halt()
            return False
        return self.take(arm, now)
