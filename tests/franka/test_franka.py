"""Arm and hand through their maker's client library and protocol; `tests/franka/simulated.py` says what they run on."""

import math
import os
import signal
import time
from datetime import date
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip(
    "franka_sim", reason="needs the packages that tests/franka/simulated.py names", exc_type=ImportError
)

from franka_sim.control_modes import ControlMode

from cell.calibrate.hand_motion import DEAD_MAN, JOG_SPEED, moved_by_keys
from cell.calibrate.places import measured_places
from cell.config.load import load
from drivers.arm import franka as module
from drivers.arm.link import LoopPhase
from drivers.errors import ArmReflexError, ArmSilentError, ArmStoppedError, CellError, DeviceNotOpenedError
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig
from tests.emulation import emulated_or_skip
from tests.franka.insertion import inserted, opened
from tests.franka.simulated import address, arm_at, served
from tests.setpoints import risen

HOST = address(1)
FIGURES = load(sets=["reality.scale=0.0"]).cell.arm_model()
DEPTH = load().cell.hole.depth
"""m."""
LONGEST = 20.0
"""s."""

pytestmark = pytest.mark.alone


@pytest.fixture(scope="module")
def simulated():
    """Yield the world behind the arm, and the server in between, for all tests here."""
    with served(load(sets=["reality.scale=0.0"]).cell, HOST, strict=True) as both:
        yield both


@pytest.fixture
def arm(simulated):
    world, server = simulated
    server.is_patient = True
    made = arm_at(HOST, world.world.arm, world)
    world.horizon = math.inf
    made.open()
    yield made
    world.horizon = math.inf
    made.close()


@pytest.fixture
def gripper(arm):
    made = FrankaGripper(FrankaGripperConfig(kind="franka", host=HOST), FIGURES.hand.stroke)
    made.open()
    yield made
    made.close()


def reaches(world, arm, rise):
    """Return True if the arm comes to a setpoint `rise`, m, above its place."""
    setpoint = risen(arm.read(), rise, world.now() + LONGEST)
    arm.follow(setpoint)
    return until(world, lambda: np.linalg.norm(arm.read().tcp.position - setpoint.tip) < 0.004)


def until(world, condition):
    """Let the world go on until a condition holds; return True if it does."""
    end = world.now() + LONGEST
    while not condition() and world.now() < end:
        world.wait_until(world.now() + 0.01)
    world.horizon = math.inf
    return condition()


def comes_to(condition):
    """Wait, in wall time, until a condition holds while the world stands still; return True if it does."""
    end = time.monotonic() + LONGEST
    while not condition() and time.monotonic() < end:
        os.sched_yield()
    return condition()


def raises(arm, error, text=""):
    def does():
        try:
            arm.read()
        except CellError as told:
            return isinstance(told, error) and text in str(told)
        return False

    return does


def test_the_arm_follows_within_the_permitted_torque_rate(simulated, arm):
    world, _ = simulated
    world.largest_rate = 0.0
    assert reaches(world, arm, 0.03)
    assert 0.0 < world.largest_rate < FIGURES.joints.torque_rate[0]
    assert arm.figures().missed == 0


def test_a_setpoint_past_its_validity_makes_the_arm_hold_still(simulated, arm):
    world, _ = simulated
    start = arm.read().tcp.position
    arm.follow(risen(arm.read(), 0.05, world.now() + 0.05))
    world.wait_until(world.now() + 1.0)
    held = arm.read().tcp.position
    world.wait_until(world.now() + 1.0)
    assert 0.0001 < held[2] - start[2] < 0.03
    assert np.linalg.norm(arm.read().tcp.position - held) < 1e-3
    assert arm.read().setpoint_age == math.inf


def test_a_loop_that_stalls_is_a_reflex_that_only_a_reset_leaves(simulated, arm):
    world, server = simulated
    refused = risen(arm.read(), 0.03, world.now() + 10.0)
    server.is_patient = False
    os.kill(arm._process.pid, signal.SIGSTOP)
    world.wait_until(world.now() + 0.05)
    os.kill(arm._process.pid, signal.SIGCONT)
    server.is_patient = True
    assert until(world, raises(arm, ArmReflexError))
    with pytest.raises(ArmReflexError, match="communication_constraints_violation"):
        arm.read()
    before = world.world.tcp().position
    arm.follow(refused)
    world.wait_until(world.now() + 0.5)
    world.horizon = math.inf
    assert np.linalg.norm(world.world.tcp().position - before) < 1e-3
    arm.reset()
    assert arm.phase is LoopPhase.RUNNING
    assert reaches(world, arm, 0.02)


def test_a_pressed_stop_is_distinguished_from_a_reflex(simulated, arm):
    world, server = simulated
    server.press_stop()
    assert until(world, raises(arm, ArmStoppedError))
    arm.reset()
    assert arm.read().setpoint_age == math.inf


def test_a_pressed_stop_refuses_thresholds_and_reset_until_its_release(simulated, arm):
    _, server = simulated
    arm.close()
    server.is_stopped, server.thresholds_set = True, 0
    arm.open()
    for refused in (arm.read, arm.reset):
        with pytest.raises(ArmStoppedError):
            refused()
    assert server.thresholds_set == 0
    server.is_stopped = False
    arm.reset()
    assert (server.thresholds_set, arm.phase) == (1, LoopPhase.RUNNING)


def test_closed_brakes_are_reported_at_once_with_the_remedy_in_desk(simulated, arm, monkeypatch):
    _, server = simulated
    arm.close()
    with monkeypatch.context() as braked:
        braked.setattr(server, "is_braked", True)
        arm.open()
        begun = time.monotonic()
        for refused in (arm.read, arm.reset):
            with pytest.raises(CellError, match=r"^arm at .*in the current mode.*; unlock the brakes, choose exec.*$"):
                refused()
        assert time.monotonic() - begun < module.RESET_TIME
    arm.reset()
    assert arm.phase is LoopPhase.RUNNING


def test_a_recovery_that_outlasts_its_reset_starts_no_motion(simulated, arm, monkeypatch):
    world, server = simulated
    server.press_stop()
    assert until(world, raises(arm, ArmStoppedError))
    monkeypatch.setattr(module, "RESET_TIME", 0.2)
    server.may_recover.clear()
    with pytest.raises(ArmStoppedError):
        arm.reset()
    server.may_recover.set()
    assert comes_to(raises(arm, ArmReflexError, "reset again"))
    assert world.mode is not ControlMode.TORQUE
    monkeypatch.undo()
    arm.reset()
    assert arm.phase is LoopPhase.RUNNING


@pytest.mark.parametrize("loss", [0.01, 0.05])
def test_lost_torques_never_exceed_the_permitted_rate(simulated, arm, loss):
    world, server = simulated
    world.largest_rate, server.loss = 0.0, loss
    try:
        assert reaches(world, arm, 0.05)
    finally:
        server.loss = 0.0
    assert 0.0 < world.largest_rate < FIGURES.joints.torque_rate[0]


def test_a_killed_cell_ends_the_motion_of_an_arm_that_stands_still(simulated, arm):
    world, _ = simulated
    arm.follow(risen(arm.read(), 0.05, world.now() + 10.0))
    assert until(world, lambda: np.abs(arm.read().dq).max() > 0.1)
    world.speed_at_end = math.inf
    arm.close()  # The loop notices the end of its standard input, which closes with the cell.
    assert world.speed_at_end < 0.02


def test_a_system_of_another_version_is_named_with_the_remedy(simulated, arm):
    _, server = simulated
    arm.close()
    server.system = 9
    try:
        with pytest.raises(
            DeviceNotOpenedError,
            match=r"^arm at [^\n]*server version: 9[^\n]*10[^\n]*needs system 5\.9 or later[^\n]*$",
        ):
            arm.open()
    finally:
        server.system = 10


def test_keys_jog_the_arm_and_the_dead_man_ends_it(simulated, arm):
    world, _ = simulated
    cell = SimpleNamespace(config=load(sets=["reality.scale=0.0"]).cell, clock=world, arm=arm)
    start, pressed = arm.read().tcp.position, []

    def key(is_waiting):
        pressed.append(is_waiting)
        return "z" if len(pressed) == 1 else "q" if len(pressed) == 100 else ""

    moved_by_keys(cell, SimpleNamespace(next=key), lambda key, state: True, is_guided=False)
    assert pressed[50:] == [True] * 50
    assert arm.read().setpoint_age == math.inf
    assert 0.0005 < arm.read().tcp.position[2] - start[2] < 1.5 * JOG_SPEED * DEAD_MAN


@pytest.mark.parametrize(
    "lose", [lambda server, arm: server.cut(), lambda server, arm: os.kill(arm._process.pid, signal.SIGKILL)]
)
def test_a_lost_connection_or_killed_loop_is_silent_until_reset(simulated, arm, lose):
    lose(simulated[1], arm)
    assert comes_to(raises(arm, ArmSilentError))
    arm.reset()
    assert arm.phase is LoopPhase.RUNNING


def test_an_address_without_an_arm_is_named(simulated):
    world, _ = simulated
    with pytest.raises(DeviceNotOpenedError, match=r"^arm at 127\.254\.254\.254: [^\n]+$"):
        arm_at("127.254.254.254", world.world.arm, world).open()


def test_a_grasp_that_closes_on_nothing_grips_nothing(simulated, gripper):
    world, _ = simulated
    gripper.release(0.02)
    assert until(world, lambda: not gripper.read().is_moving)
    assert gripper.read().width == pytest.approx(0.02, abs=1e-3)
    gripper.grip(30.0)
    assert gripper.read().is_moving
    assert until(world, lambda: not gripper.read().is_moving)
    state = gripper.read()
    assert (state.is_gripping, state.width) == (False, pytest.approx(0.0, abs=1e-3))


@pytest.mark.skipif(Path("/sys/kernel/realtime").exists(), reason="this kernel is a real-time kernel")
def test_a_kernel_without_real_time_is_refused(simulated):
    world, _ = simulated
    with pytest.raises(DeviceNotOpenedError, match="kernel does not have realtime capabilities"):
        arm_at(HOST, world.world.arm, world, "enforce").open()


FORCE = ["hole.latch={kind='detent',force=5.0,height=0.003}", "hole.evidence=force"]
"""A hole without a switch: the force alone proves a seated peg."""


@pytest.mark.parametrize("sets", [[], FORCE], ids=["switch", "force"])
def test_a_whole_insertion_runs_through_the_clients(sets):
    emulated_or_skip()
    told = inserted(address(4), 2, ["hole.area=[0.01, 0.01]", *sets])
    assert told["fault"] == ""
    assert told["outcome"] == "success"
    assert told["depth"] == pytest.approx(DEPTH, abs=2e-3)
    assert not told["is_void"]
    assert told["loop"]["missed"] == 0
    assert told["largest_torque_rate"] < FIGURES.joints.torque_rate[0]


@pytest.mark.by_hand
def test_plate_and_rack_are_touched_off_through_the_clients():
    emulated_or_skip()
    config = load(sets=["sim.pace=max", "reality.scale=0.0"]).cell
    with opened(config, address(4)) as wired:
        found = measured_places(wired.cell, date.today(), lambda done, of: None, pegs=2)
    assert found.height == pytest.approx(config.hole.centre[2], abs=5e-4)
    assert found.rack == pytest.approx((0.0, 0.0), abs=2e-3)
