"""Who has a place at a server, and who leaves when there is none; pure.

A place is needed from the moment a connection is accepted, so that TLS handshakes are in the same account. Whoever has
never sent a request leaves before everybody else, and a host that has all its places makes room among its own. Who
holds the lease or has a run under way never leaves: where only such are left the newcomer is turned away.
"""

from collections import Counter
from collections.abc import Collection
from typing import Protocol, TypeVar


class Guest(Protocol):
    """A connection, as far as its place is concerned."""

    address: str
    """Of its host."""
    arrived: float
    """When it was accepted, s."""
    heard: float | None
    """When its last request came, s; None before the first."""


T = TypeVar("T", bound=Guest)


class NoPlaceError(Exception):
    """Nobody may be asked to leave for a newcomer."""


def who_leaves(guests: Collection[T], kept: Collection[T], address: str, places: int, places_of_host: int) -> T | None:
    """Return who has to leave for a newcomer, or None where there is a place.

    Args:
        guests: Everybody who has a place.
        kept: Those of them who may not be asked to leave.
        address: Of the newcomer's host.
        places: How many there are.
        places_of_host: How many of them one host may have.

    Raises:
        NoPlaceError: There is no place, and nobody may be asked to leave.
    """
    of_host = [guest for guest in guests if guest.address == address]
    if len(of_host) >= places_of_host:
        asked = of_host
    elif len(guests) >= places:
        asked = list(guests)
    else:
        return None
    asked = [guest for guest in asked if guest not in kept]
    if not asked:
        raise NoPlaceError
    silent = [guest for guest in asked if guest.heard is None]
    if not silent:
        return min(asked, key=lambda guest: guest.heard or 0.0)
    crowd = Counter(guest.address for guest in silent)
    return min(silent, key=lambda guest: (-crowd[guest.address], guest.arrived))
