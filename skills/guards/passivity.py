"""Passivity guard: it limits the kinetic energy that the held setpoint puts into the arm; pure.

Plates and pads only dissipate energy. Kinetic energy beyond that of the planned motion comes from the springs of the held
setpoint. A passive loop releases little more energy than errors and slips have stored in the springs. If the delay of theta
or of the position error is too long for the gains, the loop is not passive: the arm's energy grows with each oscillation.

The limit is the energy of a motion that reaches the force limit F when the same spring stops it, m v²/2 = F²/(2 K).
The guard therefore acts before the force limit does. The classical passivity observer sums force times velocity. At the
scan rate, that sum is wrong for a fast oscillation; the kinetic energy needs only two successive samples.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from drivers.quantities import ImpedanceSetpoint, Pose, Twist

SOFTEN, STOP = 0.75, 1.0
"""Shares of the energy at the force limit above which the guard softens the motion, and above which it stops it, fraction."""
SOFTENED = 0.5
"""Factor on the stiffness for the rest of a softened motion, fraction."""
AT_REST = Twist(np.zeros(3), np.zeros(3))
"""Planned motion of a setpoint without a twist."""


class PassivityVerdict(IntEnum):
    """Decision of the guard."""

    PASSIVE = 0
    SOFTEN = 1
    STOP = 2


def share_of_limit(setpoint: ImpedanceSetpoint, before: Pose, after: Pose, period: float, force_limit: float) -> float:
    """Return the kinetic energy of the arm's deviation from the planned motion, fraction of the energy at the force limit.

    Args:
        setpoint: Setpoint held between the two samples.
        before: T_base_tcp at the first sample.
        after: T_base_tcp at the second sample.
        period: Time between the samples, s.
        force_limit: Largest external force at the TCP, N.
    """
    from skills.guards.deviation import energy  # imports the compiler, which only a moving arm needs

    twist, hand = setpoint.twist or AT_REST, setpoint.in_hand
    theta, length = (0.0, 0.0) if hand is None else (hand.theta, hand.length)
    planned = setpoint.stiffness, twist.linear, twist.angular, theta, length
    share: float = energy(
        *planned, before.position, before.rotation, after.position, after.rotation, period, force_limit
    )
    return share


@dataclass(slots=True)
class PassivityGuard:
    """Guard over successive scans; high energy in one scan is an impact, in two successive scans an oscillation."""

    force_limit: float
    """Largest external force at the TCP, N."""
    share: float = 0.0
    """Kinetic energy in the last scan, fraction of the energy at the force limit."""
    _before: tuple[float, Pose] | None = None

    def update(self, setpoint: ImpedanceSetpoint | None, tcp: Pose, stamp: float) -> PassivityVerdict:
        """Process one scan and return the decision.

        Args:
            setpoint: Setpoint held since the previous scan; None if there was none.
            tcp: T_base_tcp now.
            stamp: Time, s.
        """
        before, self._before = self._before, (stamp, tcp)
        if setpoint is None or before is None or stamp <= before[0]:
            self.share = 0.0
            return PassivityVerdict.PASSIVE
        last, self.share = self.share, share_of_limit(setpoint, before[1], tcp, stamp - before[0], self.force_limit)
        if not (last > SOFTEN and self.share > SOFTEN):
            return PassivityVerdict.PASSIVE
        return PassivityVerdict.STOP if last > STOP and self.share > STOP else PassivityVerdict.SOFTEN
