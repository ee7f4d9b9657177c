"""Skin and switch behind their wires, killed and revived in the middle of runs: a fault each time, never a success."""

from dataclasses import replace

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.run.states import State
from drivers.errors import FaultCode
from plc_bridge.protocol.messages import Control, Result
from tests.emulation import emulated_or_skip
from tests.simulated_line import running
from tests.wired import Wires


@pytest.fixture
def wired(tmp_path):
    """Yield the cell at work, its boards, and the truth."""
    emulated_or_skip()
    loaded = load(sets=["sim.pace=max", "reality.scale=0.0", "sim.seed=4", "hole.area=[0.01, 0.01]"])
    plain = assemble(loaded.cell)
    wires = Wires(loaded.cell, plain.clock, plain.clock.draw.skin)
    cell = replace(plain, clock=wires.clock, skin=wires.skin, switch=wires.switch, boards=(wires,))
    with opened(cell), running(cell, loaded, tmp_path) as rehearsal:
        yield rehearsal, wires, cell.truth


def test_killed_boards_end_runs_in_their_fault_unless_back_in_time(wired):
    rehearsal, wires, truth = wired

    def pull_both():
        wires.unplug_skin()
        wires.switch_board.close()

    def put_back():
        wires.plug_in_skin()
        wires.switch_board.open()
        rehearsal.wait(3.0)

    for stage, kill, fault in [
        ("spray_search", wires.unplug_skin, FaultCode.SKIN_SILENT),
        ("spiral_adjust", wires.switch_board.close, FaultCode.SWITCH_UNKNOWN),
        ("tactile_insert", pull_both, FaultCode.SWITCH_UNKNOWN),
    ]:
        report = rehearsal.insert(stage, 0.2, kill)
        assert (report.result, report.fault, report.state) == (Result.FAULT, fault, State.ABORTED)
        if kill is wires.unplug_skin:  # a reset while it is away does not arm the cell
            report = rehearsal.command(Control.RESET)
            assert (report.state, report.fault) == (State.ABORTED, FaultCode.SKIN_SILENT)
        put_back()
        assert rehearsal.command(Control.RESET).state == State.IDLE

    def replug():
        wires.switch_board.close()
        wires.switch_board.open()

    assert rehearsal.insert("spray_search", 0.2, replug).result == Result.SUCCESS
    assert truth().switch_closed
