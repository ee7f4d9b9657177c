"""Parameters of a search for a thin round peg; pure.

A peg that leans over its edge falls into a hole by a share of its own thickness, however thick it is. The depths that detect its fall are
stated for a peg of `STATED`; a thin one has smaller ones, and it is pushed harder, so that it falls in less time.
"""

import math

from skills.search.params import SpraySearchParams

STATED = 8e-3
"""Thickness of the peg for which `search.dip_threshold` and `search.fall` are stated, m. Source: [gibbons], Sec. VI."""
THIN = 5e-3
"""Largest thickness of a thin peg, m; with 6 mm nothing was gained, and thicker pegs are searched with as stated. Source: docs/tried/search.md."""
DIP = 0.025
"""Dip threshold of a thin peg, share of its thickness. Source: docs/tried/search.md."""
PUSH = 7.5
"""Least push on a thin peg, N: what pads of the shipped grip bear over a plate. Source: docs/tried/search.md."""

CROSSINGS = 21.0
"""Largest number of hole diameters, or shorter sides, that a lane crosses in a second, 1/s; 0.17 m/s over a hole of 8.1 mm, and with the dip of
a 4 mm peg 0.15 m/s over its hole, where few falls are missed. Source: docs/tried/search.md.
"""
CROSSED_DIP = 3e-4
"""Dip threshold with which `CROSSINGS` was found, m. Source: docs/tried/search.md."""


def fastest(dip: float, width: float) -> float:
    """Return the largest speed along a lane, m/s: the peg crosses a given share of the hole while it falls by the dip threshold.

    Under a constant push a fall takes a time that grows with the root of its depth. A larger threshold than `CROSSED_DIP` is taken for that one.

    Args:
        dip: Dip threshold, m.
        width: Diameter of the largest circle inside the hole, m.
    """
    return CROSSINGS * width * math.sqrt(CROSSED_DIP / min(dip, CROSSED_DIP))


def firm(search: SpraySearchParams, thickness: float) -> SpraySearchParams:
    """Return the parameters of a search with the push for a round peg of this thickness, m; what the pads bear still bounds it."""
    if thickness > THIN:
        return search
    return search.model_copy(update={"push_stiffness": max(search.push_stiffness, PUSH / search.push_offset)})


def shallow(search: SpraySearchParams, thickness: float) -> SpraySearchParams:
    """Return the parameters of a search with the depths for a round peg of this thickness, m."""
    if thickness > THIN:
        return search
    dip = min(DIP * thickness, search.dip_threshold)
    return search.model_copy(update={"dip_threshold": dip, "fall": search.fall * thickness / STATED})
