import pytest

from cell.checks import SCANS, check_clock, verdict
from drivers.quantities import SwitchState
from tests.fakes import FakeClock


class BusyClock(FakeClock):
    """Late by each of these times in turn."""

    def __init__(self, late):
        super().__init__()
        self.late = list(late)

    def wait_until(self, stamp):
        super().wait_until(stamp)
        self.time = max(self.time, stamp + self.late.pop(0))


def test_a_clock_that_is_late_by_less_than_half_a_scan_is_good():
    assert check_clock(BusyClock([0.0049] * SCANS), 0.01) == "ok"


def test_three_late_scans_are_good():
    assert check_clock(BusyClock([0.0] * (SCANS - 3) + [0.02] * 3), 0.01) == "ok"


def test_a_clock_that_is_late_is_told_with_how_much():
    told = check_clock(BusyClock([0.0] * (SCANS - 5) + [0.0051] * 4 + [0.02]), 0.01)
    assert "10 ms start 5.1 ms late, at worst 20.0 ms; 5 ms allowed" in told


@pytest.mark.parametrize(
    ("reading", "told"), [(SwitchState.OPEN, "ok"), (SwitchState.CLOSED, "stuck"), (SwitchState.UNKNOWN, "unknown")]
)
def test_a_switch_that_is_not_open_in_an_empty_cell_is_told(reading, told):
    assert told in verdict(reading)
