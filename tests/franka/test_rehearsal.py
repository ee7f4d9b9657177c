"""Whole insertions with skin, switch, arm and hand all behind their wires; arm and hand are killed in the middle.

What boards that are killed do is in `tests/line/test_cell_wires.py`: here a second of a run costs two of a processor.
"""

import os
import signal

import pytest

pytest.importorskip(
    "franka_sim", reason="needs the packages that tests/franka/simulated.py names", exc_type=ImportError
)

from cell.config.load import load
from cell.run.states import State
from drivers.errors import FaultCode
from plc_bridge.protocol.messages import Control, Result
from tests.emulation import emulated_or_skip
from tests.franka.insertion import opened
from tests.franka.simulated import address
from tests.simulated_line import running

pytestmark = [pytest.mark.alone, pytest.mark.by_hand, pytest.mark.timeout(3600)]


def test_killed_devices_end_the_run_in_their_fault_until_a_reset(tmp_path):
    emulated_or_skip()
    loaded = load(sets=["sim.pace=max", "reality.scale=0.0", "sim.seed=2"])
    with opened(loaded.cell, address(5)) as wired, running(wired.cell, loaded, tmp_path) as rehearsal:

        def kill(what):
            return lambda: os.kill(what._process.pid, signal.SIGKILL)

        for stage, pull, fault in [
            ("grasp_from_rack", kill(wired.gripper), FaultCode.GRIPPER_SILENT),
            ("spray_search", kill(wired.arm), FaultCode.ARM_SILENT),
            ("tactile_insert", wired.bench.cut, FaultCode.ARM_SILENT),
        ]:
            report = rehearsal.insert(stage, 0.2, pull)
            assert (report.result, report.fault, report.state) == (Result.FAULT, fault, State.ABORTED)
            if fault is not FaultCode.ARM_SILENT:
                rehearsal.wait(1.0)
            assert rehearsal.command(Control.RESET).state == State.IDLE
            rehearsal.wait(1.0)
        assert rehearsal.insert().result == Result.SUCCESS
        truth = wired.bench.truth()
        assert truth.switch_closed
        assert not truth.is_void
        assert wired.arm.figures().missed == 0
        assert wired.bench.largest_rate() < loaded.cell.arm_model().joints.torque_rate[0]
