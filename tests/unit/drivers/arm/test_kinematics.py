import numpy as np
import pytest

from cell.config.files import arm_file
from drivers import impedance
from drivers.arm.kinematics import joints_at, links
from drivers.arm.model import read_arm
from drivers.part.round import Round

ELBOW, LENGTH = 0.1, 0.05


@pytest.fixture(params=["panda", "fr3"])
def arm(request):
    return read_arm(arm_file(request.param))


def test_the_links_are_where_the_laws_own_kinematics_have_them(arm):
    q = np.array(arm.home) + 0.1
    rotations, origins = links(arm, q)
    _, _, axes, places = impedance.forward(impedance.figures(arm), q)
    np.testing.assert_allclose([R[:, 2] for R in rotations], axes, atol=1e-12)
    np.testing.assert_allclose(origins, places, atol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.7854])
def test_the_joints_found_hold_the_peg_as_asked_within_their_limits(arm, tilt):
    tip, (axis, closing) = np.array([0.5, 0.03, 0.1]), Round(0.008).leaning(0.4, tilt)
    q = joints_at(arm, tip, axis, closing, LENGTH, ELBOW)
    position, finger, _, _ = impedance.forward(impedance.figures(arm), q)
    np.testing.assert_allclose(position + LENGTH * finger[:, 0], tip, atol=1e-8)
    np.testing.assert_allclose(finger[:, 0], -axis, atol=1e-8)
    np.testing.assert_allclose(finger[:, 2], closing, atol=1e-8)
    assert q[arm.kinematics.elbow - 1] == ELBOW
    assert (q >= arm.joints.q_min).all()
    assert (q <= arm.joints.q_max).all()


@pytest.mark.parametrize("tip", [[1.2, 0.0, 0.1], [0.5, 0.0, -0.6]])
def test_what_the_arm_does_not_reach_has_no_joints(arm, tip):
    axis, closing = Round(0.008).leaning(0.0, 0.0)
    assert joints_at(arm, np.array(tip), axis, closing, LENGTH, ELBOW) is None
