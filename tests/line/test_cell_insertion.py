"""The main job, whole: a PLC's command on a socket, a simulated cell with physics, and the answer on the same socket."""

import threading
from contextlib import closing

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.records.journal import Journal
from drivers.quantities import SwitchState
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Result
from skills.catalogue import CATALOGUE
from tests.serving import serving

RECOVER = CATALOGUE["recover"].code
INSERT = CATALOGUE["insert_peg"].code
LONGEST = 120.0


@pytest.fixture
def served(tmp_path):
    """Yield the simulated cell, host and port where it is served, and the event that makes it begin to scan."""
    loaded, begin = load(sets=["sim.pace=max"]), threading.Event()
    with opened(assemble(loaded.cell)) as cell, serving(cell, loaded, tmp_path, begin) as address:
        yield cell, address, begin


def test_a_plc_has_a_peg_inserted_and_the_next_command_runs(served, tmp_path):
    cell, address, begin = served
    with closing(Peer(*address)) as peer:
        peer.connect()
        peer.trigger(INSERT, serial="A-1")
        begin.set()
        inserted = peer.wait_for_result(LONGEST)
        assert inserted.result == Result.SUCCESS, inserted
        assert cell.switch.read() is SwitchState.CLOSED
        assert peer.run(RECOVER, timeout=LONGEST).result == Result.SUCCESS
    with Journal(tmp_path, is_read_only=True) as journal:
        assert [(row.program, row.serial) for row in journal.runs(2)] == [("recover", ""), ("insert_peg", "A-1")]
