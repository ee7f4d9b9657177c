"""A calibration that does not fit what the arm does is noticed."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.files import arm_file
from cell.run.arm_watch import ArmWatch
from drivers.arm.model import read_arm
from tests.unit.drivers.arm.test_learning import calibration

ARM = read_arm(arm_file("panda"))


def watched(friction=0.4, offset=0.2, scans=200, is_free=True):
    """Return the warnings on an arm that swings with this friction, this offset and a viscous torque of 0.05 N·m."""
    watch = ArmWatch(calibration(), ARM)
    for scan in range(scans):
        dq = np.full(7, 0.3 if scan % 100 < 50 else -0.3)
        torque = friction * np.sign(dq) + 0.05 * np.tanh(dq / 0.25) + offset
        watch.see(SimpleNamespace(arm=SimpleNamespace(dq=dq, unexplained=torque)), SimpleNamespace(is_free=is_free))
    return watch.end()


def test_an_arm_as_calibrated_is_not_reported():
    assert watched() == ""


@pytest.mark.parametrize("changed", [{"friction": 0.9}, {"offset": 1.2}])
def test_a_changed_arm_is_reported(changed):
    assert "does not fit: joint" in watched(**changed)


@pytest.mark.parametrize("little", [{"scans": 20}, {"is_free": False}])
def test_a_run_with_little_evidence_is_not_judged(little):
    assert watched(friction=0.9, **little) == ""
