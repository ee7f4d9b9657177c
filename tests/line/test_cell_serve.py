"""`cell serve` as a process: it ends on a signal with the arm stopped and the run on record."""

import signal
import time
from contextlib import closing
from functools import partial

import pytest

from cell.commands.cli import NOT_GOOD, REPEATED
from cell.lab.faults import program
from cell.records.journal import Journal
from cell.records.schema import EventKind
from cell.run.states import State
from cell.run.supervisor import EXIT_BLOCKED
from drivers.errors import CellError, FaultCode
from plc_bridge.peer import Peer
from sim.hand.switch import SimSwitch
from skills.catalogue import CATALOGUE

INSERT = CATALOGUE["insert_peg"].code
LOCKED = "import ctypes; lock = (ctypes.CDLL(None).pthread_mutex_lock, ctypes.create_string_buffer(64)); lock[0](lock[1]); lock[0](lock[1])"
"""Waits for ever outside the interpreter, which then runs no handler of a signal."""


def serve_hanging(method, mark, wait, words, told):
    """Serve a cell whose switch hangs in one of its methods while a file exists."""
    called = getattr(SimSwitch, method)

    def hang(switch):
        while mark.exists():
            mark.with_suffix(".now").touch()
            exec(wait)
        return called(switch)

    setattr(SimSwitch, method, hang)
    program.serve(words, told)


@pytest.fixture
def served(tmp_path, monkeypatch):
    """Return a function that serves a cell in real time; its switch hangs in a method while `mark` exists."""

    def served(method="", wait="time.sleep(0.01)"):
        if method:
            monkeypatch.setattr(program, "serve", partial(serve_hanging, method, tmp_path / "mark", wait))
        return program.served(tmp_path / "runs", [])

    return served


def faults(folder):
    with Journal(folder / "runs", is_read_only=True) as journal:
        return [event for event in journal.events() if event.kind == EventKind.FAULT]


def test_a_signal_right_after_the_start_ends_the_cell_without_a_fault(served, tmp_path):
    """`test_study_faults.py` has SIGHUP."""
    with served() as running:
        running.signal(signal.SIGINT)
        assert running.wait(30) == 0
    assert faults(tmp_path) == []


def test_a_served_cell_has_scanned_and_a_signal_stops_its_run_first(served, tmp_path):
    with served() as running:
        with closing(Peer(*running.address)) as peer:
            assert peer.look().state == State.IDLE
            peer.connect()
            report = peer.trigger(INSERT)
            while report.stage == 0:
                report = peer.cycle()
        running.signal(signal.SIGTERM)
        assert running.wait(30) == 0
    with Journal(tmp_path / "runs") as journal:
        row = journal.find(1)
    assert (row.outcome, row.stage, row.reason) == ("aborted", "grasp_from_rack", "stopped")


@pytest.mark.parametrize("wait", ["time.sleep(0.01)", LOCKED])
def test_a_device_that_hangs_keeps_no_idle_cell_from_ending(served, tmp_path, wait):
    with served("read", wait) as running:
        (tmp_path / "mark").touch()
        while not (tmp_path / "mark.now").exists():
            time.sleep(0.01)
        running.signal(signal.SIGTERM)
        assert running.wait(30) == EXIT_BLOCKED
    (fault,) = faults(tmp_path)
    assert (fault.code, fault.text[:14]) == (FaultCode.SCAN_OVERRUN, "scan: no scan ")


def test_a_second_signal_ends_a_cell_whose_device_does_not_let_go(served, tmp_path):
    with served("close") as running:
        with closing(Peer(*running.address)) as peer:
            life = peer.look().life
            while peer.look().life == life:
                pass  # until it listens to signals
        (tmp_path / "mark").touch()
        running.signal(signal.SIGTERM)
        with pytest.raises(CellError, match="does not end"):
            running.wait(1.5 * REPEATED)
        running.signal(signal.SIGTERM)
        assert running.wait(30) == NOT_GOOD
