"""`cell serve` as a process: it ends on a signal with the arm stopped and the run on record."""

import signal
import subprocess
import time
from contextlib import closing, contextmanager

import pytest

from cell.commands.cli import NOT_GOOD, REPEATED
from cell.records.journal import Journal
from cell.records.schema import EventKind
from cell.run.states import State
from cell.run.supervisor import EXIT_BLOCKED
from drivers.errors import FaultCode
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE
from tests.serving import process

INSERT = CATALOGUE["insert_peg"].code


HANGS = """
import sys, time
from pathlib import Path
from sim.hand.switch import SimSwitch
method, mark = {method!r}, Path({mark!r})
called = getattr(SimSwitch, method)
def hang(switch):
    while mark.exists():
        mark.with_suffix(".now").touch()
        {wait}
    return called(switch)
setattr(SimSwitch, method, hang)
from cell.commands.cli import main
sys.exit(main(sys.argv[1:]))
"""
"""A program of the command line whose switch hangs in one of its methods as long as a file is there."""


@contextmanager
def served(folder, program=("-m", "cell")):
    """Yield the process, and host and port, of a cell that is served at the pace of the wall clock."""
    with process(folder, (), program=program) as (running, (address,)):
        yield running, address


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_whoever_connects_first_meets_a_cell_that_has_scanned_and_a_signal_ends_it(tmp_path, number):
    with served(tmp_path) as (running, address):
        with closing(Peer(*address)) as peer:
            assert peer.look().state == State.IDLE
        running.send_signal(number)
        assert running.wait(30) == 0


def test_a_signal_right_after_the_start_ends_the_cell_without_a_fault(tmp_path):
    with served(tmp_path) as (running, _):
        running.send_signal(signal.SIGINT)
        assert running.wait(30) == 0
    with Journal(tmp_path, is_read_only=True) as journal:
        assert [event for event in journal.events() if event.kind == EventKind.FAULT] == []


def test_a_signal_in_the_middle_of_a_run_stops_it_first(tmp_path):
    with served(tmp_path) as (running, address):
        with closing(Peer(*address)) as peer:
            peer.connect()
            report = peer.trigger(INSERT)
            while report.stage == 0:
                report = peer.cycle()
        running.send_signal(signal.SIGTERM)
        assert running.wait(30) == 0
    with Journal(tmp_path) as journal:
        row = journal.find(1)
    assert (row.outcome, row.stage, row.reason) == ("aborted", "grasp_from_rack", "stopped")


@pytest.fixture
def mark(tmp_path):
    """Return the file as long as which the switch of a program of `hanging` hangs."""
    return tmp_path / "hang"


def hanging(method, mark, wait="time.sleep(0.01)"):
    return "-c", HANGS.format(method=method, mark=str(mark), wait=wait)


def hang(mark):
    """Let the switch hang, and return once it does."""
    mark.touch()
    while not mark.with_suffix(".now").exists():
        time.sleep(0.01)


LOCKED = "import ctypes; lock = (ctypes.CDLL(None).pthread_mutex_lock, ctypes.create_string_buffer(64)); lock[0](lock[1]); lock[0](lock[1])"
"""What waits for ever outside the interpreter, which then runs no handler of a signal."""


@pytest.mark.parametrize("wait", ["time.sleep(0.01)", LOCKED])
def test_a_device_that_hangs_keeps_no_idle_cell_from_ending(tmp_path, mark, wait):
    with served(tmp_path / "runs", hanging("read", mark, wait)) as (running, _):
        hang(mark)
        running.send_signal(signal.SIGTERM)
        assert running.wait(30) == EXIT_BLOCKED
    with Journal(tmp_path / "runs", is_read_only=True) as journal:
        (fault,) = [event for event in journal.events() if event.kind == EventKind.FAULT]
    assert (fault.code, fault.text[:14]) == (FaultCode.SCAN_OVERRUN, "scan: no scan ")


def test_a_second_signal_ends_a_cell_whose_device_does_not_let_go(tmp_path, mark):
    with served(tmp_path / "runs", hanging("close", mark)) as (running, address):
        with closing(Peer(*address)) as peer:
            life = peer.look().life
            while peer.look().life == life:
                pass  # until it listens to signals
        mark.touch()
        running.send_signal(signal.SIGTERM)
        with pytest.raises(subprocess.TimeoutExpired):
            running.wait(1.5 * REPEATED)
        running.send_signal(signal.SIGTERM)
        assert running.wait(30) == NOT_GOOD
