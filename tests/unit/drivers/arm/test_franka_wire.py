"""The wrench on the hand, from the state that a Franka arm reports."""

import numpy as np
import pytest

from drivers.arm.franka_wire import wrench_on_hand
from drivers.frames import UP

IDENTITY = np.eye(4).T.flatten()
AT = np.array([0.5, 0.1, 0.3])


def pose(position, rotation=None):
    """Return a transform as libfranka writes it: 16 numbers, column-major."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    matrix[:3, :3] = np.eye(3) if rotation is None else rotation
    return matrix.T.flatten()


def test_force_and_torque_of_the_arm_on_the_environment_are_reversed():
    # Source: robot_state.h, forces of the robot on the environment are positive; the hand presses with 10 N along -z.
    force, torque = wrench_on_hand([0.0, 0.0, -10.0, 1.0, -2.0, 3.0], pose(AT), IDENTITY, AT)
    assert (force, torque) == ([0.0, 0.0, 10.0], [-1.0, 2.0, -3.0])


def test_the_torque_is_taken_about_the_tool_centre_point():
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    k_in_ee = np.array([0.02, 0.0, 0.05])
    reported = np.array([4.0, -3.0, -10.0, 0.5, 0.2, -0.1])
    force, torque = wrench_on_hand(reported, pose(AT, turned), pose(k_in_ee), AT + 0.1 * UP)
    lever = turned @ k_in_ee - 0.1 * UP
    assert force == pytest.approx(-reported[:3])
    assert torque == pytest.approx(-reported[3:] + np.cross(lever, -reported[:3]))
