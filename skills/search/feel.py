"""What is felt on the way: the height of the plate, events of the skin, and slips of the peg in the hand."""

from dataclasses import dataclass

from drivers.quantities import Vector
from skills.contract import Observation
from skills.ground import Ground, Plane
from skills.search.params import SpraySearchParams
from skills.tactile.hole_event import HoleEvent

SLIP = 0.1
"""Change of theta that tells of a slip in the hand, rad."""


class Evidence:
    """Watches plate and skin for an edge; one a search."""

    def __init__(self, params: SpraySearchParams, ground: Ground, event: HoleEvent) -> None:
        """Take what watches the plate and what watches the skin."""
        self._params, self._ground, self._event = params, ground, event

    def update(self, seen: Observation, edge: Vector, sense: int) -> tuple[float, bool]:
        """Return how far the lowest point `edge` lies below the plate, m, and whether there is evidence of an edge.

        Args:
            seen: The scan.
            edge: Lowest point of the peg, shape (3,), m, base frame.
            sense: Of the pass, -1 or 1.
        """
        is_event = seen.is_new_frame and self._event.update(seen.frame)
        below = self._ground.below(edge, sense)
        return below, is_event if self._params.evidence == "skin" else below > self._params.dip_threshold

    def learn(self, edge: Vector, sense: int) -> None:
        """Take the height of the plate from a scan without an edge."""
        self._ground.learn(edge, sense)

    def restart(self) -> None:
        """Expect other readings: the peg has begun to move in another way."""
        self._event.restart()

    def forget(self, below: float) -> None:
        """Begin anew where all of the plate seems to lie `below`, m: no edge, but theta has jumped, say, and with it the plane."""
        if below > self._params.dip_threshold:
            self._ground = Ground()

    @property
    def events(self) -> int:
        """Events of the skin so far."""
        return self._event.count

    def plane(self, near: Vector) -> Plane:
        """Return the plate next to `near`, shape (2,) or more, m."""
        return self._ground.plane(near)


@dataclass(frozen=True, slots=True)
class Push:
    """How hard the peg is pushed down: less after every slip in the hand, for it is friction at the tip that turns it; pure."""

    stiffness: float
    """Along z, N/m."""
    theta: float
    """In-hand angle after the last slip, rad."""

    def after(self, theta: float, params: SpraySearchParams) -> "Push":
        """Return the push after a scan in which the in-hand angle is `theta`, rad."""
        if abs(theta - self.theta) <= SLIP:
            return self
        return Push(max(params.push_back * self.stiffness, params.least_push * params.push_stiffness), theta)
