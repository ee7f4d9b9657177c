"""A user of the page as another client of a bridge or a handshake."""

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.registers import Lease


def take_lease(handshake: Handshake, source: str = "page") -> bool:
    """Open the link of a user, who requests the lease; return True if the link holds it then."""
    handshake.opened(source, source)
    handshake.wrote(source, CommandImage(lease=Lease.TAKE), is_numbered=False)
    return handshake.holder == source
