"""The watchdog of one link: its signs of life, and the check for a torn command block; time is passed in.

A block is torn if the life counters at its head and at its tail differ.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlcSight:
    """View of one PLC from the cell, for commissioning of both."""

    source: str
    version: int
    """Version of the map that the PLC writes; 0 for none."""
    life_changes: int
    """Number of changes of its life counter on this connection."""
    longest_gap: float
    """Longest time between two changes, s."""
    silence: float
    """Time since its last sign of life, s."""
    uses_tail: bool
    """True if the PLC writes the copy of the life counter at the tail."""


@dataclass(slots=True)
class LinkWatchdog:
    """Watches one link.

    If a link never changed its life counter, any request is a sign of life. If a link never wrote the counter's copy at the
    tail of the block, its block never counts as torn.
    """

    heard: float
    """Time of the last request, s."""
    life: int = 0
    """Head life counter as last written."""
    uses_life: bool = False
    life_stamp: float = -math.inf
    """Time of the last change of the life counter, s; the start of a run resets it."""
    changes: int = 0
    """Number of changes of the life counter."""
    longest_gap: float = 0.0
    """Longest time between two changes of the life counter, s."""
    uses_tail: bool = False
    torn_since: float | None = None
    _changed: float = -math.inf
    """Time of the last change of the life counter, s, for the longest gap."""

    def see(self, life: int, tail: int, now: float) -> bool:
        """Take head and tail life counter of a block just written; return True if the block is whole."""
        self.heard = now
        if life != self.life:
            if self.uses_life:
                self.longest_gap = max(self.longest_gap, now - self._changed)
            self.life, self.uses_life, self.life_stamp, self._changed = life, True, now, now
            self.changes += 1
        self.uses_tail |= tail != 0
        if self.uses_tail and life != tail:
            if self.torn_since is None:
                self.torn_since = now
            return False
        self.torn_since = None
        return True

    def silence(self, now: float) -> float:
        """Return the time since the last sign of life, s."""
        return now - (self.life_stamp if self.uses_life else self.heard)

    def is_torn(self, now: float, timeout: float) -> bool:
        """Return True if the block has been torn for longer than `timeout`, s."""
        return self.torn_since is not None and now - self.torn_since > timeout

    def revive(self) -> None:
        """Begin to watch a run: the last request, which has started the run, counts as its first sign of life."""
        self.life_stamp = self.heard

    def follow(self, earlier: "LinkWatchdog") -> None:
        """Continue the watch of a closed link of the same host."""
        self.uses_life |= earlier.uses_life
        self.life_stamp = max(self.life_stamp, earlier.life_stamp)
