"""A user of the page: another client of a bridge or a handshake, and the requests of a browser."""

import http.client
from contextlib import closing

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.registers import Lease


def get(
    address: tuple[str, int], path: str, method: str = "GET", **headers: str
) -> tuple[http.client.HTTPResponse, bytes]:
    """Return the answer to one request of HTTP, and its body."""
    with closing(http.client.HTTPConnection(*address, timeout=600)) as connection:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer, answer.read()


def take_lease(handshake: Handshake) -> bool:
    """Open the link of a user, who requests the lease; return True if the link holds it then."""
    handshake.opened("page", "page")
    handshake.wrote("page", CommandImage(lease=Lease.TAKE), is_numbered=False)
    return handshake.holder == "page"
