"""Access to the page's server: names that lead to this computer alone, so that no other site reaches it by a trick; pure."""

import ipaddress
import re
import socket
from functools import cache

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; media-src 'self'; "
    "connect-src 'self' ws://{host} wss://{host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content policy of the page: the browser loads from the cell alone."""

_RANGE = re.compile(r"bytes=(?P<first>\d{0,15})-(?P<last>\d{0,15})", re.ASCII)
_HOST = re.compile(r"(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<name>[\w.-]+))(?::\d{1,5})?", re.ASCII)


def is_own_host(host: str) -> bool:
    """Tell whether the Host of a request is an address, `localhost` or this computer's name.

    Any other name may have been made to lead here by somebody whose page wants to read this one.
    """
    match = _HOST.fullmatch(host)
    if match is None:
        return False
    name = (match["six"] or match["name"]).lower()
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in _names()
    return True


@cache
def _names() -> frozenset[str]:
    """Return the names of this computer."""
    name = socket.gethostname().lower()
    return frozenset({"localhost", name, f"{name}.local"})


def part_of(asked: str, size: int) -> tuple[int, int]:
    """Return the first and the last byte that a request's Range asks for; the whole where it asks for none that there is."""
    match = _RANGE.fullmatch(asked)
    if match is None or not size:
        return 0, size - 1
    if not match["first"]:
        return max(size - (int(match["last"] or 0) or size), 0), size - 1
    first, last = int(match["first"]), min(int(match["last"] or size), size - 1)
    return (first, last) if first <= last else (0, size - 1)


def headers(host: str) -> dict[str, str]:
    """Return the headers of every answer; `host` has been found to be the cell's own."""
    return {
        "Content-Security-Policy": POLICY.format(host=host),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
