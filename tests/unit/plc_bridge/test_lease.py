import pytest

from plc_bridge.lease import CellLease
from plc_bridge.links import Link
from plc_bridge.messages import LeaseState
from plc_bridge.watchdog import Watchdog


def link(source, host=None, **facts):
    return Link(source, host or source, Watchdog(0.0), **facts)


def test_one_reader_sees_yours_where_another_sees_taken():
    lease, one, other = CellLease(5.0), link("one"), link("other")
    assert lease.state_for(one) is LeaseState.FREE
    assert (lease.take(one), lease.take(other)) == (True, False)
    assert (lease.state_for(one), lease.state_for(other)) == (LeaseState.YOURS, LeaseState.TAKEN)


def test_only_its_holder_releases_it():
    lease, one = CellLease(5.0), link("one")
    lease.take(one)
    lease.release("other")
    assert not lease.is_open_to(link("other"))
    lease.release("one")
    assert lease.is_open_to(link("other"))


@pytest.mark.parametrize(
    ("host", "is_open", "is_handed_over"), [("a", False, True), ("a", True, False), ("b", False, False)]
)
def test_only_a_closed_link_of_the_same_host_hands_over(host, is_open, is_handed_over):
    lease, newcomer = CellLease(5.0), link("new", "a")
    lease.take(link("old", host, is_open=is_open))
    lease.hand_over(newcomer)
    assert (lease.holder is newcomer) is is_handed_over


@pytest.mark.parametrize(("now", "is_local", "is_held"), [(5.0, False, True), (5.1, False, False), (1e6, True, True)])
def test_silence_frees_it_but_a_local_user_is_never_silent(now, is_local, is_held):
    lease = CellLease(5.0)
    lease.take(link("holder", is_local=is_local))
    lease.expire(now)
    assert (lease.holder is not None) is is_held
