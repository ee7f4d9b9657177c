"""The Franka Emika Panda as published: kinematics, limits, home, hand. Masses are the stand-in's affair.

Sources: the maker's control-interface specification (modified Denavit-Hartenberg figures, limits).
"""

import numpy as np

from drivers.quantities import Vector

JOINTS = 7

DH_A: Vector = np.array([0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088])
DH_D: Vector = np.array([0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0])
DH_ALPHA: Vector = np.pi / 2 * np.array([0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
"""Craig's convention, joints 1 to 7: a and alpha of the link before, d of the joint, m and rad."""
FLANGE_D = 0.107
"""From the frame of joint 7 to the flange, along z, m."""

Q_MIN: Vector = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
Q_MAX: Vector = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
"""rad."""
TORQUE_MAX: Vector = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
"""N·m."""
TORQUE_RATE_MAX = 1000.0
"""N·m/s; exceeding it aborts the motion on the real arm."""

FRICTION: Vector = np.array([0.546, 0.872, 0.641, 1.279, 0.839, 0.303, 0.565])
"""Coulomb-like amplitudes of the joints, N·m; Gaz et al. 2019."""

HAND_TURN = -np.pi / 4
"""Rotation of the hand about the flange's z, rad."""
FINGER_CENTRE = 0.1034
"""From the flange to the middle between the pads, along z, m: 58.4 mm to the fingers' base, 45 mm to the pads' middle."""
HAND_STROKE = 0.08
"""Largest distance between the pads, m."""
CONTROL_PERIOD = 0.001
"""Of the torque loop, s."""
