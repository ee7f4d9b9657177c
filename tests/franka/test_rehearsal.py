"""Skin, switch, arm and hand all behind their wires, each killed and revived in the middle of a run."""

import os
import signal

import pytest

pytest.importorskip(
    "franka_sim", reason="needs the packages that tests/franka/simulated.py names", exc_type=ImportError
)

from cell.config import load
from cell.states import State
from drivers.errors import FaultCode
from plc_bridge.messages import Result
from tests.emulation import emulated_or_skip
from tests.franka.insertion import opened
from tests.franka.simulated import address
from tests.wired import Rehearsal


def test_whatever_is_killed_in_the_middle_ends_in_its_fault_and_serves_again_after_a_reset(tmp_path):
    emulated_or_skip()
    loaded = load(sets=["sim.pace=max", "reality.scale=0.0", "sim.seed=2"])
    with opened(loaded.cell, address(5)) as wired, Rehearsal(wired.cell, loaded, tmp_path) as rehearsal:
        wires = wired.wires

        def kill(what):
            return lambda: os.kill(what.process_id, signal.SIGKILL)

        for stage, pull, revive, fault in [
            ("grasp_from_rack", kill(wired.gripper), lambda: None, FaultCode.GRIPPER_SILENT),
            ("spray_search", kill(wired.arm), lambda: None, FaultCode.ARM_SILENT),
            ("spray_search", wires.unplug_skin, wires.plug_in_skin, FaultCode.SKIN_SILENT),
            ("tactile_insert", wired.server.cut, lambda: None, FaultCode.ARM_SILENT),
            ("spiral_adjust", wires.switch_board.close, wires.switch_board.open, FaultCode.SWITCH_UNKNOWN),
        ]:
            report = rehearsal.insert(stage, 0.2, pull)
            assert (report.result, report.fault, report.state) == (Result.FAULT, fault, State.ABORTED)
            revive()
            if fault is not FaultCode.ARM_SILENT:
                rehearsal.wait(1.0)
            assert rehearsal.reset().state == State.IDLE
            rehearsal.wait(1.0)
        assert rehearsal.insert().result is Result.SUCCESS
        assert wired.world.world.truth().switch_closed
