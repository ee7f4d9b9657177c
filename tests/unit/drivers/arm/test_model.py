import tomllib

import numpy as np
import pytest

from cell.config.files import ARMS, arm_file
from drivers import impedance
from drivers.arm.model import read_arm
from drivers.errors import ConfigError

SHIPPED = sorted(ARMS.glob("*.toml"))


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_every_shipped_arm_is_a_whole_one_and_its_file_names_its_sources(file):
    arm = read_arm(file)
    assert 10.0 < sum(link.mass for link in arm.link) < 25.0
    assert "Source" in file.read_text(encoding="utf-8").split("name =")[0]


def test_the_second_finger_is_the_first_after_half_a_turn():
    finger = read_arm(arm_file("fr3")).hand.finger
    turn = np.diag([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(finger.turned().com, turn @ finger.com)
    np.testing.assert_allclose(finger.turned().tensor(), turn @ finger.tensor() @ turn.T)


@pytest.mark.parametrize(
    ("line", "wrong", "told"),
    [
        ("stroke = 0.08", "stroke = 80.0", "hand.stroke"),
        ("elbow = 3", "elbow = 8", "kinematics.elbow"),
        ("flange = 0.107", "", "kinematics.flange"),
        ("inertia = [0.70337,", "inertia = [-0.70337,", "not positive definite"),
        ("q_min = [-2.8973,", "q_min = [2.8973,", "q_min of joint 1"),
        ("home = [-0.45,", "home = [-3.0,", "home of joint 1 = -3.0: -2.8973 to 2.8973 allowed"),
        ("alpha = [0.0,", "alpha = [", "kinematics.alpha"),
        ("[joints]", "[joints", "not TOML"),
    ],
)
def test_figures_that_no_arm_has_are_told_in_one_line(tmp_path, line, wrong, told):
    text = arm_file("panda").read_text(encoding="utf-8")
    assert line in text
    file = tmp_path / "bent.toml"
    file.write_text(text.replace(line, wrong), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        read_arm(file)
    assert str(raised.value).startswith(f"{file}: ")
    assert told in str(raised.value)
    assert "\n" not in str(raised.value)


def test_every_arm_is_a_file_of_its_own():
    names = [tomllib.loads(file.read_text(encoding="utf-8"))["name"] for file in SHIPPED]
    assert len(set(names)) == len(names) >= 2


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_the_hand_is_never_further_from_the_shoulder_than_the_reach(file):
    arm, rng = read_arm(file), np.random.default_rng(1)
    words = impedance.figures(arm)
    joints = rng.uniform(arm.joints.q_min, arm.joints.q_max, (500, 7))
    distances = [np.linalg.norm(impedance.forward(words, q)[0] - arm.shoulder()) for q in joints]
    assert 0.8 * arm.reach() < max(distances) < arm.reach()


def test_fingers_of_ones_own_are_stated_over_a_shipped_arm(tmp_path):
    file, shipped = tmp_path / "own.toml", read_arm(arm_file("fr3"))
    own = "finger = { mass = 0.05, com = [0.0, 0.01, -0.02], inertia = [1e-5, 1e-5, 1e-6, 0.0, 0.0, 0.0] }"
    file.write_text(f'base = "{arm_file("fr3")}"\n[hand]\nstroke = 0.07\n{own}\n', encoding="utf-8")
    arm = read_arm(file)
    assert (arm.hand.stroke, arm.hand.finger.mass) == (0.07, 0.05)
    assert (arm.hand.body, arm.link) == (shipped.hand.body, shipped.link)


def test_a_base_that_is_missing_is_told_in_one_line(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text('base = "none.toml"\n', encoding="utf-8")
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file or directory"):
        read_arm(file)
