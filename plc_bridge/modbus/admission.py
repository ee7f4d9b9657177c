"""Admission of connections to a server: free places, and the choice of the connection to close if no place is free; pure.

A connection needs a place from its acceptance on, so that TLS handshakes are counted too. If no place is free, the server
first closes a connection that has sent no request, and last a connection with its stop coil at 1. If a host has used all
its places, the server closes one of that host's connections. No connection closes for a newcomer while its link holds the
lease or has a run under way; if there are only such connections, the newcomer is rejected.
"""

from collections import Counter
from collections.abc import Collection, Sequence

from plc_bridge.modbus.connection import Connection


class NoPlaceError(Exception):
    """No connection can be closed for a newcomer."""


def who_leaves(
    guests: Collection[Connection], kept: Collection[Connection], address: str, places: int, places_of_host: int
) -> Connection | None:
    """Return the connection to close for a newcomer, or None if there is a free place.

    Args:
        guests: All connections that have a place.
        kept: Connections among them that must not be closed.
        address: Address of the newcomer's host.
        places: Number of places.
        places_of_host: Largest number of places for one host.

    Raises:
        NoPlaceError: There is no free place, and no connection can be closed.
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
    return _least_needed(asked)


def _least_needed(asked: Sequence[Connection]) -> Connection:
    silent = [guest for guest in asked if guest.heard is None]
    if not silent:
        return min(asked, key=lambda guest: (guest.holds_stop, guest.heard or 0.0))
    crowd = Counter(guest.address for guest in silent)
    return min(silent, key=lambda guest: (-crowd[guest.address], guest.arrived))
