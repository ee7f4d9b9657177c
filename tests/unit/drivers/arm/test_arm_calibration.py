"""The file of an arm's calibration: whole, of this arm, of figures that an arm can have, and believed no more than it deserves."""

from datetime import date

import numpy as np
import pytest

from cell.config.files import arm_file
from drivers.arm import learning
from drivers.arm.calibration import ArmCalibration, Measured, implausible, read_arm_calibration
from drivers.arm.model import read_arm
from drivers.errors import ConfigError

ARM = read_arm(arm_file("panda"))


def measured(value, interval=0.05):
    return Measured(value=(value,) * 7, interval=(interval,) * 7)


def calibration(friction=0.4, offset=0.2, interval=0.05):
    return ArmCalibration(
        date=date(2026, 11, 22),
        arm=ARM.name,
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
    assert read_arm_calibration(tmp_path / "new" / "arm.toml", ARM, "at 172.16.0.2") == calibration()


def test_the_file_of_another_arm_is_refused_in_one_line(tmp_path):
    calibration().write(tmp_path / "arm.toml")
    with pytest.raises(
        ConfigError, match=r"of another arm, .*172\.16\.0\.2.*; one of .* \(at 172\.16\.0\.3\) allowed$"
    ):
        read_arm_calibration(tmp_path / "arm.toml", ARM, "at 172.16.0.3")


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
    assert implausible(calibration(friction=3.0, offset=3.0, interval=0.3), ARM) is None
    calibration(**figures).write(tmp_path / "arm.toml")
    with pytest.raises(ConfigError, match=said):
        read_arm_calibration(tmp_path / "arm.toml", ARM, "at 172.16.0.2")


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    calibration().write(tmp_path / "arm.toml")
    monkeypatch.setattr("os.fsync", lambda handle: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(ConfigError, match="calibration cannot be written: No space left"):
        calibration(friction=0.9).write(tmp_path / "arm.toml")
    assert read_arm_calibration(tmp_path / "arm.toml", ARM, "at 172.16.0.2") == calibration()


def test_learning_begins_surer_than_with_nothing_but_not_as_sure_as_was_measured():
    figures, deviations = calibration().believed(ARM)
    likely = learning.doubts(ARM)
    np.testing.assert_allclose(figures[:, :3], [[0.4, 0.05, 0.2]] * 7)
    assert np.all(deviations <= likely)
    assert np.all(deviations[:, learning.DRY] >= 0.05 / 1.96)
    np.testing.assert_array_equal(deviations[:, learning.ROTOR], likely[:, learning.ROTOR])
