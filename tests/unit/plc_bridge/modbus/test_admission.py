"""If the server is full, one connection makes room for a new one."""

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


SPOKE, SILENT, ACTIVE = Caller("spoke", heard=0.0), Caller("silent", "b", arrived=9.0), Caller("active", "b", heard=2.0)
STOP = Caller("stop", heard=1.0, holds_stop=True)
CROWD = [Caller("alone", "b"), Caller("second", "c", 2.0), Caller("first", "c", 1.0)]
OWN = [Caller("other silent", "b"), Caller("own", heard=5.0), Caller("own idle", heard=1.0)]
LEAVING = {
    "nobody while there are places": ([SPOKE], {}, None),
    "who never spoke before who was idle longest": ([SPOKE, SILENT], {}, "silent"),
    "of those who spoke the one idle longest": ([SPOKE, ACTIVE], {}, "spoke"),
    "who holds a stop after all others that spoke": ([STOP, ACTIVE], {}, "active"),
    "who holds a stop if there is nobody else": ([STOP], {"places": 1}, "stop"),
    "of the silent the oldest of the largest crowd": (CROWD, {"places": 3}, "first"),
    "of a host that has all its places one of its own": (OWN, {"address": "a", "places": 9}, "own idle"),
}


@pytest.mark.parametrize(("guests", "room", "left"), LEAVING.values(), ids=LEAVING)
def test_one_leaves_if_there_is_no_place(guests, room, left):
    assert leaves(guests, **room) == left


def test_who_is_kept_stays_and_without_anybody_else_the_newcomer_is_turned_away():
    holder, other = Caller("holder", heard=0.0), Caller("other", heard=9.0)
    assert leaves([holder, other], kept=[holder]) == "other"
    with pytest.raises(NoPlaceError):
        leaves([holder, other], kept=[holder, other])
