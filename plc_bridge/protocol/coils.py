"""The requests in the coils of one link: execute and reset by their rising edges; pure.

If a coil is 1 in the first write after its link opened or was lost, it has no rising edge. Its command may have run before
the loss, so it is not run again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from typing import Literal


class Edge(Enum):
    """Meaning of a write of a coil."""

    NONE = auto()
    """The coil was not written, or stays 1."""
    ROSE = auto()
    """The coil was written from 0 to 1."""
    UNSEEN = auto()
    """The coil is 1 in its first write."""
    LOW = auto()
    """The coil is 0; its previous value does not matter."""


@dataclass(slots=True)
class Coils:
    """Coils of one link as last written; None before the first write."""

    execute: bool | None = None
    reset: bool | None = None

    def take(self, coil: Literal["execute", "reset"], written: Mapping[str, bool]) -> Edge:
        """Return the edge of a coil if it is among those just written."""
        before, now = getattr(self, coil), written.get(coil)
        if now is None:
            return Edge.NONE
        setattr(self, coil, now)
        if not now:
            return Edge.LOW
        if before is None:
            return Edge.UNSEEN
        return Edge.NONE if before else Edge.ROSE
