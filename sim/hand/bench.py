"""A calibration bench without an arm: a rod between the pads at any angle, and a clock that advances during waits."""

from sim.hand.pads import PadLoad


class CalibrationBench:
    """The calibration bench: clock and source of pad loads."""

    def __init__(self, diameter: float, half_length: float) -> None:
        """Place a rod of this size, m, beside the open fingers."""
        self._time = 0.0
        self._diameter, self._half = diameter, half_length
        self._load: PadLoad | None = None

    def now(self) -> float:
        """Return the time, s."""
        return self._time

    def wait_until(self, stamp: float) -> None:
        """Advance the time to `stamp`."""
        self._time = max(self._time, stamp)

    def hold(self, theta: float) -> None:
        """Close the fingers about the middle of the rod at this in-hand angle, rad."""
        # Grip force of the bench, N.
        self._load = PadLoad(theta, 0.0, 30.0, 0.0, 0.0, self._half, self._half, self._diameter)

    def release(self) -> None:
        """Open the fingers."""
        self._load = None

    def pad_load(self) -> PadLoad | None:
        """Return the present load of the pads."""
        return self._load
