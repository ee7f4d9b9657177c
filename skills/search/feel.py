"""Contact evidence of a search by the height of the plate and the push that it bears; and that push, which slips in the hand reduce."""

from collections import deque
from dataclasses import dataclass

from drivers.quantities import Vector
from skills.contract import Observation
from skills.guards.wrench_zero import WrenchZero
from skills.held_peg import EXPLAINED
from skills.search.params import TOUCHED_TIME, SpraySearchParams
from skills.search.surface import Plane, SurfaceEstimate

SLIP = 0.1
"""Change of theta that counts as a slip of the peg in the hand, rad. Source: chosen, not measured."""
SOFTNESS = 1.1e-4
"""Travel of the peg in the pads for each newton of push that the plate no longer bears, m/N: pads of 9 kN/m. They lower the peg into the hole before
the hand has fallen after it. Source: docs/tried/search.md."""

LIKELY = 0.5
"""Share of the dip threshold that is evidence of an edge where the hole is likely: a stop that finds no hole there costs less than the whole area, which
follows on a fall that was missed."""


class Bearing:
    """Whether the plate bears the push: the mean force of a while, so that neither a blow nor noise is taken for it."""

    def __init__(self, share: float, zero: WrenchZero, scan_period: float) -> None:
        """Begin with nothing felt; `share` of the push has to exceed the noise of the wrench in free air, and the scan's period is in s."""
        self._share, self._zero, self._forces = (
            share,
            zero,
            deque[float](maxlen=max(round(TOUCHED_TIME / scan_period), 1)),
        )

    def after(self, force: float, push: float) -> bool:
        """Take the force along z in one scan, N, and return whether the plate bears the push, N."""
        forces = self._forces
        forces.append(force)
        count = len(forces)
        return count == forces.maxlen and sum(forces) / count > self._zero.guarded(self._share * push, count)

    def require_sense(self, push: float) -> None:
        """Make sure that a plate which did not bear the push, N, does not seem to pull instead.

        Raises:
            WrenchReversedError: The sign of the reported wrench is reversed.
        """
        self._zero.require_sense(self._forces, self._share * push)


LONGEST_SLIP = 0.02
"""Largest slip of the peg up into the hand since it last touched the plate, m: half of what the pads are long. Nothing but a slip makes a peg
shorter that has touched before. Source: chosen, not measured."""


def excess_of(height: float, axis: Vector, bound: float, has_touched: bool = False) -> float | None:
    """Return by how much further than believed the peg reaches from the hand that touched the plate, m.

    One touch cannot separate a long peg from a high plate. The peg is taken for it: with a plate that is higher by h, the seated peg then
    seems deeper by (1/cos(tilt) - 1) h, 0.4 h at 45 degrees, and turns about a point that is off by as much as 1.4 h. A long peg
    that is taken for a high plate seems shallower by all its excess when it is seated, and turns about a point that is off by it.

    Args:
        height: Height of the peg's lowest point over the plate's stated surface where it touches, m, by the assumed length.
        axis: Axis of the peg, unit, shape (3,), base frame.
        bound: Largest credible excess, m.
        has_touched: Whether the peg has touched the plate since it was grasped, so that it may have slipped by more since.

    Returns:
        Excess, negative for a short peg; 0 where other errors explain it; None where it is beyond the bound.
    """
    excess = height / max(float(axis[2]), 0.5)
    if not -(max(bound, LONGEST_SLIP) if has_touched else bound) <= excess <= bound:
        return None
    return excess if abs(excess) > EXPLAINED else 0.0


class EdgeEvidence:
    """Watches the height of the plate, and what it bears, for evidence of an edge; one object serves one search."""

    def __init__(self, params: SpraySearchParams, surface: SurfaceEstimate, scan_period: float) -> None:
        """Take the surface estimate and the scan's period, s."""
        self._params, self._surface = params, surface
        self._late = deque[Vector](maxlen=max(round(params.late / scan_period), 1))
        self._heights = deque[float](maxlen=max(round(params.sudden / scan_period), 1))
        self._newest = max(round(params.newest / scan_period), 1)
        self._forces = deque[float](maxlen=max(round(params.borne / scan_period), self._newest + 1))

    def update(self, seen: Observation, edge: Vector, is_likely: bool = False) -> tuple[float, bool]:
        """Return the depth of the peg's lowest point `edge` below the surface estimate, m, and whether there is
        evidence of an edge.

        Args:
            seen: Observation of this scan.
            edge: Lowest point of the peg, shape (3,), m, base frame.
            is_likely: Whether the peg comes by where the hole is likely.
        """
        # If a corner leads, half of it can come from a turn of the peg in the hand, which the skin measures late.
        halved = is_likely and self._params.lag is None
        threshold = self._params.dip_threshold * (LIKELY if halved else 1.0)
        height = float(seen.arm.tcp.position[2])
        dip, deviation = self._surface.below(edge)
        below = dip - deviation
        # The peg in soft pads is deeper than the height of the hand alone would have it: z = z_hand + (F_before - F) / k.
        lowered = SOFTNESS * self._unloaded(float(seen.arm.wrench.force[2]))
        return below, self._drop(height) >= self._params.shared * threshold and below + lowered > threshold

    def learn(self, edge: Vector) -> None:
        """Take a scan without an edge; the surface estimate is updated by one that is `search.late` back."""
        if len(self._late) == self._late.maxlen:
            self._surface.learn(self._late.popleft())
        self._late.append(edge)

    def restart(self) -> None:
        """Forget the heights of the motion before; the peg has begun to move in another way."""
        self._late.clear()
        self._heights.clear()
        self._forces.clear()

    def _unloaded(self, force: float) -> float:
        """Take the force along z, N, and return by how much less the plate bears than just before, N; 0 after less than `search.borne` of sliding."""
        forces = self._forces
        forces.append(force)
        if len(forces) < (forces.maxlen or 0):
            return 0.0
        newest, count = sum(list(forces)[-self._newest :]), len(forces) - self._newest
        return (sum(forces) - newest) / count - newest / self._newest

    def _drop(self, height: float) -> float:
        """Take the height of the hand, m, and return by how much it has dropped within `search.sudden`, m."""
        self._heights.append(height)
        return max(self._heights) - height

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
