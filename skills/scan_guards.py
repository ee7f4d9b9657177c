"""Checks that every scan makes, and the way back from a hold; pure."""

import math
from collections import deque
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.errors import NotFiniteError, ScanOverrunError, SkinUntrustedError, TrackingError
from drivers.frames import end_point
from drivers.parts import Fraction
from drivers.quantities import FINGER_NAMES, ArmState, GripperState, ImpedanceSetpoint, TaxelFrame
from skills.tactile.pose import PegPose

OVERRUN_WINDOW = 100
"""Number of scans over which overruns are counted."""
LONGEST_STEP = 3.0
"""Largest part of a path that is done in one scan, periods of the scan; a scan that comes later than that slows the path. At the speed of a
transfer the setpoint then jumps by 7.5 mm, which the arm follows with 11 N.
"""
TRACKING_LIMIT = 0.1
"""Largest distance between the controlled point and its setpoint, m; the lead that skills push with stays below half of
it.
"""
MOST_LEVEL = 1500.0
"""Largest reading of a finger's taxels that a held peg does not press, counts: at least a fifth of them lie beside it, and read below 510 with
round and flat pegs of 8 and 12 mm at 30 and 70 N, at all angles. Source: derived from the pads of the simulation.
"""
FREE_SHARE = 5
"""One of so many taxels of a finger is beside any peg."""
MOST_COUNTS = 65535.0
"""Largest reading of a taxel, counts: that of a converter of 16 bits."""
WIDEST = 1.0
"""Largest distance between the pads of any hand, m."""
RESUME_TIME = 1.0
"""Time of the way from a hold back to the setpoint, s; a peg that left the plate while the arm braked comes down on it
slowly.
"""


class ScanLimits(ConfigModel):
    """[scan]: how late the scan may come before the run ends; until then a late scan only slows the path."""

    late: Fraction = 0.8
    """Largest share of the last 100 scans that may take longer than two periods, fraction; more of them are a fault. Source: decision 0015."""
    longest: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2
    """Longest time from one scan to the next, s; later than this the arm is halted, and the run ends with a fault. Source: decision 0015."""


def new_window() -> deque[bool]:
    """Return the memory for which of the last scans were late, before the first one."""
    return deque(maxlen=OVERRUN_WINDOW)


class ScanTiming:
    """Judges how late the scans come, and tells how far a path goes on in each of them; one object serves one skill's scan."""

    def __init__(self, scan_period: float, limits: ScanLimits, late: deque[bool]) -> None:
        """Begin before the first scan; the period is in s, and `late` tells of the scans before."""
        self._period, self._limits, self._late = scan_period, limits, late
        self._before: float | None = None
        self.passed = scan_period
        """Time since the scan before, s, on the cell's clock; a period at the first scan."""

    @property
    def step(self) -> float:
        """Time by which a path goes on in this scan, s: what has passed, as far as a path may step."""
        return min(self.passed, LONGEST_STEP * self._period)

    @property
    def due(self) -> float:
        """When the next scan is due, s, on the cell's clock: a period after this one, so that no late scan is made up for."""
        return (self._before or 0.0) + self._period

    def take(self, stamp: float) -> None:
        """Take the start of a scan on the cell's clock, s."""
        if self._before is not None:
            # Ticks of a simulated clock are no exact binary fractions; a path counts whole periods where scans keep their time.
            self.passed = round(stamp - self._before, 9)
        self._before = stamp
        self._late.append(self.passed > 2.0 * self._period)

    def require_kept(self) -> None:
        """Make sure that the limits are kept.

        Raises:
            ScanOverrunError: This scan comes later than allowed, or too many of the last ones came late.
        """
        if self.passed > self._limits.longest:
            raise ScanOverrunError(
                f"scan: {1e3 * self.passed:.0f} ms after the one before; scan.longest = {self._limits.longest:g} s allowed: "
                "stop other programs"
            )
        most = self._limits.late * OVERRUN_WINDOW
        if sum(self._late) > most + 1e-9:
            late = sum(self._late)
            self._late.clear()
            raise ScanOverrunError(
                f"scan: {late} of the last {OVERRUN_WINDOW} took longer than {2e3 * self._period:g} ms; "
                f"{most:.0f} allowed by scan.late: stop other programs, or lower scan_rate"
            )


def way_back(paused: ArmState, held: ImpedanceSetpoint, stamp: float, scan_period: float) -> ImpedanceSetpoint:
    """Return the setpoint at `stamp` on the straight way from where the arm was `paused` to the setpoint that it held
    before.
    """
    theta, length = (0.0, 0.0) if held.in_hand is None else (held.in_hand.theta, held.in_hand.length)
    tip, axis = end_point(paused.tcp, theta, length)
    share = min((stamp - paused.stamp) / RESUME_TIME, 1.0)
    mixed = axis + share * (held.axis - axis)
    return replace(
        held,
        tip=tip + share * (held.tip - tip),
        axis=mixed / float(np.linalg.norm(mixed)),
        twist=None,
        valid_until=stamp + 10.0 * scan_period,
    )


def require_tracking(arm: ArmState, held: ImpedanceSetpoint) -> None:
    """Make sure that the arm is close to its setpoint.

    Raises:
        TrackingError: It is blocked, or was told to be somewhere else altogether.
    """
    point = arm.tcp.position
    if held.in_hand is not None:
        point, _ = end_point(arm.tcp, held.in_hand.theta, held.in_hand.length)
    lag = math.dist(point, held.tip)
    if lag > TRACKING_LIMIT:
        raise TrackingError(
            f"arm: controlled point {lag * 1e3:.0f} mm from its setpoint > {TRACKING_LIMIT * 1e3:.0f} mm limit; "
            "it is blocked, or the setpoint cannot be reached"
        )


def require_finite_skin(frame: TaxelFrame) -> None:
    """Make sure that the stamp and every trusted taxel are numbers that a skin can give.

    Raises:
        NotFiniteError: One line that names the finger and the taxel.
    """
    if not math.isfinite(frame.stamp):
        raise NotFiniteError(f"skin: stamp: {frame.stamp}; a number needed")
    wrong = frame.trusted & ~(np.abs(frame.values) <= MOST_COUNTS)
    if wrong.any():
        finger, taxel = np.argwhere(wrong)[0]
        raise NotFiniteError(
            f"skin: {FINGER_NAMES[finger]} taxel {taxel}: {frame.values[finger, taxel]}; a number needed"
        )


def require_finite_hand(hand: GripperState) -> GripperState:
    """Return the state of a hand whose width is a number that a hand can have.

    Raises:
        NotFiniteError: It is not; one line.
    """
    if not abs(hand.width) <= WIDEST:
        raise NotFiniteError(f"hand: width: {hand.width}; a number needed")
    return hand


def require_finite_theta(pose: PegPose) -> None:
    """Make sure that theta is finite in an estimate that calls itself healthy.

    Raises:
        NotFiniteError: Theta is not finite.
    """
    if pose.healthy and not math.isfinite(pose.theta):
        raise NotFiniteError(f"theta: {pose.theta}; a number needed from the estimator of insert.estimator")


def require_level_skin(frame: TaxelFrame) -> None:
    """Make sure that no finger reads an offset all over: a peg presses only a part of it.

    Raises:
        SkinUntrustedError: One line that names the finger and its offset.
    """
    for name, values, trusted in zip(FINGER_NAMES, frame.values, frame.trusted, strict=True):
        told = np.sort(values[trusted])
        if not told.size:
            continue
        lowest, middle = float(told[(told.size - 1) // FREE_SHARE]), float(told[told.size // 2])
        offset = lowest if lowest > MOST_LEVEL else middle
        if lowest > MOST_LEVEL or middle < -MOST_LEVEL:
            raise SkinUntrustedError(
                f"skin: {name} finger: offset of {offset:.0f} counts all over; {MOST_LEVEL:.0f} allowed beside the peg: "
                "see its plug, then take a new baseline with the hand open"
            )
