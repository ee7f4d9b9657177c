"""The cell's clock on hardware: monotonic wall time."""

import time


class WallClock:
    """Monotonic time since the computer's start; setting the computer's clock does not change it."""

    def now(self) -> float:
        """Return the time, s."""
        return time.monotonic()

    def wait_until(self, stamp: float) -> None:
        """Sleep until `stamp`, s; return at once if it has passed."""
        left = stamp - time.monotonic()
        if left > 0.0:
            time.sleep(left)
