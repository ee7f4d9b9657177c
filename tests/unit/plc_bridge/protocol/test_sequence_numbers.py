"""Sequence numbers start each command once, over wraps, losses and restarts."""

import pytest

from plc_bridge.protocol.sequence_numbers import KEPT, NumberMeaning, SequenceNumbers

RUN, OTHER = (100, 0, ""), (101, 0, "")
FIRST, SAME, NEW, LATE, ANEW, DOUBT = (
    NumberMeaning[name] for name in ("FIRST", "SAME", "NEW", "LATE", "ANEW", "DOUBT")
)


def seen(*blocks):
    """Return the meaning of each block of number, command and life counter after those before it."""
    numbers = SequenceNumbers()
    return [numbers.see(*block) for block in blocks]


@pytest.mark.parametrize(
    ("number", "command", "empty"),
    [(1000, SAME, SAME), (1001, NEW, NEW), (1000 + 0x8000, NEW, NEW), (999, LATE, ANEW), (1001 + 0x8000, LATE, ANEW)],
)
def test_what_a_number_means_after_another(number, command, empty):
    assert seen((1000,), (number % 0x10000, RUN))[1] is command
    assert seen((1000,), (number % 0x10000,))[1] is empty


@pytest.mark.parametrize(
    ("blocks", "meanings"),
    [
        ([(0xFFFF,), (0, RUN), (0xFFFF, RUN)], [FIRST, NEW, LATE]),
        ([(10,), (9, RUN), (10,)], [FIRST, LATE, SAME]),
        ([(5,), (6, RUN), (5,), (6, RUN)], [FIRST, NEW, ANEW, NEW]),
    ],
)
def test_numbers_wrap_and_a_late_one_is_not_taken_for_the_last(blocks, meanings):
    assert seen(*blocks) == meanings


@pytest.mark.parametrize(
    ("before", "after", "meanings"),
    [((10,), [(9, RUN), (11, RUN)], [LATE, FIRST]), ((10, RUN), [(10, RUN), (11, RUN)], [SAME, NEW])],
)
def test_after_a_loss_a_new_number_is_adopted(before, after, meanings):
    numbers = SequenceNumbers()
    numbers.see(*before)
    numbers.forget()
    assert [numbers.see(*block) for block in after] == meanings


BEFORE = ((4, None, 8), (5, RUN, 9), (6, RUN, 11), (6, RUN, 12))


@pytest.mark.parametrize(
    ("blocks", "meanings"),
    [
        ([(5, None, 10), (6, RUN, 13)], [ANEW, SAME]),
        ([(5, None, 10), (7, RUN, 13)], [ANEW, NEW]),
        ([(5, None, 10), (6, RUN, 11), (6, RUN, 13)], [ANEW, DOUBT, SAME]),
        ([(5, None, 10), (6, RUN, 12), (6, RUN, 12), (6, RUN, 12)], [ANEW, DOUBT, DOUBT, DOUBT]),
        ([(5, None, 10), (4, None, 8), (5, RUN, 9), (6, RUN, 13)], [ANEW, ANEW, DOUBT, SAME]),
        ([(4, RUN, 8), (6, RUN, 13)], [LATE, SAME]),
        ([(4, None, 1), (5, RUN, 2)], [ANEW, NEW]),
        ([(4, None, 1), (5, OTHER, 9)], [ANEW, NEW]),
        ([(4, None, 1), (5, RUN, 9), (5, RUN, 10)], [ANEW, DOUBT, NEW]),
        ([(4, None, 1), (4, None, 8), (5, RUN, 9)], [ANEW, SAME, NEW]),
        ([(4, RUN, 1), (5, RUN, 2), (6, RUN, 3)], [LATE, NEW, NEW]),
        ([(4, None, 13), (5, RUN, 14)], [ANEW, NEW]),
    ],
)
def test_the_life_counter_separates_late_blocks_from_a_new_program(blocks, meanings):
    assert seen(*BEFORE, *blocks)[len(BEFORE) :] == meanings


@pytest.mark.parametrize(("number", "meaning"), [(KEPT, NEW), (KEPT - 1, DOUBT)])
def test_the_commands_of_so_many_numbers_are_remembered_and_no_more(number, meaning):
    counted = [(n, RUN, n + 1) for n in range(2 * KEPT)]
    assert seen(*counted, (0, None, 1), (number, OTHER, number + 1))[-2:] == [ANEW, meaning]
