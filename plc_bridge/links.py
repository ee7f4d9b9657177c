"""What is known of one link: one conversation with one sequence number."""

from dataclasses import dataclass

from plc_bridge.images import CommandImage
from plc_bridge.messages import Refusal, Result
from plc_bridge.watchdog import Watchdog


@dataclass(slots=True, eq=False)
class Link:
    """A TCP connection, or all connections of a host that asked for that, or a serial line, or a local user."""

    source: str
    host: str
    watchdog: Watchdog
    is_local: bool = False
    is_open: bool = True
    must_adopt: bool = True
    """No number was seen since it opened or since its run was lost."""
    has_spoken: bool = False
    """It wrote something other than a stop; until then it is a spectator."""
    image: CommandImage | None = None
    sequence: int | None = None
    answered: int = 0
    refusal: Refusal = Refusal.NONE
    own: tuple[int, int, Result] | None = None
    """Sequence, code and result of its last command; None while that is the current one, and for a spectator."""
    execute: bool | None = None
    reset: bool | None = None
