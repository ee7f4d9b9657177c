"""The requests in the coils of one link: execute and reset by their rising edges; pure.

A coil that is 1 in the first write after its link opened or was lost has no edge that was seen: the command that it may
have meant before the loss must not be run again.
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
    """The coil is 0, whatever it was before."""


@dataclass(slots=True)
class Coils:
    """The coils of one link as written last; None before the first write."""

    execute: bool | None = None
    reset: bool | None = None

    def take(self, coil: Literal["execute", "reset"], written: Mapping[str, bool]) -> Edge:
        """Take a coil if it is among those just written."""
        before, now = getattr(self, coil), written.get(coil)
        if now is None:
            return Edge.NONE
        setattr(self, coil, now)
        if not now:
            return Edge.LOW
        if before is None:
            return Edge.UNSEEN
        return Edge.NONE if before else Edge.ROSE
