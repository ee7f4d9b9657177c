"""A setpoint as a fixed block of words, which compiled code and a real-time process can read; pure."""

import numpy as np

from drivers.quantities import ImpedanceSetpoint, Vector

WORDS = 45
ID, TIP, AXIS, STIFFNESS, DAMPING_RATIO, VALID_UNTIL = 0, 1, 4, 7, 13, 19
HAS_HAND, THETA, LENGTH = 20, 21, 22
HAS_ROLL, ROLL, TWIST, INTEGRAL_GAIN, INTEGRAL_LIMIT = 23, 24, 27, 33, 34
HAS_POSTURE, POSTURE = 35, 36
STAMP, IS_FREE = 43, 44


def pack(setpoint: ImpedanceSetpoint, stamp: float) -> Vector:
    """Return a setpoint as the words of the torque loop, shape (WORDS,).

    Args:
        setpoint: Setpoint for the arm.
        stamp: Time of its handover, s.
    """
    words = np.zeros(WORDS)
    words[ID] = setpoint.id
    words[TIP : TIP + 3] = setpoint.tip
    words[AXIS : AXIS + 3] = setpoint.axis
    words[STIFFNESS : STIFFNESS + 6] = setpoint.stiffness
    words[DAMPING_RATIO : DAMPING_RATIO + 6] = setpoint.damping_ratio
    words[VALID_UNTIL] = setpoint.valid_until
    if setpoint.in_hand is not None:
        words[HAS_HAND] = 1.0
        words[THETA] = setpoint.in_hand.theta
        words[LENGTH] = setpoint.in_hand.length
    if setpoint.roll is not None:
        words[HAS_ROLL] = 1.0
        words[ROLL : ROLL + 3] = setpoint.roll
    if setpoint.twist is not None:
        words[TWIST : TWIST + 3] = setpoint.twist.linear
        words[TWIST + 3 : TWIST + 6] = setpoint.twist.angular
    words[INTEGRAL_GAIN] = setpoint.integral_gain
    words[INTEGRAL_LIMIT] = setpoint.integral_limit
    if setpoint.posture is not None:
        words[HAS_POSTURE] = 1.0
        words[POSTURE:STAMP] = setpoint.posture
    words[STAMP] = stamp
    words[IS_FREE] = float(setpoint.is_free)
    return words
