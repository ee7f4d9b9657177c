"""The view of the scan for onlookers, and what they wish of a simulation: frozen values through bounded slots that never wait."""

from collections import deque
from dataclasses import dataclass

from skills.contract import Observation

KEPT = 512
"""Number of looks that wait for a slow onlooker; older ones are dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """View of one scan."""

    seen: Observation
    stage: str
    """Name of the skill under way; empty outside a run."""
    run: int
    """Number of the run in the journal; 0 outside a run."""
    surface: float
    """Height of the plate's surface as the part's recipe has it, m, base frame."""


@dataclass(frozen=True, slots=True)
class Pull:
    """The wish of an onlooker to pull a cable of a simulated cell out, or to plug it in again."""

    cable: str
    """Name of the device that the cable leads to."""
    is_out: bool
    source: str
    """Name of whoever wishes it."""


class Live:
    """The slot: the scan thread puts looks in, one other thread takes them out; neither ever waits for the other."""

    def __init__(self) -> None:
        """Begin empty."""
        self._looks: deque[Look] = deque(maxlen=KEPT)
        self._pulls: deque[Pull] = deque(maxlen=KEPT)
        self.fault = ""
        """Message of the last fault; the report tells whether it is still present."""
        self.evidence = ""
        """Evidence of the peg's place, one line."""
        self.unplugged: frozenset[str] = frozenset()
        """Names of the cables that are pulled out, as the scan thread has done it."""

    def show(self, look: Look) -> None:
        """Put in one look; the oldest one goes where there are too many."""
        self._looks.append(look)

    def take(self) -> list[Look]:
        """Return the looks since the last call, oldest first."""
        looks = []
        while self._looks:
            looks.append(self._looks.popleft())
        return looks

    def pull(self, pull: Pull) -> None:
        """Let the scan thread pull or plug a cable at its next scan."""
        self._pulls.append(pull)

    def pulls(self) -> list[Pull]:
        """Return the wishes since the last call, oldest first; for the scan thread."""
        return [self._pulls.popleft() for _ in range(len(self._pulls))]
