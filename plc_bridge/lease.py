"""The lease: who may start. One for the cell, whatever the bus; time is passed in.

    | event                                  | holder afterwards                                                 |
    | -------------------------------------- | ----------------------------------------------------------------- |
    | `command_lease` is TAKE, lease is free | that link                                                         |
    | a start is accepted, lease is free     | that link: a simple PLC never has to ask                          |
    | any request of the holder              | the same: activity keeps the lease                                |
    | holder closed, its host writes again   | the new link of that host, which also watches over the run        |
    | release, silence for `timeout`         | nobody                                                            |
    | the holder's run was lost              | nobody                                                            |
    | restart of the cell                    | nobody                                                            |

Only the holder may start, reset, clear, hold or unhold. Anybody may stop and abort, even with a first number.
"""

import logging
from dataclasses import dataclass

from plc_bridge.links import Link
from plc_bridge.messages import LeaseState

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class CellLease:
    """The one lease of the cell.

    Args:
        timeout: Silence of the holder after which it is free again, s; a local user is never silent.
    """

    timeout: float
    holder: Link | None = None

    def is_open_to(self, link: Link) -> bool:
        """Tell whether `link` holds it or could take it."""
        return self.holder in (None, link)

    def state_for(self, link: Link) -> LeaseState:
        """Return what `link` shall read."""
        if self.holder is None:
            return LeaseState.FREE
        return LeaseState.YOURS if self.holder is link else LeaseState.TAKEN

    def take(self, link: Link) -> bool:
        """Give it to `link` if it is free; return whether `link` holds it now."""
        if self.holder is None:
            self.holder = link
            logger.info("%s takes the lease", link.source)
        return self.holder is link

    def release(self, source: str) -> None:
        """Free it if `source` holds it."""
        if self.holder is not None and self.holder.source == source:
            self.holder = None
            logger.info("%s releases the lease", source)

    def hand_over(self, link: Link) -> None:
        """Give `link` what a closed link of the same host held."""
        if self.holder is not None and not self.holder.is_open and self.holder.host == link.host:
            self.holder = link

    def expire(self, now: float) -> None:
        """Free it when its holder has been silent for too long."""
        holder = self.holder
        if holder is not None and not holder.is_local and now - holder.watchdog.heard > self.timeout:
            logger.info("%s loses the lease: silent for %g s", holder.source, self.timeout)
            self.holder = None
