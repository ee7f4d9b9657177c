"""Whether the arm's calibration still fits what the arm does in a run; pure."""

import logging

import numpy as np

from drivers.arm.calibration import ArmCalibration
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation

logger = logging.getLogger(__name__)

MOVING = 0.03
"""Velocity from which on a joint's torque tells of its friction, rad/s."""
LEAST_SCANS = 50
"""Number of scans in which a joint has to have moved in one sense before it is judged: those of one transfer."""
MOST_APART = 3.0
"""Standard deviations, of those that learning begins with, by which the torque in one sense may differ in the mean."""


class ArmWatch:
    """Compares, in every scan in which nothing touches the hand, the torque that each joint takes with what its calibration says.

    Means over one sense of motion are compared, so that the inertia of rotors, which speeds up as often as it slows down, cancels out.
    """

    def __init__(self, calibration: ArmCalibration | None, arm: ArmModel) -> None:
        """Take the calibration, if there is one, and the figures of its arm."""
        self._calibration = calibration
        self._told = ""
        if calibration is not None:
            deviations = calibration.believed(arm)[1][:, :3]
            self._most = MOST_APART * np.sqrt((deviations**2).sum(axis=1))
        self.begin()

    def begin(self) -> None:
        """Begin a run."""
        self._sums, self._counts = np.zeros((2, JOINTS)), np.zeros((2, JOINTS))

    def see(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Take one scan with the setpoint that was held."""
        if self._calibration is None or setpoint is None or not setpoint.is_free or seen.arm.unexplained is None:
            return
        apart = seen.arm.unexplained - self._calibration.predicted(seen.arm.dq)
        for sense, is_moving in enumerate((seen.arm.dq < -MOVING, seen.arm.dq > MOVING)):
            self._sums[sense] += np.where(is_moving, apart, 0.0)
            self._counts[sense] += is_moving

    def end(self) -> str:
        """Judge the run, and return what does not fit; one that hardly moved the arm leaves the verdict as it was."""
        is_judged = self._counts >= LEAST_SCANS
        if self._calibration is None or not is_judged.any():
            return self._told
        means = np.where(is_judged, self._sums / np.maximum(self._counts, 1.0), 0.0)
        shares = np.abs(means) / self._most
        sense, joint = np.unravel_index(int(np.argmax(shares)), shares.shape)
        self._told = ""
        if shares[sense, joint] > 1.0:
            self._told = (
                f"calibration.arm of {self._calibration.date} does not fit: joint {joint + 1} takes {means[sense, joint]:+.2f} N·m beside it;"
                f" {self._most[joint]:.2f} N·m allowed: run `cell calibrate arm`"
            )
            logger.warning("%s", self._told)
        return self._told
