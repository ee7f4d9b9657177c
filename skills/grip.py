"""How hard a held peg may be pushed before it slips along the fingers, by what is believed of the grip; pure.

Friction of the two pads bears 2 mu N along the fingers, and mu N l/2 about the closing axis. A load of both is borne inside an
ellipse, and a peg that turns in the pads also slips along them, square to that ellipse: with the share s of 2 mu N along
the fingers, a turn of one radian makes a slip of (l/4) s / sqrt(1 - s^2). This is the limit surface of friction [howe].
"""

import math
from dataclasses import dataclass
from typing import TypeVar

from drivers.config_model import ConfigModel
from drivers.parts import Peg
from skills.corner_adjust import CornerAdjustParams
from skills.corner_insert import CornerInsertParams
from skills.grasp_from_rack import GraspFromRackParams
from skills.search.feel import SLIP
from skills.search.params import SpraySearchParams
from skills.spiral_params import SpiralAdjustParams
from skills.tactile_insert import TactileInsertParams

CONTACT = 0.036
"""Length of the peg between the pads, m: pads of 41 mm, behind whose middle the peg ends after 15 mm. Longer pads bear more moment, and a
turn then makes more slip."""
MOST_SHARE = 0.9
"""Largest share of what the pads bear that a load counts as, fraction; near 1 the computed slip of a turn has no bound."""
MOST_PATIENT = 3.0
"""Largest factor by which a weaker push lengthens an adjustment and the time without progress after which it is given up: a peg that stands beside
its hole would be pushed for minutes. Source: docs/tried/adjustment.md."""

P = TypeVar("P", bound=ConfigModel)


@dataclass(frozen=True, slots=True)
class Grip:
    """What is believed of the grip."""

    force: float
    """Grip force, N."""
    friction: float
    """Coulomb coefficient of peg on pads, ratio."""
    margin: float
    """Factor by which the product of both may be smaller, ratio, >= 1."""

    @property
    def bears(self) -> float:
        """Largest force along the fingers that the pads surely bear, N."""
        return 2.0 * self.friction * self.force / self.margin

    def bears_over_plate(self, tilt: float, dip: float) -> float:
        """Return the largest push on a plate, N, under which a peg that slips by turning is not taken for one that falls.

        Args:
            tilt: Tilt of the peg from the plate's normal, rad.
            dip: Change of the tip's height that counts as evidence of an edge, m.
        """
        per_turn = dip / (math.cos(tilt) * SLIP * CONTACT / 4.0)
        return per_turn / math.hypot(per_turn, 1.0) * self.bears / math.cos(tilt)

    def searching(self, search: SpraySearchParams) -> SpraySearchParams:
        """Return the parameters of a search that pushes no harder than the pads bear; a weaker push goes more slowly."""
        share = _share(
            search.push_stiffness * search.push_offset, self.bears_over_plate(search.tilt, search.dip_threshold)
        )
        axial = share * search.push_stiffness * search.push_offset * math.cos(search.tilt) / self.bears
        drop = math.cos(search.tilt) * slip_of_turn(axial)
        return search.model_copy(
            update={
                "push_stiffness": search.push_stiffness * share,
                "speed": search.speed * share,
                "slip_drop": max(search.slip_drop, drop),
            }
        )

    def inserting(self, insert: TactileInsertParams) -> TactileInsertParams:
        """Return the parameters of an insertion that pushes no harder than the pads bear."""
        low, high = insert.push_stiffness
        share = _share(high * insert.push_offset, self.bears)
        return _softer(insert, share, push_stiffness=(low * share, high * share))

    def bears_dithered(self, adjust: SpiralAdjustParams, length: float) -> float:
        """Return the largest push down a hole, N, under which the slip of a dithered peg is not taken for progress.

        In one period the circles, whose radius is half the first one in the mean, turn the peg about one axis by 2/pi of their arc.

        Args:
            adjust: Parameters of the adjustment.
            length: Distance from the finger centre to the peg's end, m.
        """
        turned = adjust.dither_radius / length / math.pi * adjust.dither_rate * adjust.dither_period
        per_turn = adjust.jammed / max(turned * CONTACT / 4.0, 1e-9)
        return per_turn / math.hypot(per_turn, 1.0) * self.bears

    def adjusting(self, adjust: SpiralAdjustParams, length: float) -> SpiralAdjustParams:
        """Return the parameters of an adjustment that pushes no harder than the pads bear, for a peg of this length, m; a weaker push
        takes longer.
        """
        push = adjust.push_stiffness * adjust.push_offset
        if push <= self.bears:
            return adjust
        share = _share(push, self.bears_dithered(adjust, length))
        longer = min(1.0 / share, MOST_PATIENT)
        return _softer(
            adjust,
            share,
            push_stiffness=adjust.push_stiffness * share,
            timeout=longer * adjust.timeout,
            stall_timeout=longer * adjust.stall_timeout,
        )

    def load(self, force: float, moment: float) -> float:
        """Return how far out in the limit surface of the pads a load is, ratio: 1 on it.

        Args:
            force: Force along the fingers, N.
            moment: Moment about the closing axis, N·m; alone the pads bear `bears` times a quarter of `CONTACT`.
        """
        return math.hypot(force, moment / (CONTACT / 4.0)) / self.bears

    def load_over_corner(self, down: float, across: float, tilt: float, peg: Peg) -> float:
        """Return the load of the pads, as `load` does, where a peg leans over its corner and is pushed at its end.

        The end lies `length sin(tilt)` beside the finger centre towards the corner, of which the part across the closing axis is the arm of
        the push down; that of the push across is `length cos(tilt)`. The wall's and the plate's answers turn the peg the same way.

        Args:
            down: Push down, N.
            across: Push across the closing axis, N.
            tilt: Tilt of the peg, rad.
            peg: The peg.
        """
        arm = math.sin(tilt) * math.sin(peg.part.azimuth(0.0))
        return self.load(down * math.cos(tilt), peg.length * (down * arm + across * math.cos(tilt)))

    def raising(self, insert: CornerInsertParams, tilt: float, peg: Peg) -> CornerInsertParams:
        """Return the parameters with which a peg that leans over its corner by `tilt`, rad, is raised and turned: its pushes, down and
        ahead, become smaller by one factor where the pads would not bear them at the beginning or at the end of the way.
        """
        down, across = insert.push_stiffness * insert.push_offset, insert.gains.translation * insert.lead[1]
        share, kept = (
            _share(self.load_over_corner(push, across, lean, peg), 1.0)
            for push, lean in ((down, insert.tilt), (insert.push_back * down, tilt))
        )
        return _softer(
            insert,
            min(share, kept),
            push_stiffness=insert.push_stiffness * share,
            push_back=insert.push_back * min(kept / share, 1.0),
            lead=_times(min(share, kept), insert.lead),
        )

    def entering(self, adjust: CornerAdjustParams, tilt: float, peg: Peg) -> CornerAdjustParams:
        """Return the parameters with which a peg that leans by `tilt`, rad, is brought between the walls, its pushes bounded likewise.

        The push along the closing axis does not turn the peg in the pads, and stays.
        """
        down, across = adjust.push_stiffness * adjust.push_offset, adjust.gains.translation * adjust.lead[1]
        share = _share(self.load_over_corner(down, across, tilt, peg), 1.0)
        lead = adjust.lead[0], share * adjust.lead[1]
        return _softer(adjust, share, push_stiffness=adjust.push_stiffness * share, lead=lead)


def slip_of_turn(share: float) -> float:
    """Return the slip along the fingers, m, of a peg that turns by 1 rad under this share of what the pads bear along them."""
    share = min(share, MOST_SHARE)
    return CONTACT / 4.0 * share / math.sqrt(1.0 - share * share)


def grip_of(grasp: GraspFromRackParams, share: float = 1.0) -> Grip:
    """Return what a cell believes of its grip, of which slips have left this share to be counted on."""
    return Grip(share * grasp.force, grasp.pad_friction, grasp.grip_margin)


def _share(push: float, most: float) -> float:
    """Return the share of a push that may be kept, fraction."""
    return min(most / max(push, 1e-9), 1.0)


def _times(share: float, lead: tuple[float, float]) -> tuple[float, float]:
    return share * lead[0], share * lead[1]


def _softer(params: P, share: float, **changes: object) -> P:
    return params if share == 1.0 else params.model_copy(update=changes)
