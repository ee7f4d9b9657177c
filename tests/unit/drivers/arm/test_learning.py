"""Learnt figures of joints that move as on the way to the rack, and the file of an arm's calibration."""

import math
from datetime import date

import numpy as np
import pytest

from cell.config.files import arm_file
from drivers.arm import learning
from drivers.arm.calibration import ArmCalibration, Measured, implausible, read_arm_calibration
from drivers.arm.model import JOINTS, read_arm
from drivers.errors import ConfigError

PANDA = read_arm(arm_file("panda"))
M = np.diag([1.5, 1.4, 0.9, 1.0, 0.2, 0.15, 0.1])
PERIOD = 5e-3
DRY = np.array([0.3, 0.5, 0.3, 0.6, 0.4, 0.15, 0.3])
SMOOTH = np.array([0.2, 0.3, 0.2, 0.5, 0.3, 0.1, 0.2])
OFFSET = np.array([0.05, -0.6, 0.3, 0.8, -0.1, 0.15, 0.02])
ROTOR = np.array([0.08, 0.02, 0.1, -0.03, 0.03, 0.02, 0.04])


@pytest.fixture
def state():
    begun = np.zeros(learning.WORDS)
    learning.begin(begun, PANDA)
    return begun


def learnt(state):
    """Return the learnt figures of each joint and their standard deviations, each shape (7, 4)."""
    covariance = state[learning.COVARIANCE : learning.WORDS].reshape(JOINTS, learning.FIGURES, learning.FIGURES)
    figures = state[learning.LEARNT : learning.COVARIANCE].reshape(JOINTS, learning.FIGURES).copy()
    return figures, np.sqrt(np.einsum("ijj->ij", covariance))


def moved(state, seconds, is_free=True, pushed=0.0, dry=DRY):
    """Swing every joint to and fro, as minimum-jerk moves of a second and a half do, against its friction."""
    for k in range(round(seconds / PERIOD)):
        phase = math.pi * k * PERIOD / 1.5 + np.linspace(0.0, 1.0, JOINTS)
        dq = 0.5 * np.sin(phase)
        ddq = 0.5 * math.pi / 1.5 * np.cos(phase)
        friction = dry * np.tanh(dq / learning.DRY_RATE) + SMOOTH * np.tanh(dq / learning.SMOOTH_RATE)
        state[learning.COMMANDED : learning.COMMANDED + JOINTS] = M @ ddq + ROTOR * ddq + friction + OFFSET + pushed
        learning.observe(state, M, dq, PERIOD, is_free)
    return learnt(state)


def test_friction_offset_and_rotor_are_found_within_two_moves(state):
    figures, deviations = moved(state, 3.0)
    assert np.abs(figures[:, learning.OFFSET] - OFFSET).max() < 0.1
    assert np.abs(figures[:, learning.ROTOR] - ROTOR).max() < 0.05
    together = figures[:, learning.DRY] + figures[:, learning.SMOOTH]
    assert np.abs(together - DRY - SMOOTH).max() < 0.1
    assert (deviations < learning.doubts(PANDA)).all()


def test_what_is_learnt_lies_within_its_own_interval(state):
    figures, deviations = moved(state, 20.0)
    truth = np.column_stack([DRY, SMOOTH, OFFSET, ROTOR])
    assert (np.abs(figures - truth) < 3.0 * deviations + 0.02).all()


def test_a_push_teaches_nothing_while_the_hand_is_in_contact(state):
    before = moved(state, 3.0)[0]
    after = moved(state, 3.0, is_free=False, pushed=4.0)[0]
    np.testing.assert_array_equal(after, before)


def rested(state, seconds, torque):
    """Command torques to joints that friction keeps at rest, after the observer has settled."""
    learning.pause(state)
    for _ in range(round(seconds / PERIOD)):
        state[learning.COMMANDED : learning.COMMANDED + JOINTS] = torque
        learning.observe(state, M, np.zeros(JOINTS), PERIOD, True)
    return learnt(state)


def test_a_joint_at_rest_within_its_friction_teaches_nothing(state):
    before, _ = moved(state, 3.0)
    np.testing.assert_array_equal(rested(state, 2.0, OFFSET + 0.5 * DRY)[0], before)


def test_sticking_before_the_return_separates_friction_from_offset(state):
    for _ in range(300):
        state[learning.COMMANDED : learning.COMMANDED + JOINTS] = (
            OFFSET + DRY + SMOOTH * math.tanh(0.5 / learning.SMOOTH_RATE)
        )
        learning.observe(state, M, np.full(JOINTS, 0.5), PERIOD, True)
    one_way = np.abs(learnt(state)[0][:, learning.OFFSET] - OFFSET)
    figures, _ = rested(state, 1.0, OFFSET - DRY)
    error = np.abs(figures[:, learning.OFFSET] - OFFSET)
    assert one_way.max() > 0.4
    assert (error < np.maximum(one_way, learning.NOISE) + 0.01).all()
    assert error.max() < 0.2


def test_an_arm_held_back_learns_no_implausible_figures(state):
    figures, _ = rested(state, 1.0, np.full(JOINTS, 20.0))
    doubts = learning.doubts(PANDA)[:, : learning.ROTOR]
    assert (np.abs(figures[:, : learning.ROTOR]).sum(axis=1) <= 3.0 * np.sqrt((doubts**2).sum(axis=1))).all()


def test_joints_that_warm_up_are_learnt_anew(state):
    moved(state, 60.0)
    figures, _ = moved(state, 120.0, dry=0.5 * DRY)
    together = figures[:, learning.DRY] + figures[:, learning.SMOOTH]
    np.testing.assert_allclose(together, 0.5 * DRY + SMOOTH, atol=0.08)


def test_friction_is_fed_forward_in_motion_and_an_offset_always(state):
    figures, _ = moved(state, 3.0)
    at_rest, there, back = (learning.feed_forward(state, 1, wanted) for wanted in (0.0, 0.5, -0.5))
    assert at_rest == pytest.approx(figures[1, learning.OFFSET])
    made_up_for = 0.5 * (there - back) / (DRY[1] + SMOOTH[1] * math.tanh(2.0))
    assert 0.7 < made_up_for < 0.9
    assert 0.5 * (there + back) == pytest.approx(at_rest)


def test_a_new_arm_has_no_feed_forward_and_a_pause_forgets_nothing(state):
    assert learning.feed_forward(state, 3, 0.7) == 0.0
    before = moved(state, 3.0)
    learning.pause(state)
    np.testing.assert_array_equal(learnt(state), before)


def measured(value, interval=0.05):
    return Measured(value=(value,) * 7, interval=(interval,) * 7)


def calibration(friction=0.4, offset=0.2, interval=0.05):
    return ArmCalibration(
        date=date(2026, 11, 22),
        arm=PANDA.name,
        unit="at 172.16.0.2",
        speeds=(0.06, 0.35),
        friction=(measured(friction, interval), measured(friction)),
        offset=measured(offset),
        dry=measured(max(friction, 0.0)),
        smooth=measured(0.05),
        unexplained=(0.1,) * 7,
    )


def test_what_is_written_is_read(tmp_path):
    calibration().write(tmp_path / "new" / "arm.toml")
    assert read_arm_calibration(tmp_path / "new" / "arm.toml", PANDA, "at 172.16.0.2") == calibration()


def test_the_file_of_another_arm_is_refused_in_one_line(tmp_path):
    calibration().write(tmp_path / "arm.toml")
    with pytest.raises(
        ConfigError, match=r"of another arm, .*172\.16\.0\.2.*; one of .* \(at 172\.16\.0\.3\) allowed$"
    ):
        read_arm_calibration(tmp_path / "arm.toml", PANDA, "at 172.16.0.3")


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        ({"friction": 3.1}, r"joint 5: friction at 0\.06 rad/s 3\.10 N·m; 0\.00 to 3\.00 N·m allowed"),
        ({"friction": -0.3}, r"joint 1: friction at 0\.06 rad/s -0\.30 N·m"),
        ({"offset": 5.2}, r"joint 1: offset 5\.20 N·m; -5\.00 to 5\.00 N·m allowed"),
        ({"interval": 0.6}, r"joint 1: friction at 0\.06 rad/s uncertain by 0\.60 N·m; at most 0\.30 N·m allowed"),
    ],
)
def test_figures_beyond_the_bound_are_refused(figures, said, tmp_path):
    assert implausible(calibration(friction=3.0, offset=3.0, interval=0.3), PANDA) is None
    calibration(**figures).write(tmp_path / "arm.toml")
    with pytest.raises(ConfigError, match=said):
        read_arm_calibration(tmp_path / "arm.toml", PANDA, "at 172.16.0.2")


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    calibration().write(tmp_path / "arm.toml")
    monkeypatch.setattr("os.fsync", lambda handle: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(ConfigError, match="calibration cannot be written: No space left"):
        calibration(friction=0.9).write(tmp_path / "arm.toml")
    assert read_arm_calibration(tmp_path / "arm.toml", PANDA, "at 172.16.0.2") == calibration()


def test_a_calibration_narrows_the_prior_less_than_its_own_intervals():
    figures, deviations = calibration().believed(PANDA)
    likely = learning.doubts(PANDA)
    np.testing.assert_allclose(figures[:, :3], [[0.4, 0.05, 0.2]] * 7)
    assert np.all(deviations <= likely)
    assert np.all(deviations[:, learning.DRY] >= 0.05 / 1.96)
    np.testing.assert_array_equal(deviations[:, learning.ROTOR], likely[:, learning.ROTOR])
