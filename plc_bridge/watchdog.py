"""The watchdog of one link: its signs of life, and whether its command block is torn; time is passed in."""

import math
from dataclasses import dataclass


@dataclass(slots=True)
class Watchdog:
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
    uses_tail: bool = False
    torn_since: float | None = None

    def see(self, life: int, tail: int, now: float) -> bool:
        """Take head and tail life counter of a block just written; return whether the block is whole."""
        self.heard = now
        if life != self.life:
            self.life, self.uses_life, self.life_stamp = life, True, now
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

    def follow(self, earlier: "Watchdog") -> None:
        """Go on where the watchdog of a closed link of the same host left off."""
        self.uses_life |= earlier.uses_life
        self.life_stamp = max(self.life_stamp, earlier.life_stamp)
