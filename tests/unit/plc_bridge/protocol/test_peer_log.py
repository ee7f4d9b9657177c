"""The log about each host is bounded, and so is the number of hosts."""

import logging

import pytest

from plc_bridge.protocol.peer_log import HOSTS, LINES, PERIOD, PeerLog

LOGGER = logging.getLogger("test")


def told(caplog, now, hosts):
    caplog.clear()
    caplog.set_level(logging.INFO)
    log = PeerLog(LOGGER, lambda: now[0])
    for host in hosts:
        now[0] += 0.001
        log.warning(host, "%s: bad", host)
    return log, [record.getMessage() for record in caplog.records]


def test_the_lines_about_one_host_are_limited(caplog):
    now = [0.0]
    log, lines = told(caplog, now, ["a"] * 1000 + ["b"])
    assert lines == ["a: bad"] * LINES + [f"a: no more lines about it for {PERIOD:g} s", "b: bad"]
    now[0] += PERIOD + 1.0
    log.info("a", "%s: again", "a")
    assert [record.getMessage() for record in caplog.records][-2:] == [
        f"a: {1000 - LINES} more lines about it were left out",
        "a: again",
    ]


@pytest.mark.parametrize(("others", "is_forgotten"), [(HOSTS - 1, False), (HOSTS, True)])
def test_the_oldest_host_is_forgotten_beyond_the_limit(caplog, others, is_forgotten):
    _, lines = told(caplog, [0.0], ["a"] * LINES + [str(n) for n in range(others)] + ["a"])
    assert (lines[-1] == "a: bad") is is_forgotten
