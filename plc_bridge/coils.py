"""The requests in the coils of one link: execute and reset by their rising edges, stop by its level; pure.

A coil that is 1 in the first write after its link opened or was lost has no edge that was seen: the command that it may
have meant before the loss must not be run again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto


class Edge(Enum):
    """Meaning of a write of a coil."""

    NONE = auto()
    """The coil was not written, or stays 1."""
    ROSE = auto()
    """The coil was written from 0 to 1."""
    UNSEEN = auto()
    """The coil is 1 in its first write."""
    LOW = auto()
    """The coil is 0, whatever it was before."""


@dataclass(slots=True)
class Coils:
    """The coils of one link as written last; None before the first write."""

    execute: bool | None = None
    reset: bool | None = None
    stop: bool = False

    def take_execute(self, written: Mapping[str, bool]) -> Edge:
        """Take the coil `execute` if it is among those just written."""
        edge, self.execute = _edge(self.execute, written.get("execute"))
        return edge

    def take_reset(self, written: Mapping[str, bool]) -> Edge:
        """Take the coil `reset` if it is among those just written."""
        edge, self.reset = _edge(self.reset, written.get("reset"))
        return edge

    def take_stop(self, written: Mapping[str, bool]) -> bool:
        """Take the coil `stop` if it is among those just written, and tell whether it rose."""
        before, self.stop = self.stop, written.get("stop", self.stop)
        return self.stop and not before

    def forget(self) -> None:
        """Let the next write count as the first; the stop stays what it is."""
        self.execute = self.reset = None


def _edge(before: bool | None, now: bool | None) -> tuple[Edge, bool | None]:
    """Return the meaning of a write, and the state of the coil after it."""
    if now is None:
        return Edge.NONE, before
    if not now:
        return Edge.LOW, False
    if before is None:
        return Edge.UNSEEN, True
    return (Edge.NONE if before else Edge.ROSE), True
