"""Access to the page's server: only requests under the cell's own names pass, against DNS rebinding; pure."""

import ipaddress
import re
import socket
from collections.abc import Collection
from functools import cache

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; media-src 'self'; "
    "connect-src 'self' {own}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content policy of the page: the browser loads only from the cell."""

_HOST = re.compile(r"(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<name>[\w.-]+))(?::\d{1,5})?", re.ASCII)


def refusal(host: str, origin: str | None, names: Collection[str] = ()) -> str:
    """Return the reason to refuse a request; empty if it names this cell and comes from the cell's own page, or from no page.

    If the name is not the cell's own, another site may have pointed its DNS name here to read this page.

    Args:
        host: The header Host.
        origin: The header Origin; None if there is none.
        names: Names of the cell in lower case, in addition to addresses and the names of this computer.
    """
    match = _HOST.fullmatch(host)
    if match is None or not _is_own((match["six"] or match["name"]).lower(), names):
        return "not a name of this cell"
    if origin is not None and origin.lower() not in (f"http://{host.lower()}", f"https://{host.lower()}"):
        return "requested by the page of another site"
    return ""


def _is_own(name: str, names: Collection[str]) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in names or name in _names()
    return True


@cache
def _names() -> frozenset[str]:
    """Return the names of this computer."""
    name = socket.gethostname().lower()
    return frozenset({"localhost", name, f"{name}.local"})


def is_private(protocol: str, peer: str) -> bool:
    """Return True if a request is private: it comes over TLS, or from this computer."""
    try:
        return protocol == "https" or ipaddress.ip_address(peer).is_loopback
    except ValueError:
        return False


def headers(host: str) -> dict[str, str]:
    """Return the headers of an answer to a request with this Host; for an empty `host`, those of a refusal, which name no host."""
    own = f"ws://{host} wss://{host}" if host else ""
    return {
        "Content-Security-Policy": POLICY.format(own=own),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
