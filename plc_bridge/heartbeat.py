"""Heartbeats of CANopen, ours and the PLC's (CiA 301, 7.2.8.3.2): pure, time passed in."""

import math
from dataclasses import dataclass


@dataclass(slots=True)
class HeartbeatProducer:
    """Tells when the node's own heartbeat is due."""

    period: float
    """Period of object 0x1017, s; 0 sends none."""
    _due: float = 0.0

    def is_due(self, now: float) -> bool:
        """Tell whether a heartbeat shall go out at the time `now`, s, and count it as sent."""
        if self.period <= 0.0 or now < self._due:
            return False
        in_step = self._due + self.period
        self._due = in_step if in_step > now else now + self.period
        return True

    def restart(self, period: float) -> None:
        """Take a new period; the next heartbeat is due at once."""
        self.period, self._due = period, 0.0


@dataclass(slots=True)
class HeartbeatConsumer:
    """Watches whether one other node lives; the watch begins with its first heartbeat."""

    node: int
    """Node-ID of object 0x1016, 1 to 127; 0 watches none."""
    timeout: float
    """Longest time between heartbeats, of object 0x1016, s; 0 watches none."""
    _heard: float = math.inf

    def hear(self, now: float) -> bool:
        """Note a heartbeat of the node; return whether that begins the watch."""
        if self.timeout <= 0.0:
            return False
        is_first, self._heard = self._heard == math.inf, now
        return is_first

    def has_lost(self, now: float) -> bool:
        """Tell, once, that the node's heartbeat has ended."""
        if now - self._heard <= self.timeout:
            return False
        self._heard = math.inf
        return True

    def watch(self, node: int, timeout: float) -> None:
        """Watch another node, or with another time; begins anew."""
        self.node, self.timeout, self._heard = node, timeout, math.inf
