"""Passivity guard: it limits the kinetic energy that the held setpoint puts into the arm; pure.

Plates and pads only dissipate energy. Kinetic energy beyond the planned motion comes from the springs of the held
setpoint. A passive loop releases little more energy than errors and slips put in. If theta or the error is too old for
the gains, the loop is not passive: the arm's energy grows with each oscillation.

The limit is the energy of a motion that reaches the force limit when the same spring stops it, m v²/2 = F²/(2 K).
The guard therefore acts before the force limit does. The classical passivity observer sums force times velocity. At the
scan rate, that sum is wrong for a fast oscillation, but any two samples give the kinetic energy.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from drivers.quantities import ImpedanceSetpoint, Pose

WRIST = 0.15
"""Distance behind the finger centre at which the arm's translational and rotational inertia decouple, m. Source: chosen, not measured."""
MASS = 5.0
"""Mass of the arm at the decoupling point, kg; 4 to 9 kg in the simulated arm over poses and directions, with the hand
free to turn or not. Source: measured on the simulated arm.
"""
INERTIA = 0.03
"""Inertia of the arm about the decoupling point, kg·m²; 0.007 to 0.08 kg·m² in the simulated arm over poses and directions. Source: measured on the simulated arm."""
LEVER = 0.1
"""Lever arm: the torque limit of the rotational spring is the force limit times this, m. Source: chosen, not measured."""
SOFTEN, STOP = 0.75, 1.0
"""Shares of the energy at the force limit at which the guard softens the motion and stops it, fraction."""
SOFTENED = 0.5
"""Factor on the stiffness for the rest of a softened motion, fraction."""


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
    # Plain numbers: arrays of three would take ten times as long at every scan.
    p, q = before.position.tolist(), after.position.tolist()
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = before.rotation.tolist()
    (dx, dy, dz), (ex, ey, ez), (fx, fy, fz) = after.rotation.tolist()
    wrist = (q[0] - WRIST * dx, q[1] - WRIST * ex, q[2] - WRIST * fx)
    vx = (wrist[0] - p[0] + WRIST * ax) / period
    vy = (wrist[1] - p[1] + WRIST * bx) / period
    vz = (wrist[2] - p[2] + WRIST * cx) / period
    # R = after·beforeᵀ; omega = [R32 - R23, R13 - R31, R21 - R12] / (2 period), for small angles
    wx = (fx * bx + fy * by + fz * bz - ex * cx - ey * cy - ez * cz) / (2.0 * period)
    wy = (dx * cx + dy * cy + dz * cz - fx * ax - fy * ay - fz * az) / (2.0 * period)
    wz = (ex * ax + ey * ay + ez * az - dx * bx - dy * by - dz * bz) / (2.0 * period)
    if setpoint.twist is not None:
        # Planned velocity at the wrist, with l from the tip to the wrist: v - (v_tip + omega_plan x l), omega - omega_plan
        theta, length = (0.0, 0.0) if setpoint.in_hand is None else (setpoint.in_hand.theta, setpoint.in_hand.length)
        c, s = length * math.cos(theta), length * math.sin(theta)
        lx, ly, lz = -WRIST * dx - c * dx - s * dy, -WRIST * ex - c * ex - s * ey, -WRIST * fx - c * fx - s * fy
        (tx, ty, tz), (ox, oy, oz) = setpoint.twist.linear.tolist(), setpoint.twist.angular.tolist()
        vx, vy, vz = vx - tx - oy * lz + oz * ly, vy - ty - oz * lx + ox * lz, vz - tz - ox * ly + oy * lx
        wx, wy, wz = wx - ox, wy - oy, wz - oz
    # m v²/2 over F²/(2 K), summed over the axes, and I omega²/2 over (LEVER F)²/(2 K_r)
    kx, ky, kz, rx, ry, rz = setpoint.stiffness.tolist()
    pushing = MASS * (kx * vx * vx + ky * vy * vy + kz * vz * vz) / force_limit**2
    turning = INERTIA * (rx * wx * wx + ry * wy * wy + rz * wz * wz) / (LEVER * force_limit) ** 2
    return float(pushing + turning)


@dataclass(slots=True)
class PassivityGuard:
    """Guard over successive scans; one high scan is an impact, two in a row are an oscillation."""

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
