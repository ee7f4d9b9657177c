"""Frames of the peg in the hand."""

import math

import numpy as np
import pytest

from drivers.frames import (
    UP,
    angle_between,
    compose,
    end_point,
    peg_in_finger,
    quaternion,
    rotation_about,
    rotation_of,
)
from drivers.quantities import Pose


@pytest.mark.parametrize("theta", [-1.2, -0.3, 0.0, 0.7, 1.5])
def test_the_transform_of_a_held_peg_is_rigid_along_its_axis(theta: float) -> None:
    T = peg_in_finger(theta, 0.05)
    np.testing.assert_allclose(T.rotation.T @ T.rotation, np.eye(3), atol=1e-15)
    assert np.linalg.det(T.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(T.position + 0.05 * T.rotation[:, 2], 0.0, atol=1e-15)


def test_the_end_point_is_the_composed_transform() -> None:
    T_base_tcp = Pose(np.array([0.4, -0.1, 0.3]), rotation_about(np.array([0.0, 0.6, 0.8]), 1.1))
    T = compose(T_base_tcp, peg_in_finger(-0.6, 0.05))
    tip, axis = end_point(T_base_tcp, -0.6, 0.05)
    np.testing.assert_allclose(tip, T.position, atol=1e-15)
    np.testing.assert_allclose(axis, T.rotation[:, 2], atol=1e-15)


def test_a_nanoradian_between_two_vectors_is_seen() -> None:
    assert angle_between(UP, np.array([1e-9, 0.0, 1.0])) == pytest.approx(1e-9, rel=1e-6)
    assert angle_between(UP, -UP) == pytest.approx(math.pi)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 2.0, math.pi])
def test_a_rotation_survives_its_quaternion(axis: tuple[float, float, float], angle: float) -> None:
    rotation = rotation_about(np.array(axis), angle)
    turned = np.array(quaternion(rotation))
    np.testing.assert_allclose(rotation_of(turned), rotation, atol=1e-15)
    assert (turned[0] >= 0.0, np.linalg.norm(turned)) == (True, pytest.approx(1.0))
