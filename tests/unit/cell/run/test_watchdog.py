import threading

import pytest

from cell.run import watchdog
from cell.run.watchdog import GIVEN_UP, HANG, LOOK_PERIOD, WARNED, WINDOW, LateScans, ScanWatchdog
from drivers.errors import ScanOverrunError
from skills.guards.scan_guards import ScanLimits

PERIOD = 0.01
LIMITS = ScanLimits(late=0.5)


def scanned(late, waits):
    """Take scans that begin so long after each other, s."""
    now = 100.0
    late.take(now)
    for wait in waits:
        now += wait
        late.take(now)
    return late


def test_a_scan_is_late_after_two_periods():
    assert scanned(LateScans(PERIOD, LIMITS), [0.01, 0.0199, 0.0201, 0.5]).count == 2
    late = LateScans(PERIOD, LIMITS)
    late.take(0.0)
    late.take(2.0 * PERIOD)
    assert late.count == 0


def test_what_is_done_between_scans_is_not_late():
    late = scanned(LateScans(PERIOD, LIMITS), [0.01])
    late.rest()
    late.take(200.0)
    assert late.count == 0


@pytest.mark.parametrize(("number", "is_warned"), [(WARNED, False), (WARNED + 1, True)])
def test_more_than_a_few_late_scans_of_the_window_are_warned_of(number, is_warned):
    assert scanned(LateScans(PERIOD, LIMITS), [0.03] * number).is_warned is is_warned


def test_late_scans_are_forgotten_with_the_window_and_stay_counted():
    late = scanned(LateScans(PERIOD, LIMITS), [0.03] * 10 + [0.01] * WINDOW)
    assert (late.is_warned, late.count) == (False, 10)


def test_late_scans_that_ended_a_run_do_not_end_the_next():
    late = LateScans(PERIOD, LIMITS)
    with pytest.raises(
        ScanOverrunError, match="51 of the last 100 took longer than 20 ms by the wall clock; 50 allowed"
    ):
        scanned(late, [3.0 * PERIOD] * 51)
    late.rest()
    scanned(late, [3.0 * PERIOD] * 50)
    scanned(late, [PERIOD] * 95)
    assert not late.is_warned
    assert late.count == 101


class Looked:
    """A watchdog that looks at times that the test sets, with a wall clock that goes on meanwhile."""

    def __init__(self, monkeypatch, is_simulated=False):
        self.time, self.stop = 50.0, threading.Event()
        self.halts, self.given_up = [], []
        monkeypatch.setattr(watchdog.time, "monotonic", lambda: self.time)
        self.dog = ScanWatchdog(
            0.2, is_simulated=is_simulated, halt=self.halts.append, stop=self.stop, give_up=self.given_up.append
        )
        self.dog._end = self

    def looks(self, times, wait=0.02, meanwhile=lambda: None):
        """Let it look so many times, every time after a wait, s."""
        self.left, self.step, self.meanwhile = times, wait, meanwhile
        self.dog._look()

    def wait(self, period):
        assert period == LOOK_PERIOD
        self.left -= 1
        self.time += self.step
        self.meanwhile()
        return self.left < 0


@pytest.fixture
def looked(monkeypatch):
    return Looked(monkeypatch)


def test_a_scan_that_does_not_come_in_time_halts_the_arm_once_and_is_a_fault_when_it_comes(looked):
    looked.dog.watch(True)
    looked.looks(9)
    assert looked.halts == []
    looked.looks(40, 0.021)
    assert looked.halts == ["no scan for 0.21 s; 0.2 s allowed: it computes or waits too long"]
    with pytest.raises(ScanOverrunError, match=r"adjust: no scan for 0\.21 s"):
        looked.dog.beat("adjust")
    looked.dog.watch(True)
    looked.dog.beat("adjust")


def test_scans_that_come_are_left_alone(looked):
    looked.dog.watch(True)
    looked.looks(100, 0.19, meanwhile=lambda: looked.dog.beat("scan"))
    looked.looks(100, 0.19, meanwhile=looked.dog.alive)
    assert looked.halts == []


@pytest.mark.parametrize("begin", [lambda dog: dog.watch(False), lambda dog: (dog.beat("scan"), dog.beat("scan"))])
def test_a_cell_that_waits_may_be_held_up_by_a_device_but_not_for_ever(looked, begin):
    begin(looked.dog)
    looked.looks(round(HANG / 0.02))
    assert looked.halts == []
    begin(looked.dog)
    looked.looks(round(HANG / 0.02) + 3)
    assert [halt[:29] for halt in looked.halts] == ["no scan for 60.00 s; 60 s all"]
    with pytest.raises(ScanOverrunError, match=r"^scan: no scan for 60"):
        looked.dog.beat("scan")


def test_a_waiting_cell_that_hangs_when_it_shall_end_is_not_waited_for(looked):
    looked.dog.watch(False)
    looked.stop.set()
    looked.looks(round(GIVEN_UP / 0.02))
    assert (looked.halts, looked.given_up) == ([], [])
    looked.looks(round(GIVEN_UP / 0.02) + 3)
    assert looked.halts[0].startswith("no scan for 2.00 s; 2 s allowed")
    assert looked.given_up[0] == looked.halts[0]


def test_a_watchdog_that_starved_with_a_simulated_scan_does_not_blame_it(monkeypatch):
    looked = Looked(monkeypatch, is_simulated=True)
    looked.dog.watch(True)
    looked.looks(5, 1.0)
    assert looked.halts == []


@pytest.mark.parametrize("step", [0.02, 0.25])
def test_a_program_that_shall_end_does_not_wait_for_ever(looked, step):
    looked.dog.watch(True)
    looked.looks(round(GIVEN_UP / step) + 10, step)
    assert looked.given_up == []
    looked.stop.set()
    looked.looks(round(GIVEN_UP / step), step)
    assert looked.given_up == []
    looked.looks(round(GIVEN_UP / step) + 3, step)
    assert looked.given_up[0] == looked.halts[0]


def test_the_first_scan_may_take_its_time_unless_the_program_shall_end(looked):
    looked.dog.beat("scan")
    looked.looks(100, 1.0)
    assert looked.halts == []
    looked.stop.set()
    looked.looks(4, 1.0)
    assert looked.given_up


def test_a_started_watchdog_halts_from_a_thread_that_keeps_no_program_from_ending_until_it_is_stopped():
    found, halted = [], threading.Event()

    def halt(why):
        found.append(threading.current_thread())
        halted.set()

    dog = ScanWatchdog(1e-3, is_simulated=False, halt=halt, stop=threading.Event(), give_up=found.append)
    dog.stop()
    dog.start()
    dog.watch(True)
    assert halted.wait(10.0)
    assert (found[0].name, found[0].daemon) == ("watchdog", True)
    dog.stop()
    dog.stop()
    assert not found[0].is_alive()


def test_a_scan_that_comes_exactly_when_it_has_to_halts_nothing(looked):
    looked.time = 0.0
    looked.dog.watch(True)
    looked.looks(2, 0.2)
    assert looked.halts == []
