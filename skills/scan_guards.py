"""Checks that every scan makes, and the way back from a hold; pure."""

import math
from collections import deque
from dataclasses import replace

import numpy as np

from drivers.errors import NotFiniteError, ScanOverrunError, TrackingError
from drivers.frames import end_point
from drivers.quantities import FINGER_NAMES, ArmState, ImpedanceSetpoint, TaxelFrame
from skills.tactile.pose import PegPose

OVERRUN_WINDOW = 100
"""Number of scans over which overruns are counted."""
MOST_OVERRUNS = 5
"""Number of scans of the window that may take longer than two periods; the clock makes up for a single late scan."""
TRACKING_LIMIT = 0.1
"""Largest distance between the controlled point and its setpoint, m; the lead that skills push with stays below half of
it.
"""
RESUME_TIME = 1.0
"""Time of the way from a hold back to the setpoint, s; a peg that left the plate while the arm braked comes down on it
slowly.
"""


class Overruns:
    """Counts scans that came late; an occasional one does no harm, many in one window are a fault."""

    def __init__(self, scan_period: float) -> None:
        """Begin with no scan counted."""
        self._period, self._due = scan_period, math.inf
        self._late: deque[bool] = deque(maxlen=OVERRUN_WINDOW)

    def due_after(self, stamp: float) -> float:
        """Take the start of a scan, s, and return when the next one is due, s.

        Raises:
            ScanOverrunError: Too many of the last scans came late.
        """
        self._late.append(stamp > self._due + self._period)
        if sum(self._late) > MOST_OVERRUNS:
            raise ScanOverrunError(
                f"scan: {sum(self._late)} of the last {len(self._late)} took longer than "
                f"{2e3 * self._period:g} ms; {MOST_OVERRUNS} allowed: stop other programs, or lower scan_rate"
            )
        self._due = stamp + self._period
        return self._due


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
    """Make sure that every taxel that is trusted tells a number.

    Raises:
        NotFiniteError: One line that names the finger and the taxel.
    """
    wrong = frame.trusted & ~np.isfinite(frame.values)
    if wrong.any():
        finger, taxel = np.argwhere(wrong)[0]
        raise NotFiniteError(
            f"skin: {FINGER_NAMES[finger]} taxel {taxel}: {frame.values[finger, taxel]}; a number needed"
        )


def require_finite_theta(pose: PegPose) -> None:
    """Make sure that an estimate that calls itself healthy is a number.

    Raises:
        NotFiniteError: It is none.
    """
    if pose.healthy and not math.isfinite(pose.theta):
        raise NotFiniteError(f"theta: {pose.theta}; a number needed from the estimator of insert.estimator")
