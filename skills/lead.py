"""Lead of the arm by the setpoints of the running skill."""

from dataclasses import replace

import numpy as np

from drivers.protocols import Arm
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.guards.passivity import SOFTENED
from skills.guards.rest import Rest


class Lead:
    """Setpoints sent to one arm, and its brake."""

    def __init__(self, arm: Arm) -> None:
        """Store the arm; nothing is sent to it."""
        self._arm = arm
        self._last_id = 0
        self._soft: tuple[int, Vector] | None = None
        """Id of the motion softened by the passivity guard, and its largest permitted stiffness, shape (6,)."""
        self.held: ImpedanceSetpoint | None = None
        """Setpoint sent last; None before the first of a run."""
        self.rest = Rest(arm)
        """Brake that brings the arm to rest."""

    def new_id(self) -> int:
        """Return an unused setpoint id; a new id resets the arm's integral."""
        self._last_id += 1
        return self._last_id

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Send `setpoint` to the arm and keep it.

        If the passivity guard has softened this motion, the stiffness is reduced first.
        """
        if self._soft is not None and setpoint.id == self._soft[0]:
            setpoint = replace(setpoint, stiffness=np.minimum(setpoint.stiffness, self._soft[1]))
        self.held = setpoint
        if self.rest.is_sought:
            self.rest.leave()
        self._arm.follow(setpoint)

    def soften(self, held: ImpedanceSetpoint) -> None:
        """Reduce the stiffness of the motion of `held` from its next setpoint on; once for each motion."""
        if self._soft is None or held.id != self._soft[0]:
            self._soft = held.id, SOFTENED * held.stiffness
