"""Parameters of a search for a thin round peg, and the largest speed along a lane; pure.

A peg that leans over its edge falls into a hole by a share of its own thickness, however thick it is. The depths that detect its fall are
stated for a peg of `search.stated`; a thin one has smaller ones, and it is pushed harder, so that it falls in less time.
"""

import math

from skills.search.params import SpraySearchParams


def fastest(search: SpraySearchParams, width: float) -> float:
    """Return the largest speed along a lane, m/s: the peg crosses a given share of the hole while it falls by the dip threshold.

    Under a constant push a fall takes a time that grows with the root of its depth. A larger threshold than `search.crossed_dip` is taken for
    that one.

    Args:
        search: Parameters of the search.
        width: Diameter of the largest circle inside the hole, m.
    """
    return search.crossings * width * math.sqrt(search.crossed_dip / min(search.dip_threshold, search.crossed_dip))


def firm(search: SpraySearchParams, thickness: float) -> SpraySearchParams:
    """Return the parameters of a search with the push for a round peg of this thickness, m; what the pads bear still bounds it."""
    if thickness > search.thin:
        return search
    stiffness = max(search.push_stiffness, search.thin_push / search.push_offset)
    return search.model_copy(update={"push_stiffness": stiffness})


def shallow(search: SpraySearchParams, thickness: float) -> SpraySearchParams:
    """Return the parameters of a search with the depths for a round peg of this thickness, m."""
    if thickness > search.thin:
        return search
    dip = min(search.thin_dip * thickness, search.dip_threshold)
    return search.model_copy(update={"dip_threshold": dip, "fall": search.fall * thickness / search.stated})
