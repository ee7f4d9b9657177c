"""Largest push on a held peg before it slips along the fingers, from the assumed grip; pure.

Friction of the two pads bears the force 2 mu N along the fingers, and the moment mu N l/2 about the closing axis. The
limit of both together is an ellipse, the limit surface of friction [howe]. If the peg turns in the pads, it also slips
along the fingers, in the direction normal to the ellipse. With the share s of 2 mu N along the fingers, a rotation of one
radian causes a slip of (l/4) s / sqrt(1 - s^2).
"""

import math
from dataclasses import dataclass
from typing import TypeVar

from drivers.config_model import ConfigModel
from drivers.parts import Peg
from skills.corner.adjust import CornerAdjustParams
from skills.corner.insert import CornerInsertParams
from skills.grasp_from_rack import GraspFromRackParams
from skills.insert.spiral_params import SpiralAdjustParams
from skills.insert.tactile_insert import TactileInsertParams
from skills.search.feel import SLIP
from skills.search.params import SpraySearchParams

CONTACT = 0.036
"""Contact length l of the peg in the pads, m: the pads are 41 mm long, and the peg ends 15 mm behind their middle. A
longer contact bears more moment, and a rotation then causes more slip. Source: derived for the shipped pads.
"""

P = TypeVar("P", bound=ConfigModel)


@dataclass(frozen=True, slots=True)
class Grip:
    """Assumed grip."""

    force: float
    """Grip force, N."""
    friction: float
    """Coulomb coefficient of peg on pads, ratio."""
    margin: float
    """Safety factor on the product of both, ratio, >= 1."""

    @property
    def bears(self) -> float:
        """Largest force along the fingers that the pads bear with the safety margin, N."""
        # 2 mu N / margin
        return 2.0 * self.friction * self.force / self.margin

    def bears_over_plate(self, tilt: float, dip: float) -> float:
        """Return the largest push on a plate, N, under which the slip of a rotating peg is not detected as a drop.

        Args:
            tilt: Tilt of the peg from the plate's normal, rad.
            dip: Change of the tip's height that counts as evidence of an edge, m.
        """
        # Slip of a rotation by SLIP: cos(tilt) SLIP (l/4) s / sqrt(1 - s²) = dip, solved for s = q / sqrt(1 + q²);
        # push = s bears / cos(tilt)
        per_turn = dip / (math.cos(tilt) * SLIP * CONTACT / 4.0)
        return per_turn / math.hypot(per_turn, 1.0) * self.bears / math.cos(tilt)

    def searching(self, search: SpraySearchParams) -> SpraySearchParams:
        """Return the search parameters with the push limited to the load that the pads bear; a weaker push reduces the speed."""
        share = _share(
            search.push_stiffness * search.push_offset, self.bears_over_plate(search.tilt, search.dip_threshold)
        )
        return _softer(search, share, push_stiffness=search.push_stiffness * share, speed=search.speed * share)

    def inserting(self, insert: TactileInsertParams) -> TactileInsertParams:
        """Return the insertion parameters with the push limited to the load that the pads bear."""
        low, high = insert.push_stiffness
        share = _share(high * insert.push_offset, self.bears)
        return _softer(insert, share, push_stiffness=(low * share, high * share))

    def bears_dithered(self, adjust: SpiralAdjustParams, length: float) -> float:
        """Return the largest push down a hole, N, under which the slip of a dithered peg does not count as progress.

        In one period, the mean radius of the circles is half the largest. The circles turn the peg about one axis by 2/pi
        of their arc.

        Args:
            adjust: Parameters of the adjustment.
            length: Distance from the finger centre to the peg's end, m.
        """
        turned = adjust.dither_radius / length / math.pi * adjust.dither_rate * adjust.dither_period
        per_turn = adjust.jammed / max(turned * CONTACT / 4.0, 1e-9)
        return per_turn / math.hypot(per_turn, 1.0) * self.bears

    def adjusting(self, adjust: SpiralAdjustParams, length: float) -> SpiralAdjustParams:
        """Return the adjustment parameters; a push above `bears` is reduced to `bears_dithered`, for a peg of this length, m."""
        push = adjust.push_stiffness * adjust.push_offset
        if push <= self.bears:
            return adjust
        share = _share(push, self.bears_dithered(adjust, length))
        return _softer(adjust, share, push_stiffness=adjust.push_stiffness * share)

    def load(self, force: float, moment: float) -> float:
        """Return the load relative to the limit surface of the pads, ratio: 1 on the surface, less inside.

        Args:
            force: Force along the fingers, N.
            moment: Moment about the closing axis, N·m; the limit without a force is `bears` times a quarter of `CONTACT`.
        """
        # sqrt(F² + (M / (l/4))²) / bears
        return math.hypot(force, moment / (CONTACT / 4.0)) / self.bears

    def load_over_corner(self, down: float, across: float, tilt: float, peg: Peg) -> float:
        """Return the load of the pads, as `load` does, for a peg that leans over its corner and is pushed at its end.

        The end is `length sin(tilt)` from the finger centre towards the corner. The component of that distance across the
        closing axis is the lever arm of the push down. The lever arm of the push across is `length cos(tilt)`. The
        reactions of wall and plate turn the peg in the same direction.

        Args:
            down: Push down, N.
            across: Push across the closing axis, N.
            tilt: Tilt of the peg, rad.
            peg: The peg.
        """
        arm = math.sin(tilt) * math.sin(peg.part.azimuth(0.0))
        return self.load(down * math.cos(tilt), peg.length * (down * arm + across * math.cos(tilt)))

    def raising(self, insert: CornerInsertParams, tilt: float, peg: Peg) -> CornerInsertParams:
        """Return the parameters for raising and turning a peg that leans over its corner by `tilt`, rad.

        Each push down is limited to the load that the pads bear: the reduced push at the start of the raise, the full push
        at its end. The lead is limited by the smaller of both factors.
        """
        down, across = insert.push_stiffness * insert.push_offset, insert.gains.translation * insert.lead[1]
        share, kept = (
            _share(self.load_over_corner(push, across, lean, peg), 1.0)
            for push, lean in ((down, insert.tilt), (insert.push_back * down, tilt))
        )
        least = min(share, kept)
        return _softer(
            insert,
            least,
            push_stiffness=insert.push_stiffness * share,
            push_back=insert.push_back * min(kept / share, 1.0),
            lead=(least * insert.lead[0], least * insert.lead[1]),
        )

    def entering(self, adjust: CornerAdjustParams, tilt: float, peg: Peg) -> CornerAdjustParams:
        """Return the parameters for bringing a peg that leans by `tilt`, rad, between the walls, with pushes that the pads bear.

        The push along the closing axis does not turn the peg in the pads, so it stays unchanged.
        """
        down, across = adjust.push_stiffness * adjust.push_offset, adjust.gains.translation * adjust.lead[1]
        share = _share(self.load_over_corner(down, across, tilt, peg), 1.0)
        lead = adjust.lead[0], share * adjust.lead[1]
        return _softer(adjust, share, push_stiffness=adjust.push_stiffness * share, lead=lead)


def grip_of(grasp: GraspFromRackParams, share: float = 1.0) -> Grip:
    """Return the assumed grip; `share` is the share of it assumed to remain after slips, fraction."""
    return Grip(share * grasp.force, grasp.pad_friction, grasp.grip_margin)


def _share(push: float, most: float) -> float:
    """Return the factor that reduces `push` to at most `most`, fraction."""
    return min(most / max(push, 1e-9), 1.0)


def _softer(params: P, share: float, **changes: object) -> P:
    return params if share == 1.0 else params.model_copy(update=changes)
