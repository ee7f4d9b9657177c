"""The Franka driver reports a failed command once, and is silent before it is opened."""

import math
import os
import subprocess

import pytest

from cell.config.files import arm_file
from drivers.arm import franka as arm
from drivers.arm.franka import FrankaArm
from drivers.arm.franka_config import FrankaArmConfig
from drivers.arm.link import SIZE, LoopLink, LoopPhase
from drivers.arm.model import read_arm
from drivers.errors import ArmSilentError, DeviceNotOpenedError, GripperSilentError
from drivers.gripper import franka as gripper
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.quantities import GripperState
from tests.fakes import FakeClock

FR3 = read_arm(arm_file("fr3"))
ARM = FrankaArmConfig(kind="franka", model="fr3", host="127.0.0.1", collision_torque=40.0, collision_force=40.0)
GRIPPER = FrankaGripperConfig(kind="franka", host="127.0.0.1")


@pytest.fixture
def ends():
    """Return both ends of one link."""
    handle = os.memfd_create("test")
    os.ftruncate(handle, SIZE)
    made = LoopLink(handle), LoopLink(handle)
    os.close(handle)
    return made


def test_a_record_under_way_is_not_settled(ends):
    here, there = ends
    before = there.is_settled("setpoint_sequence")
    here.begin("setpoint_sequence")
    assert there.is_settled("setpoint_sequence") is None
    here.end("setpoint_sequence")
    assert there.is_settled("setpoint_sequence") not in (None, before)


@pytest.mark.parametrize(
    ("module", "device"), [(arm, FrankaArm(ARM, FR3, FakeClock())), (gripper, FrankaGripper(GRIPPER, FR3.hand.stroke))]
)
def test_a_missing_library_is_named_with_its_command(monkeypatch, module, device):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(DeviceNotOpenedError, match=r"pylibfranka is not installed: pip install '[^\n]*\[franka\]'$"):
        device.open()


def test_devices_that_were_never_opened_are_silent_and_take_a_halt():
    device = FrankaArm(ARM, FR3, FakeClock())
    device.halt()
    device.close()
    assert device.phase is LoopPhase.LOST
    for silent in (device.read, device.reset, device.figures):
        with pytest.raises(ArmSilentError):
            silent()
    hand = FrankaGripper(GRIPPER, FR3.hand.stroke)
    hand.close()
    with pytest.raises(GripperSilentError):
        hand.grip(30.0)
    with pytest.raises(GripperSilentError):
        hand.read()


@pytest.mark.parametrize(
    ("answer", "told"), [("done 0 move 0", "the hand did not open"), ("failed 0 no power", "no power")]
)
def test_a_failed_command_is_reported_once_although_states_follow(monkeypatch, answer, told):
    start, hand = subprocess.Popen, FrankaGripper(GRIPPER, FR3.hand.stroke)
    loop = f"echo {answer}; while echo state 0.008 0; do sleep 0.05; done"
    monkeypatch.setattr(gripper, "find_spec", lambda name: True)
    monkeypatch.setattr(subprocess, "Popen", lambda command, **pipes: start(["sh", "-c", loop], **pipes))
    hand.open()
    with pytest.raises(GripperSilentError, match=rf"^gripper at 127\.0\.0\.1: {told}$"):
        hand.read()
    assert hand.read() == GripperState(0.008, False, False)
    hand.close()


def test_collision_limits_have_no_default():
    with pytest.raises(ValueError, match="collision_force"):
        FrankaArmConfig.model_validate({"kind": "franka", "model": "fr3", "host": "a", "collision_torque": 40.0})
    assert math.isfinite(ARM.collision_force)
