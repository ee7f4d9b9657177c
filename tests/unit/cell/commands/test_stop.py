"""A signal interrupts whatever has not asked for it yet, and is only noted once somebody asks."""

import signal
import subprocess
import sys
import time
from threading import Event, Thread

import pytest

from cell.commands.cli import GOOD, NOT_GOOD, REPEATED, Stop, main
from cell.commands.terminal import FAULT


def test_a_signal_interrupts_until_the_flag_is_read():
    with pytest.raises(KeyboardInterrupt):
        Stop().take(signal.SIGINT, None)


@pytest.mark.parametrize("ask", [Stop.is_set, lambda stop: stop.wait(0.0)])
def test_a_command_that_reads_the_flag_ends_itself(ask):
    stop = Stop()
    assert not ask(stop)
    stop.take(signal.SIGINT, None)
    assert stop.wait(10.0)


def test_a_signal_while_the_event_is_locked_does_not_deadlock():
    stop = Stop()
    stop.is_set()
    with stop._cond:  # as in the middle of a wait
        stop.take(signal.SIGINT, None)
    assert stop.wait(10.0)


def test_a_later_second_signal_interrupts_and_an_immediate_one_does_not(monkeypatch):
    now = iter([100.0, 100.0 + REPEATED, 100.01 + REPEATED])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    stop = Stop()
    stop.is_set()
    stop.take(signal.SIGHUP, None)
    stop.take(signal.SIGHUP, None)
    with pytest.raises(KeyboardInterrupt):
        stop.take(signal.SIGTERM, None)


def dies() -> None:
    raise ValueError("a damaged byte")


def waits_for_ever(args):
    Thread(target=dies, name="journal").start()
    Event().wait(60.0)


def serves(args):
    args.stop.is_set()
    Thread(target=dies, name="journal").start()
    assert args.stop.wait(60.0)
    return GOOD


@pytest.mark.parametrize("work", [waits_for_ever, serves])
def test_a_thread_that_ends_by_an_error_ends_the_program(monkeypatch, capsys, work):
    monkeypatch.setattr("cell.commands.faults.run", work)
    assert main(["faults"]) == FAULT
    said = capsys.readouterr().err.splitlines()[-1]
    assert "thread journal ended: ValueError: a damaged byte" in said


def test_an_interruption_that_a_callback_swallows_comes_again(monkeypatch, capsys):
    class Swallows:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def work(args):
        Swallows()
        Event().wait(60.0)

    monkeypatch.setattr("cell.commands.faults.run", work)
    assert main(["faults"]) == NOT_GOOD
    assert capsys.readouterr().err == "cell: stopped\n"


def test_a_ctrl_c_during_loading_leaves_no_traceback():
    early = "import builtins, signal; signal.signal(signal.SIGINT, signal.default_int_handler); real = builtins.__import__\n"
    early += "def late(name, *rest):\n    if name == 'cell.commands.cli': signal.raise_signal(signal.SIGINT)\n"
    early += "    return real(name, *rest)\nbuiltins.__import__ = late\n"
    early += "from cell.__main__ import main\nraise SystemExit(main())"
    ended = subprocess.run([sys.executable, "-c", early], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (1, "cell: stopped\n")
