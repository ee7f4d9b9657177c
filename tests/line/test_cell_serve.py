"""`cell serve` as a process: it ends on a signal with the arm stopped and the run on record."""

import signal
import subprocess
import sys
from contextlib import closing, contextmanager

import pytest

from cell.journal import Journal
from cell.states import State
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE

INSERT = CATALOGUE["insert_peg"].code


@contextmanager
def served(folder):
    """Yield the process, and host and port, of a cell that is served at the pace of the wall clock."""
    command = [sys.executable, "-m", "cell", "serve", "--set", "plc.modbus.port=0", "--journal", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            host, port = process.stdout.readline().split()[-1].rsplit(":", 1)
            yield process, (host, int(port))
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_an_idle_cell(tmp_path, number):
    with served(tmp_path) as (process, _):
        process.send_signal(number)
        assert process.wait(30) == 0


def test_whoever_connects_first_meets_a_cell_that_has_scanned(tmp_path):
    with served(tmp_path) as (_, address), closing(Peer(*address)) as peer:
        assert peer.look().state == State.IDLE


def test_a_signal_in_the_middle_of_a_run_stops_it_first(tmp_path):
    with served(tmp_path) as (process, address):
        with closing(Peer(*address)) as peer:
            peer.connect()
            report = peer.trigger(INSERT)
            while report.stage == 0:
                report = peer.cycle()
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0
    with Journal(tmp_path) as journal:
        row = journal.find(1)
    assert (row.outcome, row.stage, row.reason) == ("aborted", "grasp_from_rack", "stopped")
