"""The cell's clock on hardware: monotonic wall time."""

import time


class WallClock:
    """Counts from the start of the computer; nobody can set it."""

    def now(self) -> float:
        """Return the time, s."""
        return time.monotonic()

    def wait_until(self, stamp: float) -> None:
        """Sleep until `stamp`; return at once when that has passed."""
        left = stamp - time.monotonic()
        if left > 0.0:
            time.sleep(left)
