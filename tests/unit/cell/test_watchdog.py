import pytest

from cell.watchdog import LOOK_PERIOD, WARNED, WINDOW, LateScans, older
from drivers.errors import ScanOverrunError
from skills.scan_guards import ScanLimits

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


def test_a_cell_that_does_not_run_in_real_time_is_a_fault():
    scanned(LateScans(PERIOD, LIMITS), [0.03] * 50)
    with pytest.raises(ScanOverrunError, match="51 of the last 100 took longer than 20 ms by the wall clock"):
        scanned(LateScans(PERIOD, LIMITS), [0.03] * 51)


def test_a_starved_watchdog_counts_only_what_it_saw_against_a_simulated_scan():
    assert older(0.1, 5.0, is_simulated=True) == pytest.approx(0.1 + 2 * LOOK_PERIOD)
    assert older(0.1, 5.0, is_simulated=False) == pytest.approx(5.1)
