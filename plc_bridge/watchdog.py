"""The watchdog of one link: its signs of life, and whether its command block is torn; time is passed in."""

import math
from dataclasses import dataclass


@dataclass(slots=True)
class LinkWatchdog:
    """Watches one link.

    A link that never changed its life counter shows life with any request; one that never wrote the counter's copy
    at the tail of the block is never torn.
    """

    heard: float
    """Time of the last request, s."""
    life: int = 0
    """Head life counter as written last."""
    uses_life: bool = False
    life_stamp: float = -math.inf
    """Time at which the life counter changed, s."""
    changes: int = 0
    """How often the life counter changed."""
    longest_gap: float = 0.0
    """Longest time between two changes of the life counter, s."""
    uses_tail: bool = False
    torn_since: float | None = None
    _changed: float = -math.inf
    """Time at which the life counter changed, s, for the watch over a run, which begins anew with the run."""

    def see(self, life: int, tail: int, now: float) -> bool:
        """Take head and tail life counter of a block just written; return whether the block is whole."""
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

    def is_silent(self, now: float, timeout: float) -> bool:
        """Tell whether the last sign of life is older than `timeout`."""
        return now - (self.life_stamp if self.uses_life else self.heard) > timeout

    def is_torn(self, now: float, timeout: float) -> bool:
        """Tell whether the block has been torn for longer than `timeout`."""
        return self.torn_since is not None and now - self.torn_since > timeout

    def revive(self, now: float) -> None:
        """Begin the watch over a run."""
        self.life_stamp = self.heard = now

    def follow(self, earlier: "LinkWatchdog") -> None:
        """Continue the watch of a closed link of the same host."""
        self.uses_life |= earlier.uses_life
        self.life_stamp = max(self.life_stamp, earlier.life_stamp)
