"""Parameters of a search for a thin round peg, and the largest speed along a lane; pure.

A peg that leans over its edge falls into a hole by a fixed share of its own thickness. The depths that detect its fall are stated for the
thickness `search.stated`. For a thin peg they are smaller, and the push is larger, so that the peg falls in less time.
"""

import math

from skills.search.params import SpraySearchParams


def fastest(search: SpraySearchParams, width: float) -> float:
    """Return the largest speed along a lane, m/s: the peg crosses a given share of the hole while it falls by the dip threshold.

    Under a constant push, the time of a fall grows with the square root of its depth. The dip threshold counts as at most
    `search.crossed_dip`.

    Args:
        search: Parameters of the search.
        width: Diameter of the largest circle inside the hole, m.
    """
    return search.crossings * width * math.sqrt(search.crossed_dip / min(search.dip_threshold, search.crossed_dip))


def firm(search: SpraySearchParams, thickness: float) -> SpraySearchParams:
    """Return the parameters of a search with the push for a round peg of this thickness, m; the load of the pads bounds it later."""
    if thickness > search.thin:
        return search
    stiffness = max(search.push_stiffness, search.thin_push / search.push_offset)
    return search.model_copy(update={"push_stiffness": stiffness})


def shallow(search: SpraySearchParams, thickness: float) -> SpraySearchParams:
    """Return the parameters of a search with the depths for a round peg of this thickness, m."""
    if thickness > search.thin:
        return search
    dip = min(search.thin_dip * thickness, search.dip_threshold)
    fall = search.fall * thickness / search.stated
    return search.model_copy(update={"dip_threshold": dip, "fall": fall, "is_doubtful": True})
