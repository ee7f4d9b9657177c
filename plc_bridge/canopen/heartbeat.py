"""Heartbeats of CANopen, ours and the PLC's (CiA 301, 7.2.8.3.2): pure, time passed in."""

import math
from dataclasses import dataclass


@dataclass(slots=True)
class HeartbeatProducer:
    """Determines when the node's own heartbeat is due; the first one is due at once."""

    period: float
    """Period of object 0x1017, s; 0 disables the heartbeat."""
    _due: float = 0.0

    def is_due(self, now: float) -> bool:
        """Return True if a heartbeat is due at the time `now`, s, and count it as sent."""
        if self.period <= 0.0 or now < self._due:
            return False
        in_step = self._due + self.period
        self._due = in_step if in_step > now else now + self.period
        return True


@dataclass(slots=True)
class HeartbeatConsumer:
    """Watches the heartbeat of one other node; the watch begins with its first heartbeat."""

    node: int
    """Node-ID of object 0x1016, 1 to 127; 0 disables the watch."""
    timeout: float
    """Longest time between heartbeats, of object 0x1016, s; 0 disables the watch."""
    _heard: float = math.inf

    def hear(self, now: float) -> bool:
        """Record a heartbeat of the node; return True if it begins the watch."""
        if self.timeout <= 0.0:
            return False
        is_first, self._heard = self._heard == math.inf, now
        return is_first

    def has_lost(self, now: float) -> bool:
        """Return True if the node's heartbeat has ended, only once for each end."""
        if now - self._heard <= self.timeout:
            return False
        self._heard = math.inf
        return True
