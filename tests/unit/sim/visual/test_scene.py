"""The scene of the pictures: posed as the figures say, and out of the physics' sight."""

import numpy as np
import pytest

from cell.config.files import ARMS
from cell.run.record import scene_facts
from drivers.arm.kinematics import finger_frame
from drivers.arm.model import read_arm
from drivers.frames import rotation_about
from drivers.quantities import Pose
from sim.visual.scene import Moment, Stage

HOLE = Pose(np.array([0.51, -0.02, 0.1]), rotation_about(np.array([0.6, 0.8, 0.0]), 0.02))


@pytest.fixture(params=["panda", "fr3"])
def facts(request, loaded):
    """Return the facts of the shipped cell's scene, with each of the shipped arms."""
    return scene_facts(loaded.cell).model_copy(update={"arm": read_arm(ARMS / f"{request.param}.toml")})


def moment(joints, width=0.03, peg=None):
    """Return a moment with an untouched skin."""
    return Moment(joints=joints, width=width, peg=peg, taxels=np.zeros((2, 20)))


def test_the_pads_are_where_the_arms_figures_put_them(facts):
    stage = Stage(facts, HOLE)
    for joints in np.random.default_rng(3).uniform(facts.arm.joints.q_min, facts.arm.joints.q_max, (20, 7)):
        stage.pose(moment(joints))
        centre = finger_frame(facts.arm, joints)
        left, right = (stage.data.body(name).xpos for name in ("left", "right"))
        np.testing.assert_allclose((left + right) / 2, centre.position, atol=1e-12)
        np.testing.assert_allclose(left - right, 0.03 * centre.rotation[:, 2], atol=1e-12)


def test_the_peg_is_where_it_was_recorded(facts):
    stage = Stage(facts, HOLE)
    peg = Pose(np.array([0.4, 0.1, 0.3]), rotation_about(np.array([0.0, 1.0, 0.0]), 0.5))
    stage.pose(moment(np.array(facts.arm.home), peg=peg))
    np.testing.assert_allclose(stage.data.body("peg").xpos, peg.position, atol=1e-12)
    np.testing.assert_allclose(stage.data.body("peg").xmat.reshape(3, 3), peg.rotation, atol=1e-12)


@pytest.mark.parametrize("hole", [HOLE, None], ids=["hole", "solid"])
def test_nothing_in_the_scene_can_touch_anything(facts, hole):
    model = Stage(facts, hole).model
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()
