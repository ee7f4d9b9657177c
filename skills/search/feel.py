"""Contact evidence of a search: the height of the plate and events of the skin; and the push, which slips in the hand
reduce.
"""

from dataclasses import dataclass

from drivers.quantities import Vector
from skills.contract import Observation
from skills.search.params import SpraySearchParams
from skills.surface import Plane, SurfaceEstimate
from skills.tactile.hole_event import HoleEvent

SLIP = 0.1
"""Change of theta that counts as a slip of the peg in the hand, rad."""


class Evidence:
    """Watches the height of the plate and the skin for evidence of an edge; one object serves one search."""

    def __init__(self, params: SpraySearchParams, surface: SurfaceEstimate, event: HoleEvent) -> None:
        """Take the surface estimate and the detector of the skin's events."""
        self._params, self._surface, self._event = params, surface, event

    def update(self, seen: Observation, edge: Vector, sense: int) -> tuple[float, bool]:
        """Return the depth of the peg's lowest point `edge` below the surface estimate, m, and whether there is
        evidence of an edge.

        Args:
            seen: Observation of this scan.
            edge: Lowest point of the peg, shape (3,), m, base frame.
            sense: Sense of the pass along its lane, -1 or 1.
        """
        is_event = seen.is_new_frame and self._event.update(seen.frame)
        below = self._surface.below(edge, sense)
        return below, is_event if self._params.evidence == "skin" else below > self._params.dip_threshold

    def learn(self, edge: Vector, sense: int) -> None:
        """Update the surface estimate by a scan without an edge."""
        self._surface.learn(edge, sense)

    def restart(self) -> None:
        """Tell the skin's detector that the peg has begun to move in another way, which changes the readings."""
        self._event.restart()

    def forget(self, below: float) -> None:
        """Start the surface estimate anew where all of the plate seems to lie `below`, m: theta has jumped, and the
        estimate with it.
        """
        if below > self._params.dip_threshold:
            self._surface = SurfaceEstimate()

    @property
    def events(self) -> int:
        """Number of events of the skin so far."""
        return self._event.count

    def plane(self, near: Vector) -> Plane:
        """Return the plane of the surface estimate at `near`, shape (2,) or more, m, base frame."""
        return self._surface.plane(near)


@dataclass(frozen=True, slots=True)
class Push:
    """How hard the peg is pushed down; every slip in the hand reduces it, because friction at the tip turns the peg.
    Pure.
    """

    stiffness: float
    """Stiffness along z, N/m."""
    theta: float
    """In-hand angle after the last slip, rad."""

    def after(self, theta: float, params: SpraySearchParams) -> "Push":
        """Return the push after a scan in which the in-hand angle is `theta`, rad."""
        if abs(theta - self.theta) <= SLIP:
            return self
        return Push(max(params.push_back * self.stiffness, params.least_push * params.push_stiffness), theta)
