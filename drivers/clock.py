"""The cell's clock on hardware: monotonic wall time."""

import time


class WallClock:
    """Monotonic time since the computer's start, which nobody can set."""

    def now(self) -> float:
        """Return the time, s."""
        return time.monotonic()

    def wait_until(self, stamp: float) -> None:
        """Sleep until `stamp`, s; return at once when that has passed."""
        left = stamp - time.monotonic()
        if left > 0.0:
            time.sleep(left)
