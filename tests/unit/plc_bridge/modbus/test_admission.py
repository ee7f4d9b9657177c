from dataclasses import dataclass

import pytest

from plc_bridge.modbus.admission import NoPlaceError, who_leaves


@dataclass(eq=False)
class Caller:
    name: str
    address: str = "a"
    arrived: float = 0.0
    heard: float | None = None
    holds_stop: bool = False


def leaves(guests, address="z", places=2, places_of_host=2, kept=()):
    left = who_leaves(guests, kept, address, places, places_of_host)
    return left and left.name


def test_while_there_are_places_nobody_leaves():
    assert leaves([Caller("one", heard=1.0)]) is None


def test_who_never_spoke_leaves_before_who_was_idle_longest():
    assert leaves([Caller("spoke long ago", heard=0.0, arrived=0.0), Caller("silent", "b", arrived=9.0)]) == "silent"


def test_of_those_who_spoke_the_one_idle_longest_leaves():
    assert leaves([Caller("idle", heard=1.0), Caller("active", "b", heard=2.0)]) == "idle"


def test_who_holds_a_stop_leaves_after_all_others_that_spoke():
    guests = [Caller("stop", heard=1.0, holds_stop=True), Caller("active", "b", heard=2.0)]
    assert leaves(guests) == "active"
    assert leaves([guests[0]], places=1) == "stop"


def test_of_the_silent_the_oldest_of_the_largest_crowd_leaves():
    guests = [Caller("alone", "b"), Caller("second", "c", 2.0), Caller("first", "c", 1.0)]
    assert leaves(guests, places=3) == "first"


def test_a_host_that_has_all_its_places_makes_room_among_its_own():
    guests = [Caller("other silent", "b"), Caller("own", heard=5.0), Caller("own idle", heard=1.0)]
    assert leaves(guests, address="a", places=9) == "own idle"


def test_who_is_kept_stays_and_without_anybody_else_the_newcomer_is_turned_away():
    holder, other = Caller("holder", heard=0.0), Caller("other", heard=9.0)
    assert leaves([holder, other], kept=[holder]) == "other"
    with pytest.raises(NoPlaceError):
        leaves([holder, other], kept=[holder, other])
