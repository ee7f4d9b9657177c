import pytest

from plc_bridge.protocol.watchdog import LinkWatchdog


@pytest.mark.parametrize(("now", "is_silent"), [(1.0, False), (1.01, True)])
def test_link_without_a_life_counter_lives_by_its_requests(now, is_silent):
    assert LinkWatchdog(0.0).is_silent(now, timeout=1.0) is is_silent


def test_requests_do_not_replace_a_life_counter_that_stands_still():
    watchdog = LinkWatchdog(0.0)
    watchdog.see(1, 0, now=0.0)
    watchdog.see(1, 0, now=5.0)
    assert watchdog.is_silent(5.0, timeout=1.0)


def test_block_is_torn_while_head_and_tail_differ():
    watchdog = LinkWatchdog(0.0)
    assert [watchdog.see(1, 1, 0.0), watchdog.see(2, 1, 1.0), watchdog.see(2, 2, 2.0)] == [True, False, True]


def test_tail_that_was_never_written_does_not_count():
    assert LinkWatchdog(0.0).see(7, 0, now=0.0)


@pytest.mark.parametrize(("now", "is_torn"), [(2.0, False), (2.01, True)])
def test_block_counts_as_torn_from_its_first_torn_write(now, is_torn):
    watchdog = LinkWatchdog(0.0)
    watchdog.see(2, 1, now=1.0)
    watchdog.see(3, 1, now=1.9)
    assert watchdog.is_torn(now, timeout=1.0) is is_torn
