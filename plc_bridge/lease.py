"""The lease: who may start. One for the cell, whatever the bus; time is passed in.

    | event                                  | holder afterwards                                                 |
    | -------------------------------------- | ----------------------------------------------------------------- |
    | `command_lease` is TAKE, lease is free | that link                                                         |
    | a start is accepted, lease is free     | that link: a simple PLC never has to ask                          |
    | any request of the holder              | the same: activity keeps the lease                                |
    | holder closed, its host asks or starts | the new link of that host                                         |
    | holder closed, a link resumes its run  | that link, which also watches over the run                        |
    | release, silence for `timeout`         | nobody                                                            |
    | the holder's run was lost              | nobody                                                            |
    | restart of the cell                    | nobody                                                            |

Only the holder may start, reset, clear, hold or unhold. Anybody may stop and abort, even with a first number.
"""

import logging
from dataclasses import dataclass, field

from plc_bridge.links import Link
from plc_bridge.messages import LeaseState
from plc_bridge.peer_log import PeerLog

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class CellLease:
    """The one lease of the cell.

    Args:
        timeout: Silence of the holder after which it is free again, s; a local user is never silent.
        log: Logger of who takes and loses the lease.
    """

    timeout: float
    log: PeerLog = field(default_factory=lambda: PeerLog(logger))
    holder: Link | None = None
    runner: Link | None = None
    """Link whose run is under way; its lease goes to no link but one that resumes that run."""

    def is_open_to(self, link: Link) -> bool:
        """Return whether `link` holds the lease or could take it, also from a closed link of its host."""
        if self.holder is None or self.holder is link:
            return True
        return self.holder is not self.runner and link.follows(self.holder)

    def state_for(self, link: Link) -> LeaseState:
        """Return the state of the lease as `link` reads it."""
        if self.holder is link:
            return LeaseState.YOURS
        return LeaseState.FREE if self.is_open_to(link) else LeaseState.TAKEN

    def take(self, link: Link) -> bool:
        """Give the lease to `link` if it is open to it; return whether `link` holds it now."""
        if self.holder is not link and self.is_open_to(link):
            self.holder = link
            self.log.info(link.host, "%s takes the lease", link.source)
        return self.holder is link

    def resume(self, earlier: Link, link: Link) -> None:
        """Give the lease of `earlier`, if it holds it, to `link`, which resumes its run."""
        if self.holder is earlier:
            self.holder = link

    def release(self, link: Link) -> None:
        """Free the lease if `link` holds it or could take it over."""
        if self.holder is not None and self.is_open_to(link):
            self.holder = None
            self.log.info(link.host, "%s releases the lease", link.source)

    def expire(self, now: float) -> None:
        """Free the lease when its holder has been silent for too long."""
        holder = self.holder
        if holder is not None and not holder.is_local and now - holder.watchdog.heard > self.timeout:
            self.log.info(holder.host, "%s loses the lease: silent for %g s", holder.source, self.timeout)
            self.holder = None
