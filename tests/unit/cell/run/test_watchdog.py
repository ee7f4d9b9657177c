"""Late scans are counted, and a blocked scan halts the arm."""

import threading
from types import SimpleNamespace

import pytest

from cell.run import watchdog
from cell.run.watchdog import GIVEN_UP, HANG, LOOK_PERIOD, WARNED, WINDOW, LateScans, ScanWatchdog
from drivers.errors import ScanOverrunError
from skills.guards.scan_guards import ScanLimits

PERIOD = 0.01
LIMITS = ScanLimits(late=0.5)


def scanned(late, waits):
    """Take scans that begin so long after each other, s."""
    now = 0.0
    late.take(now)
    for wait in waits:
        now += wait
        late.take(now)
    return late


def test_a_scan_is_late_after_two_periods():
    assert scanned(LateScans(PERIOD, LIMITS), [2.0 * PERIOD, 0.01, 0.0199, 0.0201, 0.5]).count == 2


def test_a_pause_between_scans_is_not_late():
    late = scanned(LateScans(PERIOD, LIMITS), [0.01])
    late.rest()
    late.take(200.0)
    assert late.count == 0


@pytest.mark.parametrize(("number", "is_warned"), [(WARNED, False), (WARNED + 1, True)])
def test_more_than_a_few_late_scans_are_warned_of(number, is_warned):
    assert scanned(LateScans(PERIOD, LIMITS), [0.03] * number).is_warned is is_warned


def test_late_scans_leave_the_window_and_stay_counted():
    late = scanned(LateScans(PERIOD, LIMITS), [0.03] * 10 + [0.01] * WINDOW)
    assert (late.is_warned, late.count) == (False, 10)


def test_late_scans_end_one_run_and_not_the_next():
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
    """Thread and end of a watchdog that looks on demand, with a wall clock that goes on meanwhile."""

    def __init__(self, monkeypatch):
        self.time = 50.0
        thread = SimpleNamespace(start=lambda: None, join=lambda: None)
        threads = SimpleNamespace(
            Event=lambda: self, Thread=lambda target, **_: setattr(self, "look", target) or thread
        )
        monkeypatch.setattr(watchdog, "time", SimpleNamespace(monotonic=lambda: self.time))
        monkeypatch.setattr(watchdog, "threading", threads)

    def clear(self): ...

    def set(self): ...

    def looks(self, times, wait=0.02, meanwhile=lambda: None):
        """Let it look so many times, every time after a wait, s."""
        self.left, self.step, self.meanwhile = times, wait, meanwhile
        self.look()

    def wait(self, period):
        assert period == LOOK_PERIOD
        self.left -= 1
        self.time += self.step
        self.meanwhile()
        return self.left < 0


class Watched(Looked):
    """A started watchdog with what it halts and gives up."""

    def __init__(self, monkeypatch, is_simulated=False):
        super().__init__(monkeypatch)
        self.stop, self.halts, self.given_up = threading.Event(), [], []
        self.dog = ScanWatchdog(
            0.2, is_simulated=is_simulated, halt=self.halts.append, stop=self.stop, give_up=self.given_up.append
        )
        self.dog.start()


@pytest.fixture
def looked(monkeypatch):
    return Watched(monkeypatch)


def test_a_blocked_scan_halts_once_and_is_a_fault_afterwards(looked):
    looked.dog.watch(True)
    looked.looks(9)
    assert looked.halts == []
    looked.looks(40, 0.021)
    assert looked.halts == ["no scan for 0.21 s; 0.2 s allowed: it computes or waits too long"]
    with pytest.raises(ScanOverrunError, match=r"adjust: no scan for 0\.21 s"):
        looked.dog.beat("adjust")
    looked.dog.watch(True)
    looked.dog.beat("adjust")


def test_scans_in_time_do_not_halt(looked):
    looked.dog.watch(True)
    looked.looks(100, 0.19, meanwhile=lambda: looked.dog.beat("scan"))
    looked.looks(100, 0.19, meanwhile=looked.dog.alive)
    assert looked.halts == []


@pytest.mark.parametrize("begin", [lambda dog: dog.watch(False), lambda dog: (dog.beat("scan"), dog.beat("scan"))])
def test_an_idle_cell_may_be_blocked_for_a_minute(looked, begin):
    begin(looked.dog)
    looked.looks(round(HANG / 0.02))
    assert looked.halts == []
    begin(looked.dog)
    looked.looks(round(HANG / 0.02) + 3)
    assert [halt[:29] for halt in looked.halts] == ["no scan for 60.00 s; 60 s all"]
    with pytest.raises(ScanOverrunError, match=r"^scan: no scan for 60"):
        looked.dog.beat("scan")


def test_an_idle_cell_that_hangs_is_given_up_at_the_end(looked):
    looked.dog.watch(False)
    looked.stop.set()
    looked.looks(round(GIVEN_UP / 0.02))
    assert (looked.halts, looked.given_up) == ([], [])
    looked.looks(round(GIVEN_UP / 0.02) + 3)
    assert looked.halts[0].startswith("no scan for 2.00 s; 2 s allowed")
    assert looked.given_up[0] == looked.halts[0]


def test_a_starved_watchdog_does_not_blame_a_simulated_scan(monkeypatch):
    looked = Watched(monkeypatch, is_simulated=True)
    looked.dog.watch(True)
    looked.looks(5, 1.0)
    assert looked.halts == []


@pytest.mark.parametrize("step", [0.02, 0.25])
def test_a_program_that_hangs_is_given_up_at_the_end(looked, step):
    looked.dog.watch(True)
    looked.looks(round(GIVEN_UP / step) + 10, step)
    assert looked.given_up == []
    looked.stop.set()
    looked.looks(round(GIVEN_UP / step), step)
    assert looked.given_up == []
    looked.looks(round(GIVEN_UP / step) + 3, step)
    assert looked.given_up[0] == looked.halts[0]


def test_the_first_scan_has_no_limit_before_the_end(looked):
    looked.dog.beat("scan")
    looked.looks(100, 1.0)
    assert looked.halts == []
    looked.stop.set()
    looked.looks(4, 1.0)
    assert looked.given_up


def test_a_started_watchdog_halts_from_a_daemon_thread():
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


def test_a_scan_exactly_at_the_limit_does_not_halt(looked):
    looked.time = 0.0
    looked.dog.watch(True)
    looked.looks(2, 0.2)
    assert looked.halts == []
