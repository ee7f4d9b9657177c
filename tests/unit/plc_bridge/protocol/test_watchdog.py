import pytest

from plc_bridge.protocol.watchdog import LinkWatchdog


def test_link_without_a_life_counter_lives_by_its_requests():
    assert LinkWatchdog(0.25).silence(1.0) == 0.75


@pytest.mark.parametrize(("now", "is_torn"), [(2.0, False), (2.01, True)])
def test_block_counts_as_torn_from_its_first_torn_write(now, is_torn):
    watchdog = LinkWatchdog(0.0)
    watchdog.see(2, 1, now=1.0)
    watchdog.see(3, 1, now=1.9)
    assert watchdog.is_torn(now, timeout=1.0) is is_torn
