"""Checks made at every scan, and the path back after a hold; pure."""

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel, Quantity, Source
from drivers.errors import NotFiniteError, ScanOverrunError, SkinUntrustedError
from drivers.frames import end_point
from drivers.parts import Fraction
from drivers.quantities import FINGER_NAMES, ArmState, ImpedanceSetpoint, TaxelFrame
from drivers.skin.layout import Layout, layout_of
from skills.tactile.pose import PegPose

OVERRUN_WINDOW = 100
"""Number of scans in the count of overruns."""
LONGEST_STEP = 3.0
"""Largest advance of a path in one scan, periods of the scan; a later scan slows the path. At the speed of a transfer the setpoint
then jumps by 7.5 mm, and the spring pulls the arm with 11 N. Source: chosen, not measured.
"""
FREE_SHARE = 5
"""Divisor of the number of a finger's taxels: at least one taxel in five is beside any peg."""
MOST_COUNTS = 65535.0
"""Largest reading of a taxel, counts: that of a 16-bit converter. Source: derived for 16 bits."""
WIDEST = 1.0
"""Largest distance between the pads of any hand, m. Source: chosen, not measured."""
RESUME_TIME = 1.0
"""Duration of the path from a hold back to the setpoint, s; slow, because the peg may have left the plate while the arm braked. Source: chosen, not measured."""


class ScanLimits(ConfigModel):
    """[scan]: limits on the lateness of scans; within these limits a late scan only slows the path."""

    late: Annotated[Fraction, Quantity("fraction"), Source("decision 0015")] = 0.8
    """Largest share of the last 100 scans that may take longer than two periods, fraction; a larger share is a fault."""
    longest: Annotated[float, Field(gt=0.0, le=1.0), Quantity("s"), Source("decision 0015")] = 0.2
    """Longest time from one scan to the next, s; if a scan exceeds it, the cell halts the arm and the run ends with a fault."""


@dataclass(frozen=True, slots=True)
class ScanSchedule:
    """Period of the scan, limits on its lateness, and a record of the late scans."""

    period: float
    """Period of the scan, s."""
    limits: ScanLimits = field(default_factory=ScanLimits)
    late: deque[bool] = field(default_factory=lambda: deque(maxlen=OVERRUN_WINDOW))
    """Lateness of the last scans: True if late."""


class ScanTiming:
    """Lateness of the scans, and advance of the path in each scan; every call of `ctx.scan` makes a new object."""

    def __init__(self, schedule: ScanSchedule) -> None:
        """Start before the first scan."""
        self._period, self._limits, self._late = schedule.period, schedule.limits, schedule.late
        self._before: float | None = None
        self.passed = schedule.period
        """Time since the previous scan, s, on the cell's clock; one period at the first scan."""
        self.step = schedule.period
        """Advance of the path time in this scan, s: the time since the previous scan, at most `LONGEST_STEP` periods."""
        self.due = schedule.period
        """Time of the next scan, s, on the cell's clock: one period after this scan, so that lost time is not made up."""

    def take(self, stamp: float) -> None:
        """Record the start of a scan on the cell's clock, s, and check the limits on lateness.

        Raises:
            ScanOverrunError: This scan is later than allowed, or too many of the last scans were late.
        """
        if self._before is not None:
            # The times of a simulated clock have rounding errors; `round` makes the time of a punctual scan exactly one period.
            self.passed = round(stamp - self._before, 9)
            self.step = min(self.passed, LONGEST_STEP * self._period)
        self._before, self.due = stamp, stamp + self._period
        is_late = self.passed > 2.0 * self._period
        self._late.append(is_late)
        if self.passed > self._limits.longest:
            raise ScanOverrunError(
                f"scan: {1e3 * self.passed:.0f} ms after the one before; scan.longest = {self._limits.longest:g} s allowed: "
                "stop other programs"
            )
        # Only a late scan increases the number of late scans, so only a late scan can exceed the limit.
        most = self._limits.late * OVERRUN_WINDOW
        if is_late and sum(self._late) > most + 1e-9:
            late = sum(self._late)
            self._late.clear()
            raise ScanOverrunError(
                f"scan: {late} of the last {OVERRUN_WINDOW} took longer than {2e3 * self._period:g} ms; "
                f"{most:.0f} allowed by scan.late: stop other programs, or lower scan_rate"
            )


def way_back(paused: ArmState, held: ImpedanceSetpoint, now: ArmState, scan_period: float) -> ImpedanceSetpoint:
    """Return the present setpoint on the straight path from the arm's `paused` state back to the `held` setpoint.

    In the null space, only the elbow joint returns to the held posture; the other joints are only damped, because after a
    fast motion they do not return to the held posture.
    """
    theta, length = (0.0, 0.0) if held.in_hand is None else (held.in_hand.theta, held.in_hand.length)
    tip, axis = end_point(paused.tcp, theta, length)
    share = min((now.stamp - paused.stamp) / RESUME_TIME, 1.0)
    mixed = axis + share * (held.axis - axis)
    return replace(
        held,
        tip=tip + share * (held.tip - tip),
        axis=mixed / float(np.linalg.norm(mixed)),
        twist=None,
        posture=None if held.posture is None else now.posture(float(held.posture[now.elbow])),
        valid_until=now.stamp + 10.0 * scan_period,
    )


def require_finite_skin(frame: TaxelFrame) -> None:
    """Check that the stamp and every trusted reading are plausible numbers.

    Raises:
        NotFiniteError: The stamp is not finite, or a reading is not plausible; the message names the finger and the taxel.
    """
    if not math.isfinite(frame.stamp):
        raise NotFiniteError(f"skin: stamp: {frame.stamp}; a number needed")
    wrong = frame.trusted & ~(np.abs(frame.values) <= MOST_COUNTS)
    if wrong.any():
        finger, taxel = np.argwhere(wrong)[0]
        raise NotFiniteError(
            f"skin: {FINGER_NAMES[finger]} taxel {taxel}: {frame.values[finger, taxel]}; a number needed"
        )


def require_finite_theta(pose: PegPose) -> None:
    """Check that theta of a healthy estimate is finite.

    Raises:
        NotFiniteError: Theta is not finite.
    """
    if pose.healthy and not math.isfinite(pose.theta):
        raise NotFiniteError(f"theta: {pose.theta}; a number needed from the estimator of insert.estimator")


def require_level_skin(frame: TaxelFrame, layout: Layout) -> None:
    """Check that no finger has an offset on all taxels; a peg presses only some of a finger's taxels.

    Args:
        frame: The frame.
        layout: Layout of the frame's taxels; it defines the largest reading beside a held peg.

    Raises:
        SkinUntrustedError: A finger has an offset; the message names the finger and the offset.
    """
    skin = layout_of(layout)
    most = skin.beside * skin.full_scale
    for name, values, trusted in zip(FINGER_NAMES, frame.values, frame.trusted, strict=True):
        told = values[trusted]
        if not told.size:
            continue
        told.sort()
        lowest, middle = float(told[(told.size - 1) // FREE_SHARE]), float(told[told.size // 2])
        offset = lowest if lowest > most else middle
        if lowest > most or middle < -most:
            raise SkinUntrustedError(
                f"skin: {name} finger: offset of {offset:.0f} counts on all taxels; {most:.0f} allowed beside the peg: "
                "check its plug, then take a new baseline with the hand open"
            )
