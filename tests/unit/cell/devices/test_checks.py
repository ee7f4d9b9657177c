"""A wrong reading, a late loop or a wrong load gets a verdict with its remedy."""

import pytest

from cell.config.files import arm_file
from cell.devices.checks import LEAST_IN_TIME, SCANS, check_clock, hand_verdicts, loop_verdict, remedy, verdict
from drivers.arm.loop_figures import LoopFigures, Times
from drivers.arm.model import read_arm
from drivers.errors import ArmReflexError, SkinSilentError
from drivers.quantities import SwitchState
from tests.fakes import FakeClock

TIMES = Times(1e-4, 2e-4, 3e-4, 1e-3)


class BusyClock(FakeClock):
    """Late by each of these times in turn."""

    def __init__(self, late):
        super().__init__()
        self.late = list(late)

    def wait_until(self, stamp):
        super().wait_until(stamp)
        self.time = max(self.time, stamp + self.late.pop(0))


def test_a_clock_may_be_three_times_late_by_half_a_scan():
    for late in ([0.0049] * SCANS, [0.0] * (SCANS - 3) + [0.02] * 3):
        assert check_clock(BusyClock(late), 0.01) == "ok"
    told = check_clock(BusyClock([0.0] * (SCANS - 5) + [0.0051] * 4 + [0.02]), 0.01)
    assert "10 ms start 5.1 ms late, at worst 20.0 ms; 5 ms allowed" in told


@pytest.mark.parametrize(
    ("reading", "told"), [(SwitchState.OPEN, "ok"), (SwitchState.CLOSED, "stuck"), (SwitchState.UNKNOWN, "unknown")]
)
def test_a_switch_must_be_open_in_an_empty_cell(reading, told):
    assert told in verdict(reading, "parallelogram")


@pytest.mark.parametrize(
    ("missed", "rate", "is_good"),
    [(0, 1.0, True), (5, LEAST_IN_TIME, True), (6, 1.0, False), (0, LEAST_IN_TIME - 0.01, False)],
)
def test_a_late_torque_loop_is_reported(missed, rate, is_good):
    told = loop_verdict(LoopFigures(500, missed, rate, TIMES, TIMES, True, 0.73, 0.0))
    assert told == "ok" if is_good else f"missed {missed} of 500 states" in told and "PREEMPT_RT" in told


@pytest.mark.parametrize(
    ("end_effector", "load", "force", "wrong"),
    [
        (0.73, 0.0, 5.0, []),
        (0.0, 0.7, 5.0, ["end effector"]),
        (0.0, 0.0, 5.0, ["end effector", "load"]),
        (1.2, 0.0, 5.0, ["end effector", "load"]),
        (0.73, 0.2, 5.0, ["load"]),
        (0.73, 0.0, 36.0, ["load"]),
    ],
)
def test_a_wrong_end_effector_and_a_missing_load_are_distinguished(end_effector, load, force, wrong):
    figures = LoopFigures(500, 0, 1.0, TIMES, TIMES, True, end_effector, load)
    found = hand_verdicts(figures, read_arm(arm_file("fr3")).hand, force, 35.0)
    assert [name for name, text in found if text != "ok"] == wrong


def test_a_reflex_is_reported_with_its_remedy():
    assert remedy(ArmReflexError("arm: self-collision")).startswith("fault 2002: arm: self-collision: ")
    assert remedy(SkinSilentError("skin: see the cable")) == "fault 1001: skin: see the cable"
