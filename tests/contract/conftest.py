"""Implementations of each protocol: the fake, the stand-in, the emulated board, and hardware on request."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble
from drivers.errors import SkinSilentError
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.protocols import Clock
from drivers.quantities import SwitchState
from drivers.switch.board import SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from sim.boards.board_clock import BoardClock
from sim.boards.switch_board import EmulatedSwitchBoard
from sim.config import SimSkinConfig
from sim.hand.skin import SimSkin
from sim.hand.switch import SimSwitch
from tests.emulation import emulated_or_skip
from tests.fakes import FakeArm, FakeClock, FakeGripper, FakeSkin, FakeSwitch
from tests.skins import WIRED, BoardRig, ScriptedWorld


@dataclass
class Bench:
    """A device under test, its clock, and functions that act on it."""

    device: Any
    clock: Clock
    silence: Callable[[], None] | None = None
    """Function that silences the device; None if the test cannot."""
    press: Callable[[bool], None] | None = None
    """Function that presses or releases the switch; None if the test cannot."""
    clear: Callable[[], None] = lambda: None
    """Function that clears the bench at the end."""


def _hardware(request, name):
    file = request.config.getoption("--hardware")
    if file is None:
        pytest.skip("no hardware: --hardware FILE names the config of a cell")
    cell = assemble(load(file).cell)
    return Bench(getattr(cell, name), cell.clock)


@pytest.fixture(params=["fake", "sim", *WIRED, "can over python-can", "serial over pyserial", "hardware"])
def skin_bench(request) -> Iterator[Bench]:
    """Yield an untouched skin, not yet open."""
    if request.param == "hardware":
        bench = _hardware(request, "skin")
    elif request.param == "fake":
        clock = FakeClock()
        skin = FakeSkin(clock)
        bench = Bench(skin, clock, lambda: setattr(skin, "fault", SkinSilentError("silenced")))
    elif request.param == "sim":
        world, lost = ScriptedWorld(), []
        config = SimSkinConfig(kind="sim")
        skin = SimSkin(config, world, np.random.default_rng(0), lambda counts: None if lost else counts)
        bench = Bench(skin, world, lambda: lost.append(True))
    else:
        kind, _, really = request.param.partition(" over ")
        rig = BoardRig(WIRED[kind])
        if really:
            rig.connect_really(WIRED[kind])
        silence = (lambda: rig.hub.replace_modules(())) if really else (lambda: rig.unplug(1e4))
        bench = Bench(rig.skin, rig.clock, silence, clear=rig.close)
    yield bench
    bench.device.close()
    bench.clear()


@pytest.fixture(scope="module")
def simulated_cell():
    """Return one simulated cell for all tests of a file."""
    return assemble(load(sets=["sim.pace=max"]).cell)


@pytest.fixture(scope="module")
def franka():
    """Yield the address of a simulated Franka arm and hand, and the world behind them, which is the clock."""
    pytest.importorskip("franka_sim", reason="needs the packages that tests/franka/simulated.py names")
    from tests.franka.simulated import address, served

    with served(load(sets=["reality.scale=0.0"]).cell, address(2)) as (world, _):
        yield address(2), world
        world.horizon = math.inf


def _franka_arm(franka) -> Bench:
    host, world = franka
    world.horizon = math.inf
    from tests.franka.simulated import arm_at

    return Bench(arm_at(host, world.world.arm, world), world, clear=lambda: setattr(world, "horizon", math.inf))


@pytest.fixture(params=["fake", "sim", "franka", "hardware"])
def arm_bench(request) -> Iterator[Bench]:
    """Yield an arm that stands still in free space, not yet open."""
    if request.param == "hardware":
        bench = _hardware(request, "arm")
    elif request.param == "fake":
        clock = FakeClock()
        bench = Bench(FakeArm(clock), clock)
    elif request.param == "franka":
        bench = _franka_arm(request.getfixturevalue("franka"))
    else:
        cell = request.getfixturevalue("simulated_cell")
        bench = Bench(cell.arm, cell.clock)
    yield bench
    bench.clear()
    bench.device.close()


@pytest.fixture(params=["fake", "sim", "franka", "hardware"])
def gripper_bench(request) -> Iterator[Bench]:
    """Yield a gripper with nothing between its fingers, not yet open."""
    if request.param == "hardware":
        bench = _hardware(request, "gripper")
    elif request.param == "fake":
        gripper = FakeGripper(0.008)
        gripper.has_peg = False
        bench = Bench(gripper, FakeClock())
    elif request.param == "franka":
        # The world goes on only while somebody listens to the arm.
        host, world = request.getfixturevalue("franka")
        arm = _franka_arm((host, world)).device
        arm.open()
        bench = Bench(
            FrankaGripper(FrankaGripperConfig(kind="franka", host=host), world.world.arm.hand.stroke),
            world,
            clear=arm.close,
        )
    else:
        cell = request.getfixturevalue("simulated_cell")
        bench = Bench(cell.gripper, cell.clock)
    yield bench
    bench.device.close()
    bench.clear()


@pytest.fixture(params=["fake", "sim", "firmware", "hardware"])
def switch_bench(request) -> Iterator[Bench]:
    """Yield a switch with nothing on it, not yet open."""
    clock, fake = FakeClock(), FakeSwitch()

    def press(pressed: bool) -> None:
        fake.state = SwitchState.CLOSED if pressed else SwitchState.OPEN

    lever = SimpleNamespace(now=clock.now, is_switch_pressed=lambda: fake.state is SwitchState.CLOSED)
    if request.param == "hardware":
        bench = _hardware(request, "switch")
    elif request.param == "fake":
        bench = Bench(fake, clock, press=press)
    elif request.param == "sim":
        bench = Bench(SimSwitch(lever), clock, press=press)
    else:
        emulated_or_skip()
        board = EmulatedSwitchBoard(lever)
        board.open()
        both = BoardClock(clock, (board,))
        config = SerialSwitchConfig(kind="serial", port=board.port)
        bench = Bench(SerialSuccessSwitch(config, both), both, press=press, clear=board.close)
    yield bench
    bench.device.close()
    bench.clear()


@pytest.fixture(params=["fake", "sim", "board"])
def clock(request) -> Clock:
    if request.param == "fake":
        return FakeClock()
    if request.param == "sim":
        return request.getfixturevalue("simulated_cell").clock
    return BoardRig(WIRED["can"]).clock
