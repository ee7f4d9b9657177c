"""The lease: the permission to start. The cell has one lease for all its buses; time is passed in.

    | event                                  | holder afterwards                                   |
    | -------------------------------------- | --------------------------------------------------- |
    | `command_lease` is TAKE, lease is free | that link                                           |
    | a start is accepted, lease is free     | that link: a simple PLC needs no request            |
    | any request of the holder              | the same: activity keeps the lease                  |
    | holder closed, its host takes or starts | the new link of that host                          |
    | holder closed, a link resumes its run  | that link, which is then also watched for the run   |
    | release, silence for `timeout`         | none; during the holder's run not before its end    |
    | the holder's run was lost              | none                                                |
    | restart of the cell                    | none                                                |

Only the holder may start, reset, clear, hold or unhold. Every link may stop and abort, even with its first number.
"""

from dataclasses import dataclass

from plc_bridge.protocol.links import Link
from plc_bridge.protocol.messages import LeaseState
from plc_bridge.protocol.peer_log import PeerLog


@dataclass(slots=True)
class CellLease:
    """The one lease of the cell.

    Args:
        timeout: Silence of the holder after which the lease is free again, s.
        log: Logger of changes of the holder.
    """

    timeout: float
    log: PeerLog
    holder: Link | None = None
    runner: Link | None = None
    """Link whose run is under way; its lease passes only to a link that resumes that run."""
    is_given_back: bool = False
    """True if the holder has released the lease and keeps it to the end of its run."""

    @property
    def name(self) -> str:
        """Name of the holder; empty if the lease is free."""
        return self.holder.source if self.holder is not None else ""

    def is_open_to(self, link: Link) -> bool:
        """Return True if `link` holds the lease or can take it, also from a closed link of its host."""
        if self.holder is None or self.holder is link:
            return True
        is_passed_on = self.holder is not self.runner or self.is_given_back
        return is_passed_on and link.follows(self.holder)

    def state_for(self, link: Link) -> LeaseState:
        """Return the state of the lease as `link` reads it."""
        if self.holder is link:
            return LeaseState.YOURS
        return LeaseState.FREE if self.is_open_to(link) else LeaseState.TAKEN

    def take(self, link: Link) -> bool:
        """Give the lease to `link` if `link` can take it; return True if `link` now holds the lease."""
        if not self.is_open_to(link):
            return False
        if self.holder is not link:
            self.log.info(link.host, "%s takes the lease", link.source)
        self.holder, self.is_given_back = link, False
        return True

    def resume(self, earlier: Link, link: Link) -> None:
        """Give the lease to `link`, which resumes the run of `earlier`, if `earlier` holds the lease."""
        if self.holder is earlier:
            self.holder = link

    def release(self, link: Link) -> None:
        """Free the lease if `link` holds it or can take it; a holder with a run under way keeps it until the run ends."""
        if self.holder is not None and self.holder is self.runner:
            self.is_given_back |= self.holder is link
        elif self.is_open_to(link):
            self._free(link, "releases the lease")

    def lose(self, link: Link) -> None:
        """Free the lease at once if the lost `link` holds it."""
        if self.holder is link:
            self._free(link, "loses the lease: it was lost")

    def end_run(self) -> None:
        """End the run, and free the lease if its holder has released it during the run."""
        self.runner = None
        if self.is_given_back and self.holder is not None:
            self._free(self.holder, "releases the lease")

    def expire(self, now: float) -> None:
        """Free the lease if its holder has been silent for too long; a run has its own watchdog."""
        holder = self.holder
        if holder is None or holder is self.runner:
            return
        if now - holder.watchdog.heard > self.timeout:
            self._free(holder, f"loses the lease: silent for {self.timeout:g} s")

    def _free(self, link: Link, why: str) -> None:
        if self.holder is not None:
            self.log.info(link.host, "%s %s", link.source, why)
        self.holder, self.is_given_back = None, False
