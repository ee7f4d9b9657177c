"""Check of the arm's calibration against the joint torques of a run; pure."""

import logging

import numpy as np

from drivers.arm.calibration import ArmCalibration
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation

logger = logging.getLogger(__name__)

MOVING = 0.03
"""Joint speed above which the joint's torque contains its full friction, rad/s."""


class ArmWatch:
    """Compares each joint's torque with its calibration, in scans of free motion.

    Means over one direction of motion are compared: the torque that accelerates rotors then cancels the torque that
    decelerates them.
    """

    def __init__(self, calibration: ArmCalibration | None, arm: ArmModel) -> None:
        """Store the calibration; if it is None, nothing is compared. `arm` is the model of the same arm."""
        self._calibration = calibration
        self._told = ""
        if calibration is not None:
            deviations = calibration.believed(arm)[1][:, :3]
            # Largest permitted deviation of the mean torque in one direction of motion, shape (7,), N·m: three standard
            # deviations of the calibration's prior.
            self._most = 3.0 * np.sqrt((deviations**2).sum(axis=1))
        self.begin()

    def begin(self) -> None:
        """Begin a run."""
        self._sums, self._counts = np.zeros((2, JOINTS)), np.zeros((2, JOINTS))

    def see(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan and its setpoint."""
        if self._calibration is None or setpoint is None or not setpoint.is_free or seen.arm.unexplained is None:
            return
        apart = seen.arm.unexplained - self._calibration.predicted(seen.arm.dq)
        for sense, is_moving in enumerate((seen.arm.dq < -MOVING, seen.arm.dq > MOVING)):
            self._sums[sense] += np.where(is_moving, apart, 0.0)
            self._counts[sense] += is_moving

    def end(self) -> str:
        """Return the largest misfit of the run, one line, empty if every joint fits; without enough motion, return the last verdict."""
        # A joint is judged after at least this many scans of motion in one direction; one transfer has about as many.
        is_judged = self._counts >= 50
        if self._calibration is None or not is_judged.any():
            return self._told
        means = np.where(is_judged, self._sums / np.maximum(self._counts, 1.0), 0.0)
        shares = np.abs(means) / self._most
        sense, joint = np.unravel_index(int(np.argmax(shares)), shares.shape)
        self._told = ""
        if shares[sense, joint] > 1.0:
            self._told = (
                f"calibration.arm of {self._calibration.date} does not fit: joint {joint + 1} deviates by {means[sense, joint]:+.2f} N·m;"
                f" {self._most[joint]:.2f} N·m allowed: run `cell calibrate arm`"
            )
            logger.warning("%s", self._told)
        return self._told
