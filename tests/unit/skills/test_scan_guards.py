"""What a scan makes sure of, at the limit and one beyond it."""

import pytest

from drivers.errors import ScanOverrunError
from skills.scan_guards import MOST_OVERRUNS, OVERRUN_WINDOW, Overruns

PERIOD = 0.01


def late(overruns, due):
    return overruns.due_after(due + 1.5 * PERIOD)


def test_the_next_scan_is_due_one_period_after_this_one():
    assert Overruns(PERIOD).due_after(2.0) == pytest.approx(2.0 + PERIOD)


def test_a_few_late_scans_are_borne_and_one_more_is_a_fault():
    overruns = Overruns(PERIOD)
    due = overruns.due_after(0.0)
    for _ in range(MOST_OVERRUNS):
        due = late(overruns, due)
    with pytest.raises(ScanOverrunError, match=f"{MOST_OVERRUNS + 1} of the last {MOST_OVERRUNS + 2} took longer"):
        late(overruns, due)


def test_what_is_older_than_the_window_is_forgiven():
    overruns = Overruns(PERIOD)
    due = overruns.due_after(0.0)
    for _ in range(MOST_OVERRUNS):
        due = late(overruns, due)
    for _ in range(OVERRUN_WINDOW):
        due = overruns.due_after(due)
    assert late(overruns, due) > due
