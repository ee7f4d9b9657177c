"""The main job, whole: a PLC's command on a socket, a simulated cell with physics, and the answer on the same socket."""

import re
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.records.journal import Journal
from cell.run.states import State
from drivers.quantities import SwitchState
from plc_bridge.peer import Peer
from plc_bridge.protocol.images import COMMAND, REPORT
from plc_bridge.protocol.messages import Result
from plc_bridge.protocol.registers import Lease
from skills.catalogue import CATALOGUE
from tests import mbpoll
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


def polled(address: tuple[str, int], name: str) -> Iterator[int]:
    """Yield what mbpoll reads in one input register, ten times a second, until nobody listens."""
    place = next(register.address for register in REPORT.registers if register.name == name)
    command = mbpoll.Mbpoll.tcp(address).command("input", place, "-c", "1", "-l", "100")
    with subprocess.Popen(["stdbuf", "-oL", *command], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            for line in process.stdout:
                if found := re.match(rf"\[{place}\]:\s+(\d+)", line):
                    yield int(found[1])
        finally:
            process.terminate()


@mbpoll.needed
def test_a_client_that_is_not_ours_has_a_peg_inserted(served):
    cell, address, begin = served
    for sequence, code in ((1, 0), (2, INSERT)):
        mbpoll.Mbpoll.tcp(address).write("holding", COMMAND.start, 0, sequence, code, 0, 0, Lease.TAKE_FOR_HOST)
    begin.set()
    result = next(value for value in polled(address, "report_result") if value != Result.NONE)
    assert result == Result.SUCCESS
    assert next(polled(address, "report_state")) == State.COMPLETE
    assert cell.switch.read() is SwitchState.CLOSED
