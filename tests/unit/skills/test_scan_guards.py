"""What a scan makes sure of, at the limit and one beyond it."""

import pytest

from drivers.errors import ScanOverrunError
from skills.scan_guards import LONGEST_STEP, OVERRUN_WINDOW, ScanLimits, ScanTiming, new_window

PERIOD = 0.01
LIMITS = ScanLimits(late=0.3, longest=0.1)


def timed(*waits):
    """Return the timing after scans that begin so long after each other, s."""
    timing, now = ScanTiming(PERIOD, LIMITS, new_window()), 5.0
    timing.take(now)
    for wait in waits:
        now += wait
        timing.take(now)
    return timing


def test_the_next_scan_is_due_one_period_after_this_one():
    assert timed(0.023).due == pytest.approx(5.023 + PERIOD)


def test_a_path_goes_on_by_the_time_that_has_passed_as_far_as_it_may_step():
    assert timed().step == PERIOD
    assert timed(1.7 * PERIOD).step == pytest.approx(1.7 * PERIOD)
    assert timed(9.0 * PERIOD).step == pytest.approx(LONGEST_STEP * PERIOD)
    assert timed(9.0 * PERIOD).passed == pytest.approx(9.0 * PERIOD)


def test_one_scan_may_be_as_late_as_the_limit_says_and_no_later():
    timed(LIMITS.longest).require_kept()
    with pytest.raises(ScanOverrunError, match=r"101 ms after the one before; scan.longest = 0.1 s allowed"):
        timed(LIMITS.longest + 1e-3).require_kept()


def test_as_many_scans_may_be_late_as_the_limit_says_and_no_more():
    timed(*[2.1 * PERIOD] * 30).require_kept()
    with pytest.raises(ScanOverrunError, match=r"31 of the last 100 took longer than 20 ms; 30 allowed by scan\.late"):
        timed(*[2.1 * PERIOD] * 31).require_kept()


def test_what_is_older_than_the_window_is_forgiven():
    late = [2.1 * PERIOD] * 30
    timed(*late, *[PERIOD] * OVERRUN_WINDOW, *late).require_kept()
