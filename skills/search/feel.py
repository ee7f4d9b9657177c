"""Contact evidence of a search, from the height of the plate and the push that it bears; and the push, reduced after slips in the hand."""

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
"""Travel of the peg in the pads for each newton of push that the plate no longer bears, m/N: pads of 9 kN/m. The pads lower the peg into the hole
before the hand follows. Source: docs/tried/search.md."""

LIKELY = 0.5
"""Share of the dip threshold that is evidence of an edge at the likely place of the hole. A stop without a hole costs less time there than a missed
fall, after which the search must cover the whole area."""


class Bearing:
    """Detects whether the plate bears the push, by the mean force over `TOUCHED_TIME`, so that neither an impact nor noise counts."""

    def __init__(self, share: float, zero: WrenchZero, scan_period: float) -> None:
        """Start without readings. The threshold is `share` of the push, raised if the noise in free air requires it; the scan's period is in s."""
        self._share, self._zero, self._forces = (
            share,
            zero,
            deque[float](maxlen=max(round(TOUCHED_TIME / scan_period), 1)),
        )

    def after(self, force: float, push: float) -> bool:
        """Process the force along z of one scan, N; return True if the plate bears the push, N."""
        forces = self._forces
        forces.append(force)
        count = len(forces)
        return count == forces.maxlen and sum(forces) / count > self._zero.guarded(self._share * push, count)

    def require_sense(self, push: float) -> None:
        """Check the sign of the force if the plate did not bear the push, N.

        Raises:
            WrenchReversedError: The sign of the reported wrench is reversed.
        """
        self._zero.require_sense(self._forces, self._share * push)


LONGEST_SLIP = 0.02
"""Largest slip of the peg up into the hand since it last touched the plate, m: half the length of the pads. After the first touch, only a slip can
make the peg shorter. Source: chosen, not measured."""


def excess_of(height: float, axis: Vector, bound: float, has_touched: bool = False) -> float | None:
    """Return the excess of the peg's length over the assumed length, m, from the height at which it touched the plate.

    One touch cannot separate a long peg from a high plate; the peg is assumed to be the cause. If the plate was higher by h, the seated
    peg then seems deeper by (1/cos(tilt) - 1) h, 0.4 h at 45 degrees, and rotates about a point that is off by up to 1.4 h. If a long
    peg counted as a high plate, the seated peg would seem shallower by its whole excess, and its point of rotation would be off by it.

    Args:
        height: Height of the peg's lowest point over the plate's stated surface at contact, m, computed with the assumed length.
        axis: Axis of the peg, unit, shape (3,), base frame.
        bound: Largest credible excess, m.
        has_touched: True if the peg has touched the plate since the grasp; a slip since then can have made it shorter than `bound`.

    Returns:
        Excess, negative for a short peg; 0 if other errors explain it; None if it is beyond the bound.
    """
    excess = height / max(float(axis[2]), 0.5)
    if not -(max(bound, LONGEST_SLIP) if has_touched else bound) <= excess <= bound:
        return None
    return excess if abs(excess) > EXPLAINED else 0.0


class EdgeEvidence:
    """Finds evidence of an edge in the height of the plate and in the force that it bears; one object serves one search."""

    def __init__(self, params: SpraySearchParams, surface: SurfaceEstimate, scan_period: float) -> None:
        """Store the surface estimate; the scan's period is in s."""
        self._params, self._surface = params, surface
        self._late = deque[Vector](maxlen=max(round(params.late / scan_period), 1))
        self._heights = deque[float](maxlen=max(round(params.sudden / scan_period), 1))
        self._newest = max(round(params.newest / scan_period), 1)
        self._forces = deque[float](maxlen=max(round(params.borne / scan_period), self._newest + 1))

    def update(self, seen: Observation, edge: Vector, is_likely: bool = False) -> tuple[float, bool]:
        """Return the depth of the peg's lowest point `edge` below the surface estimate, m, and True if there is evidence
        of an edge.

        Args:
            seen: Observation of this scan.
            edge: Lowest point of the peg, shape (3,), m, base frame.
            is_likely: True if the peg is over the likely place of the hole.
        """
        # The threshold of a leading corner stays: half of it can come from a rotation in the hand, which the skin measures late.
        halved = is_likely and self._params.lag is None
        threshold = self._params.dip_threshold * (LIKELY if halved else 1.0)
        height = float(seen.arm.tcp.position[2])
        dip, deviation = self._surface.below(edge)
        below = dip - deviation
        # In soft pads, the peg sinks further than the hand, by (F_before - F) / k.
        lowered = SOFTNESS * self._unloaded(float(seen.arm.wrench.force[2]))
        return below, self._drop(height) >= self._params.shared * threshold and below + lowered > threshold

    def learn(self, edge: Vector) -> None:
        """Process a scan without an edge; update the surface estimate with the scan that is `search.late` old."""
        if len(self._late) == self._late.maxlen:
            self._surface.learn(self._late.popleft())
        self._late.append(edge)

    def restart(self) -> None:
        """Discard the heights and forces of the previous motion, because the peg begins another one."""
        self._late.clear()
        self._heights.clear()
        self._forces.clear()

    def _unloaded(self, force: float) -> float:
        """Process the force along z, N; return the loss of force against the time just before, N; 0 until `search.borne` of sliding has passed."""
        forces = self._forces
        forces.append(force)
        if len(forces) < (forces.maxlen or 0):
            return 0.0
        newest, count = sum(list(forces)[-self._newest :]), len(forces) - self._newest
        return (sum(forces) - newest) / count - newest / self._newest

    def _drop(self, height: float) -> float:
        """Process the height of the hand, m; return its drop within `search.sudden`, m."""
        self._heights.append(height)
        return max(self._heights) - height

    def plane(self, near: Vector) -> Plane:
        """Return the plane of the surface estimate at `near`, shape (2,) or more, m, base frame."""
        return self._surface.plane(near)


@dataclass(frozen=True, slots=True)
class Push:
    """Push on the peg as a stiffness along z; every slip in the hand reduces it, because friction at the tip turns the peg.
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
