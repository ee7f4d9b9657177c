"""A guard over the held setpoint: energy of the arm that it alone can have put in; pure.

Plates and pads only take energy. What the arm has beyond its planned motion came out of the springs of the held
setpoint, and a passive loop gives out no more than the little that errors and slips put in. A loop that is not
passive, because theta or the error is too old for the gains, pumps: the arm's energy grows from swing to swing. It is
measured against the one that presses with the force limit when the same spring stops it, m v²/2 = F²/(2 K), so that
the guard acts before the limit does. The classical observer sums force times velocity; at the rate of a scan that sum
is wrong for a fast oscillation, while kinetic energy shows in any two samples.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from drivers.frames import end_point
from drivers.quantities import ImpedanceSetpoint, Pose, Vector

WRIST = 0.15
"""So far behind the finger centre the arm's inertia falls into a mass and a moment that hardly know of each other, m."""
MASS = 5.0
"""Of the arm there, kg; 4 to 9 in the simulated one over poses and directions, the hand free to turn or not."""
INERTIA = 0.03
"""About that point, kg·m²; 0.007 to 0.08 likewise."""
LEVER = 0.1
"""The force limit times this is the most torque that a spring in rotation may come to, m."""
SOFTEN, STOP = 0.75, 1.0
"""Shares of the energy at the force limit."""
SOFTENED = 0.5
"""Of the stiffness, for the rest of the motion."""


class Verdict(IntEnum):
    """What the guard asks for."""

    PASSIVE = 0
    SOFTEN = 1
    STOP = 2


def share_of_limit(setpoint: ImpedanceSetpoint, before: Pose, after: Pose, period: float, force_limit: float) -> float:
    """Return the energy of the arm's motion beyond the planned one, as a share of the energy at the force limit.

    Args:
        setpoint: Held in between.
        before: T_base_tcp.
        after: T_base_tcp, `period` later.
        period: s.
        force_limit: N.
    """
    wrist = [tcp.position - WRIST * tcp.rotation[:, 0] for tcp in (before, after)]
    linear = (wrist[1] - wrist[0]) / period
    turn = after.rotation @ before.rotation.T
    angular = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (2.0 * period)
    if setpoint.twist is not None:
        theta, length = (0.0, 0.0) if setpoint.in_hand is None else (setpoint.in_hand.theta, setpoint.in_hand.length)
        tip, _ = end_point(after, theta, length)
        linear = linear - setpoint.twist.linear - np.cross(setpoint.twist.angular, wrist[1] - tip)
        angular = angular - setpoint.twist.angular
    K: Vector = setpoint.stiffness
    return float(
        MASS * (K[:3] * linear**2).sum() / force_limit**2
        + INERTIA * (K[3:] * angular**2).sum() / (LEVER * force_limit) ** 2
    )


@dataclass(slots=True)
class PassivityGuard:
    """Watches one scan after the other; a single one is a knock, two in a row are a swing."""

    force_limit: float
    """N."""
    share: float = 0.0
    """Of the energy at the force limit, in the last scan."""
    _before: tuple[float, Pose] | None = None

    def update(self, setpoint: ImpedanceSetpoint | None, tcp: Pose, stamp: float) -> Verdict:
        """Take one scan.

        Args:
            setpoint: Held since the scan before; None when none was.
            tcp: T_base_tcp now.
            stamp: Time, s.
        """
        before, self._before = self._before, (stamp, tcp)
        if setpoint is None or before is None or stamp <= before[0]:
            self.share = 0.0
            return Verdict.PASSIVE
        last, self.share = (
            self.share,
            share_of_limit(setpoint, before[1], tcp, stamp - before[0], self.force_limit),
        )
        lasting = min(last, self.share)
        return Verdict.STOP if lasting > STOP else Verdict.SOFTEN if lasting > SOFTEN else Verdict.PASSIVE
