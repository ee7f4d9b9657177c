import pytest

from plc_bridge.sequence_numbers import LATE_WINDOW, SequenceNumbers, Verdict


@pytest.mark.parametrize(
    ("number", "verdict"),
    [
        (1000, Verdict.SAME),
        (1001, Verdict.NEW),
        (999, Verdict.LATE),
        (1000 - LATE_WINDOW, Verdict.LATE),
        (999 - LATE_WINDOW, Verdict.NEW),
    ],
)
def test_what_a_number_means_after_another(number, verdict):
    numbers = SequenceNumbers()
    assert numbers.see(1000) is Verdict.FIRST
    assert numbers.see(number) is verdict


def test_a_late_number_is_not_taken_for_the_last():
    numbers = SequenceNumbers(last=10, must_adopt=False)
    numbers.see(9)
    assert numbers.see(10) is Verdict.SAME


def test_numbers_wrap_both_ways():
    numbers = SequenceNumbers(last=0xFFFF, must_adopt=False)
    assert numbers.see(0) is Verdict.NEW
    assert numbers.see(0xFFFF) is Verdict.LATE


def test_after_a_loss_the_next_number_is_adopted_but_a_late_one_stays_late():
    numbers = SequenceNumbers(last=10, must_adopt=False)
    numbers.forget()
    assert numbers.see(9) is Verdict.LATE
    assert numbers.see(11) is Verdict.FIRST


def test_a_command_without_a_number_gets_the_next():
    numbers = SequenceNumbers(last=0xFFFF, must_adopt=False)
    assert numbers.count_up() == 0
    assert numbers.see(0) is Verdict.SAME
