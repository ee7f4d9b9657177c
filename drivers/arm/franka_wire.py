"""Conversion of a Franka arm's state from its maker's definitions to those of the contract; pure."""

from collections.abc import Sequence


def wrench_on_hand(
    reported: Sequence[float], pose: Sequence[float], stiffness: Sequence[float], tcp: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Return the external wrench on the hand at the tool centre point, base frame: force, N, and torque, N·m.

    libfranka reports the wrench of the robot on the environment, about the origin of the stiffness frame K: in
    `O_F_ext_hat_K` "forces applied by the robot to the environment are positive" (robot_state.h).

    Args:
        reported: `O_F_ext_hat_K`, three forces, N, and three torques, N·m.
        pose: `O_T_EE`, 16 numbers, column-major.
        stiffness: `EE_T_K`, 16 numbers, column-major.
        tcp: Tool centre point, m, base frame.
    """
    # F = -F_K;  tau = -tau_K + (p_K - p_tcp) x F;  p_K = p_EE + R_EE p_EE,K.
    fx, fy, fz = -reported[0], -reported[1], -reported[2]
    x, y, z = (
        pose[12 + i] + pose[i] * stiffness[12] + pose[4 + i] * stiffness[13] + pose[8 + i] * stiffness[14] - tcp[i]
        for i in range(3)
    )
    torque = [y * fz - z * fy - reported[3], z * fx - x * fz - reported[4], x * fy - y * fx - reported[5]]
    return [fx, fy, fz], torque
