"""A setpoint for an arm in free space."""

import numpy as np

from drivers.quantities import ArmState, ImpedanceSetpoint


def risen(state: ArmState, rise: float, valid_until: float) -> ImpedanceSetpoint:
    """Return the setpoint that holds the hand `rise`, m, above its place, stiff and without a peg."""
    return ImpedanceSetpoint(
        id=1,
        tip=state.tcp.position + np.array([0.0, 0.0, rise]),
        axis=-state.tcp.rotation[:, 0],
        stiffness=np.array([1500.0] * 3 + [60.0] * 3),
        damping_ratio=np.ones(6),
        valid_until=valid_until,
    )
