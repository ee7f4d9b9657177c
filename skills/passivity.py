"""A guard over the held setpoint: energy of the arm that it alone can have put in; pure.

Plates and pads only take energy. What the arm has beyond its planned motion came out of the springs of the held
setpoint, and a passive loop gives out no more than the little that errors and slips put in. A loop that is not
passive, because theta or the error is too old for the gains, pumps: the arm's energy grows from swing to swing. It is
measured against the one that presses with the force limit when the same spring stops it, m v²/2 = F²/(2 K), so that
the guard acts before the limit does. The classical observer sums force times velocity; at the rate of a scan that sum
is wrong for a fast oscillation, while kinetic energy shows in any two samples.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from drivers.quantities import ImpedanceSetpoint, Pose

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
    # Plain numbers: at every scan, arrays of three would cost ten times as much.
    p, q = before.position.tolist(), after.position.tolist()
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = before.rotation.tolist()
    (dx, dy, dz), (ex, ey, ez), (fx, fy, fz) = after.rotation.tolist()
    wrist = (q[0] - WRIST * dx, q[1] - WRIST * ex, q[2] - WRIST * fx)
    vx = (wrist[0] - p[0] + WRIST * ax) / period
    vy = (wrist[1] - p[1] + WRIST * bx) / period
    vz = (wrist[2] - p[2] + WRIST * cx) / period
    # Of after·before' the part that is no symmetric one.
    wx = (fx * bx + fy * by + fz * bz - ex * cx - ey * cy - ez * cz) / (2.0 * period)
    wy = (dx * cx + dy * cy + dz * cz - fx * ax - fy * ay - fz * az) / (2.0 * period)
    wz = (ex * ax + ey * ay + ez * az - dx * bx - dy * by - dz * bz) / (2.0 * period)
    if setpoint.twist is not None:
        theta, length = (0.0, 0.0) if setpoint.in_hand is None else (setpoint.in_hand.theta, setpoint.in_hand.length)
        c, s = length * math.cos(theta), length * math.sin(theta)
        lx, ly, lz = (-WRIST * x - c * x - s * y for x, y in ((dx, dy), (ex, ey), (fx, fy)))
        (tx, ty, tz), (ox, oy, oz) = setpoint.twist.linear.tolist(), setpoint.twist.angular.tolist()
        vx, vy, vz = vx - tx - oy * lz + oz * ly, vy - ty - oz * lx + ox * lz, vz - tz - ox * ly + oy * lx
        wx, wy, wz = wx - ox, wy - oy, wz - oz
    kx, ky, kz, rx, ry, rz = setpoint.stiffness.tolist()
    pushing = MASS * (kx * vx * vx + ky * vy * vy + kz * vz * vz) / force_limit**2
    turning = INERTIA * (rx * wx * wx + ry * wy * wy + rz * wz * wz) / (LEVER * force_limit) ** 2
    return float(pushing + turning)


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
