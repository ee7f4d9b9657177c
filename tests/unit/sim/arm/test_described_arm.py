"""Arms that other people described, on the joints of the cell's models."""

import math

import mujoco
import numpy as np
import pytest

from cell.config.files import ARMS
from drivers import frames
from drivers.arm.kinematics import finger_frame
from drivers.arm.model import JOINTS, read_arm
from drivers.errors import ConfigError
from sim.arm import described_arm
from sim.arm.arm_truth import ideal
from sim.config import DescribedArmConfig
from sim.world import scene

ARM = read_arm(ARMS / "fr3.toml")
TURNS = (0.3, -1.1, 0.7, 2.0, -0.4, 1.3, 0.9)
"""Turns of the described links' frames about their joints, rad, and shifts along them, m: frames are the author's choice."""
SHIFTS = (0.05, -0.1, 0.02, 0.0, 0.08, -0.03, 0.01)
EVERYTHING = ("kinematics", "inertia", "friction", "rotors", "gravity")


def frame(i: int) -> tuple[np.ndarray, np.ndarray]:
    return frames.rotation_about(frames.UP, TURNS[i]), np.array([0.0, 0.0, SHIFTS[i]])


def words(values) -> str:
    return " ".join(f"{value:.15g}" for value in values)


def quat(R) -> str:
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, np.asarray(R).flatten())
    return words(out)


def description(heavier: float = 1.0, joints: int = JOINTS, base: float = 0.0, extra: str = "") -> str:
    """Return the FR3 with the link frames elsewhere, links `heavier` times as heavy, and a flange that is turned as a hand."""
    dh = ARM.kinematics
    R, at = frame(joints - 1)
    place, turned = R.T @ (np.array([0.0, 0.0, dh.flange]) - at), R.T @ frames.rotation_about(frames.UP, math.pi / 4)
    text = f'<body name="flange" pos="{words(place)}" quat="{quat(turned)}"><geom size="0.1" mass="3"/>{extra}</body>'
    for i in reversed(range(joints)):
        link, (R, at) = ARM.link[i], frame(i)
        tensor = heavier * (R.T @ link.tensor() @ R)
        six = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
        lean = frames.rotation_about(np.array([1.0, 0.0, 0.0]), dh.alpha[i])
        pose = lean @ R, np.array([dh.a[i], 0.0, 0.0]) + lean @ (np.array([0.0, 0.0, dh.d[i]]) + at)
        if i:
            before, origin = frame(i - 1)
            pose = before.T @ pose[0], before.T @ (pose[1] - origin)
        else:
            pose = pose[0], pose[1] + [base, 0.0, 0.0]
        text = f"""<body name="part{i}" pos="{words(pose[1])}" quat="{quat(pose[0])}">
          <inertial mass="{heavier * link.mass}" pos="{words(R.T @ (np.array(link.com) - at))}" fullinertia="{words(six)}"/>
          <joint axis="0 0 1" range="-2 2" frictionloss="{i + 1}" damping="0.5" armature="0.{i + 1}"/>
          <geom type="mesh" mesh="nowhere"/>{text}</body>"""
    return f"""<mujoco><compiler angle="radian"/><asset><mesh name="nowhere" file="nowhere.stl"/></asset>
        <worldbody>{text}</worldbody></mujoco>"""


@pytest.fixture
def written(tmp_path):
    def write(text: str, **keys):
        (tmp_path / "arm.xml").write_text(text)
        return described_arm.read(DescribedArmConfig(file=tmp_path / "arm.xml", **keys), ARM)

    return write


def held(truth):
    """Return the arm of the held model, with an empty hand in place of peg and plate."""
    arm = scene._arm(truth, 5e-4, 1e-9, '<body name="grip" pos="0 0 0.1034"/>')
    return scene._compile("", truth, arm, "", "", 5e-4)


def mass_matrix(model, q):
    data, M = mujoco.MjData(model), np.empty((JOINTS, JOINTS))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, M)
    return M - np.diag(model.dof_armature), data


@pytest.mark.parametrize("takes", [EVERYTHING, ("kinematics", "inertia"), ("inertia",), ("kinematics",)])
def test_the_cell_moves_as_the_description_wherever_its_frames_lie(written, takes):
    heavier = 1.3 if "inertia" in takes else 1.0
    arm = written(description(heavier), takes=takes)
    truth = arm.true(ideal(ARM), np.ones(JOINTS))
    nothing = ideal(ARM.model_copy(update={"link": tuple(_heavier(link, heavier) for link in ARM.link)}))
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (5, JOINTS)):
        mine, data = mass_matrix(held(truth), q)
        assert mine == pytest.approx(mass_matrix(held(nothing), q)[0], abs=1e-5)
        centre = finger_frame(ARM, q).position
        assert data.body("grip").xpos == pytest.approx(centre, abs=1e-9)
        assert arm.tcp(ARM, q).position == pytest.approx(centre, abs=1e-9)
        assert arm.tcp(ARM, q).rotation == pytest.approx(finger_frame(ARM, q).rotation, abs=1e-9)


def _heavier(link, factor):
    six = tuple(factor * value for value in link.inertia)
    return link.model_copy(update={"mass": factor * link.mass, "inertia": six})


@pytest.mark.parametrize("takes", [EVERYTHING, ("inertia", "gravity"), ("kinematics", "gravity")])
def test_what_the_believed_weights_do_not_compensate_is_left_over(written, takes):
    from cell.lab.opinion import gravity_torque

    factor = 1.5 if "inertia" in takes else 1.0
    truth = written(description(1.5), takes=takes).true(ideal(ARM), np.ones(JOINTS))
    model = held(truth)
    for q in np.random.default_rng(2).uniform(-1.5, 1.5, (5, JOINTS)):
        left = described_arm.left_over(model, mujoco.MjData(model), q)
        assert left == pytest.approx((1.0 - factor) * gravity_torque(ARM, q), abs=1e-3)


def test_friction_and_rotors_are_those_of_the_description(written):
    arm = written(description())
    truth = arm.true(ideal(ARM), np.full(JOINTS, 2.0))
    assert truth.friction.dry == (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0)
    assert truth.friction.viscous == pytest.approx([1.0] * JOINTS)
    assert truth.rotor_inertia == pytest.approx([0.1 * (i + 1) for i in range(JOINTS)])
    assert (arm.flange, arm.turn) == ("flange", pytest.approx(math.pi / 4))
    drawn = ideal(ARM)  # rotors that nobody described stay as drawn
    bare = written(description().replace('armature="0.', 'armature="0" user="0.'))
    assert bare.true(drawn, np.ones(JOINTS)).rotor_inertia == drawn.rotor_inertia


@pytest.mark.parametrize(
    ("text", "keys", "said"),
    [
        ("<robot", {}, "not an arm that MuJoCo reads"),
        (
            "<mujoco><worldbody/></mujoco>",
            {},
            "flange; a body or site with a name, of which the file has none, allowed",
        ),
        (description(joints=6), {}, "6 joints, 6 of them hinges, before the flange; one chain of 7 hinges allowed"),
        (description(base=0.1), {}, "lies 100 mm and 0 degrees from where Franka Research 3 has it"),
        (description(), {"flange": "palm"}, "no flange palm; part0, part1"),
        (description(), {"sha256": "00"}, "00 of sim.described.sha256 allowed"),
    ],
)
def test_another_kind_of_arm_is_refused_in_one_line(written, text, keys, said):
    with pytest.raises(ConfigError) as refused:
        written(text, **keys)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_lies_behind_the_flange_is_left_out(written):
    finger = '<body name="finger"><joint type="slide"/><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body>'
    assert written(description(extra=finger)).model.nv == JOINTS
