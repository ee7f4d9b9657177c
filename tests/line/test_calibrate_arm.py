"""`cell calibrate arm`: its figures are true within their intervals, and a run detects an arm that has changed."""

import math
import re
from datetime import date, timedelta

import numpy as np
import pytest

from cell.calibrate.arm import JointSweep, calibrate_arm
from cell.commands.cli import NOT_GOOD, WRONG_USE, main
from cell.config.files import ERRORS_FILE
from cell.config.files import SHIPPED as SHIPPED_FILES
from cell.config.load import load
from cell.records.journal import Journal
from drivers.errors import NotCalibratedError
from sim.arm import joint_drive
from sim.arm.drawn_arm import drawn_arm
from sim.world.reality import read

SHORT = JointSweep(speeds=(0.15, 0.35), even=0.4, together=2.0)
SEED = ["--set", "sim.seed=80001", "--set", "sim.pace=max"]


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Return a calibration of one drawn arm, and its file."""
    found = calibrate_arm(
        load(sets=["sim.seed=80001", "insert.estimator=image"]).cell, date.today(), lambda done, of: None, SHORT
    )
    path = tmp_path_factory.mktemp("calibration") / "arm.toml"
    found.write(path)
    return found, path


def torques(speed):
    """Friction and gravity torque of the drawn arm's joints at a velocity, shape (7,), N·m."""
    config = load(sets=["sim.seed=80001"]).cell
    arm = drawn_arm(config.arm_model(), read(SHIPPED_FILES / ERRORS_FILE).draw(80001, config.reality))
    words = joint_drive.words_of(arm, (5e-4, 2e-3))
    return np.array(
        [
            math.copysign(dry, speed) + joint_drive.friction(words, joint, speed) - gravity
            for joint, (dry, gravity) in enumerate(zip(arm.friction.dry, arm.gravity, strict=True))
        ]
    )


def test_friction_and_offset_are_what_was_drawn_within_their_intervals(measured):
    found, _ = measured
    for speed, friction in zip(found.speeds, found.friction, strict=True):
        true = 0.5 * (torques(speed) - torques(-speed))
        assert np.all(np.abs(np.array(friction.value) - true) < friction.interval)
    true = np.mean([torques(sense * speed) for speed in found.speeds for sense in (-1, 1)], axis=0)
    assert np.all(np.abs(np.array(found.offset.value) - true) < found.offset.interval)


def test_a_run_of_a_changed_arm_warns_and_records_it(measured, capsys, tmp_path):
    changed = ["--set", "reality.scale=0", "--set", f"calibration.arm={measured[1]}"]
    main(["run", "grasp_from_rack", *SEED, *changed, "--journal", str(tmp_path)])
    assert re.search(r"^cell: warning: calibration\.arm of .* does not fit: joint \d", capsys.readouterr().err, re.M)
    with Journal(tmp_path, is_read_only=True) as journal:
        assert next(e.text for e in journal.events() if e.name == "arm calibration").startswith("calibration.arm of")


@pytest.mark.parametrize(
    ("days", "seed", "why"),
    [
        (366, 80001, "366 days ago; 0 to 365 days of calibration.longest_age allowed"),
        (0, 80002, "of another arm"),
    ],
)
def test_a_calibration_that_is_too_old_or_of_another_arm_is_refused(measured, capsys, tmp_path, days, seed, why):
    measured[0].model_copy(update={"date": date.today() - timedelta(days=days)}).write(tmp_path / "arm.toml")
    words = ("--set", f"sim.seed={seed}", "--set", f"calibration.arm={tmp_path / 'arm.toml'}")
    assert main(["check", *words]) == WRONG_USE
    error = capsys.readouterr().err
    assert (why in error, error.count("\n")) == (True, 1), error


def test_an_unexplained_force_ends_the_calibration_without_a_file(capsys, tmp_path):
    assert main(["calibrate", "arm", *SEED, "--set", "limits.force=3", "--out", str(tmp_path)]) == NOT_GOOD
    assert "FORCE_LIMIT" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_an_arm_that_reports_no_torques_is_not_calibrated(monkeypatch):
    monkeypatch.setattr("drivers.impedance.unexplained", lambda law: None)
    with pytest.raises(NotCalibratedError, match="does not report the torques"):
        calibrate_arm(load(sets=["reality.scale=0"]).cell, date.today(), lambda done, of: None, SHORT)
