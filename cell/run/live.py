"""Exchange between scan and page in bounded queues: frozen views of scans to the page, cable requests to the scan."""

from collections import deque
from dataclasses import dataclass

from skills.contract import Observation

KEPT = 512
"""Largest number of waiting looks, and of waiting cable requests; if a queue is full, its oldest entry is dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """View of one scan."""

    seen: Observation
    stage: str
    """Name of the skill under way; empty outside a run."""
    run: int
    """Number of the run in the journal; 0 outside a run."""
    surface: float
    """Height of the plate's surface in the part's recipe, m, base frame."""


@dataclass(frozen=True, slots=True)
class CablePull:
    """Request to unplug a cable of a simulated cell, or to plug it in again."""

    cable: str
    """Name of the device at the cable."""
    is_out: bool
    source: str
    """Name of the requesting link."""


class Live:
    """Exchange between the scan thread, which adds looks, and one other thread, which takes them; neither waits."""

    def __init__(self) -> None:
        """Start empty."""
        self._looks: deque[Look] = deque(maxlen=KEPT)
        self._pulls: deque[CablePull] = deque(maxlen=KEPT)
        self.fault = ""
        """Message of the last fault; the report shows whether it is still present."""
        self.evidence = ""
        """Evidence of the peg's place, one line."""
        self.unplugged: frozenset[str] = frozenset()
        """Names of the unplugged cables; set by the scan thread."""

    def show(self, look: Look) -> None:
        """Add one look; if the queue is full, drop the oldest."""
        self._looks.append(look)

    def take(self) -> list[Look]:
        """Return the looks since the last call, oldest first."""
        return [self._looks.popleft() for _ in range(len(self._looks))]

    def pull(self, pull: CablePull) -> None:
        """Queue a cable request for the next scan."""
        self._pulls.append(pull)

    def pulls(self) -> list[CablePull]:
        """Return the cable requests since the last call, oldest first; for the scan thread."""
        return [self._pulls.popleft() for _ in range(len(self._pulls))]
