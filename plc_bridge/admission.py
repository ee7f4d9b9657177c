"""Admission of connections to a server: who has a place, and who leaves when there is none; pure.

A place is needed from the moment a connection is accepted, so that TLS handshakes are in the same account. A connection
that has never sent a request leaves before all others, one whose stop coil is 1 after all others, and a host that has
all its places makes room among its own. A connection that holds the lease or has a run under way never leaves; where
only such are left the newcomer is turned away.
"""

from collections import Counter
from collections.abc import Collection
from typing import Protocol, TypeVar


class Guest(Protocol):
    """A connection, as far as admission needs to know it."""

    address: str
    """Address of its host."""
    arrived: float
    """Time at which the connection was accepted, s."""
    heard: float | None
    """Time of its last request, s; None before the first."""

    @property
    def holds_stop(self) -> bool:
        """Whether the connection holds its stop coil at 1; closing the connection would let the coil fall."""


T = TypeVar("T", bound=Guest)


class NoPlaceError(Exception):
    """No connection may be asked to leave for a newcomer."""


def who_leaves(guests: Collection[T], kept: Collection[T], address: str, places: int, places_of_host: int) -> T | None:
    """Return who has to leave for a newcomer, or None where there is a place.

    Args:
        guests: All connections that have a place.
        kept: Connections among them that may not be asked to leave.
        address: Address of the newcomer's host.
        places: Number of places.
        places_of_host: Number of places that one host may have.

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
        return min(asked, key=lambda guest: (guest.holds_stop, guest.heard or 0.0))
    crowd = Counter(guest.address for guest in silent)
    return min(silent, key=lambda guest: (-crowd[guest.address], guest.arrived))
