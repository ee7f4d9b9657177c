import logging

import pytest

from plc_bridge.protocol.lease import CellLease
from plc_bridge.protocol.links import Link
from plc_bridge.protocol.messages import LeaseState
from plc_bridge.protocol.peer_log import PeerLog
from plc_bridge.protocol.watchdog import LinkWatchdog

LOG = PeerLog(logging.getLogger("test"))


def link(source, host=None, **facts):
    return Link(source, host or source, LinkWatchdog(0.0), **facts)


@pytest.mark.parametrize(
    ("host", "closed", "is_taken"), [("a", 1, True), ("a", None, False), ("a", 3, False), ("b", 1, False)]
)
def test_only_a_link_that_its_host_opened_after_the_holder_had_closed_takes_over(host, closed, is_taken):
    lease, newcomer = CellLease(5.0, LOG), link("new", "a", opened=2)
    lease.take(link("old", host, closed=closed))
    assert lease.take(newcomer) is is_taken


def test_what_a_closed_link_held_goes_on_with_its_run_only():
    lease, old, newcomer = CellLease(5.0, LOG), link("old", "a", closed=1), link("new", "a", opened=2)
    lease.take(old)
    lease.runner = old
    assert (lease.take(newcomer), lease.state_for(newcomer)) == (False, LeaseState.TAKEN)
    lease.resume(old, newcomer)
    assert lease.state_for(newcomer) is LeaseState.YOURS


@pytest.mark.parametrize(("now", "is_held"), [(5.0, True), (5.1, False)])
def test_silence_frees_it(now, is_held):
    lease = CellLease(5.0, LOG)
    lease.take(link("holder"))
    lease.expire(now)
    assert (lease.holder is not None) is is_held
