"""Parameters of the search for the hole."""

import math
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Tempo
from skills.contract import SkillParams
from skills.motion import DampedGains, Transfer
from skills.pull_out import PullOut

TOUCHED_TIME = 0.1
"""Time for which the plate has to bear the push before it counts as touched, s; the blow at touch-down is shorter. Source: chosen, not measured."""
FREE_GAP = 1.5e-3
"""Gap that a peg of the largest length leaves above the plate before its first touch-down, m: heights that err, a hand that lags. Source: chosen, not measured."""


class SpraySearchParams(SkillParams):
    """Parameters of the search for the hole.

    Source: chosen, not measured.
    """

    transfer: Annotated[Transfer, Figure(""), Field(exclude=True)] = Transfer()
    """How the hand goes to the first point and down to the surface."""
    gains: DampedGains
    """Stiffness and damping ratio along the path and in rotation. Source: chosen within the margin that `cell check` prints."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, which makes the push, N/m."""
    push_back: Annotated[float, Field(gt=0.0, le=1.0), Quantity("fraction")]
    """Push-back: share of the push that is kept at every slip of the peg in the hand, fraction; friction at the tip turns
    the peg there. Source: chosen, not measured; reason in docs/tried/search.md.
    """
    least_push: Annotated[float, Field(gt=0.0, le=1.0), Quantity("fraction")]
    """Smallest share of the push that is left after slips, fraction. Source: chosen, not measured; reason in docs/tried/search.md."""
    push_offset: Annotated[PositiveFloat, Quantity("m")]
    """Depth of the tip's setpoint below the surface, m; 0.01 in [gibbons]. Source: [gibbons], Sec. IV."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4), Quantity("rad")]
    """Tilt of the peg from the vertical, rad; 45 degrees in [gibbons]. Source: [gibbons], Sec. IV."""
    tilt_azimuth: Annotated[float, Field(ge=-math.pi, le=math.pi), Quantity("rad")]
    """Tilt azimuth: direction in which the peg's upper end stands off the vertical, rad; from the base frame's x axis
    towards y. For a peg with corners it is the azimuth of the hand's closing axis, and a multiple of the peg's
    symmetry. Source: set for each cell.
    """
    turned: Annotated[float, Figure("rad"), Field(exclude=True)] = 0.35
    """Turn of the peg in the hand at which it is lifted off and the hand turns after it, rad. In the air the pads hold it; on the plate they would
    let it turn on. With 0.35 a peg that leaned by 45 degrees leans by 48. Source: docs/tried/search.md.
    """
    fast_axis: Literal["x", "y"]
    """Axis of the base frame that is swept fast; a peg with corners is always swept along its hand's closing axis. Source: set for each cell."""
    speed: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED)]
    """Peak speed of the tip, m/s. Source: measured by `cell study frontier`."""
    run_up: Annotated[PositiveFloat, Quantity("s", Tempo.WAIT)]
    """Time in which the tip reaches its speed, s; the edge digs in where it slides off at once. Source: chosen, not
    measured; reason in docs/tried/search.md.
    """
    pitch: Annotated[float, Field(gt=0.0, le=2.0), Quantity("multiple")]
    """Largest distance between neighbouring passes, multiple of the hole's diameter or shorter side. Source: measured by `cell trials`."""
    margin: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=0.01)], Annotated[float, Field(ge=0.0, le=0.01)]], Quantity("m")
    ]
    """Reach of the passes beyond the area, along its fast axis and across it, m. Source: docs/tried/search.md."""
    height: Annotated[float, Field(gt=0.0, le=0.1), Quantity("m")]
    """Height above the surface at the end of the free-space approach, m."""
    descent: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED)]
    """Speed at which the setpoint comes down to the surface, m/s; the blow at touch-down grows with it."""
    length_bound: Annotated[float, Figure("m"), Field(exclude=True)] = 0.006
    """Largest correction of the peg's length in the hand by the first touch-down, m. Source: docs/tried/search.md."""
    touch_down: Annotated[float, Field(gt=TOUCHED_TIME), Quantity("s", Tempo.LIMIT)]
    """Longest time to come down to the surface, s; the path begins as soon as the plate bears the push."""
    trim_rate: Annotated[PositiveFloat, Quantity("1/s")]
    """Rate at which the setpoint across the lanes is moved against the tip's error there, 1/s; it takes out what joint
    friction holds the arm off. Source: docs/tried/search.md.
    """
    trim_limit: Annotated[NonNegativeFloat, Quantity("m")]
    """Largest move of the setpoint across the lanes, m. Source: chosen, not measured; reason in docs/tried/search.md."""
    dip_threshold: Annotated[PositiveFloat, Quantity("m")]
    """Dip threshold: depth of the tip below the surface estimate that is evidence of an edge, m; the exact fall at 45
    degrees is 2.4 mm. A round peg of 5 mm or less has 0.025 of its thickness at most. Source: set by hand, its rate of false evidence measured by `cell study events`.
    """
    lag: Annotated[float | None, Figure("m"), Field(exclude=True)] = None
    """Lag of the tip behind its setpoint along a pass that is evidence of an edge as well, m; times the stiffness it bounds the force on a wall
    that holds the tip. None leaves it out. Source: docs/tried/corners.md.
    """
    fall: Annotated[PositiveFloat, Quantity("m")]
    """Depth below the surface at which the resting tip is in the hole, m. For a round peg of 5 mm or less it is less in
    proportion to 8 mm. Source: chosen, not measured; reason in docs/tried/search.md.
    """
    rest: Annotated[PositiveFloat, Quantity("s", Tempo.WAIT)]
    """Time for which the hand rests before the tip's depth is judged, by a frame of its end, s. Source: chosen, not
    measured; reason in docs/tried/search.md.
    """
    probe_radius: Annotated[PositiveFloat, Quantity("m")]
    """Radius of the spiral that probes the place of the evidence where the resting tip is not deep enough, m. Source:
    chosen, not measured; reason in docs/tried/search.md.
    """
    probe_speed: Annotated[PositiveFloat, Quantity("m/s", Tempo.SPEED)]
    """Speed of the tip along the probing spiral, m/s. Source: chosen, not measured."""
    probe_pitch: Annotated[PositiveFloat, Quantity("m")]
    """Distance between the turns of the probing spiral, m. Source: chosen, not measured."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT)]
    """Longest search, s; 100 in [gibbons]. Source: [gibbons], Sec. VI."""

    return_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.4
    """Time in which the tip comes back to its course after a rest or a probe, s."""
    pull: Annotated[PullOut, Figure(""), Field(exclude=True)] = PullOut()
    """Motion that pulls the peg out of the hole before another attempt."""

    def first_height(self, reach: float) -> float:
        """Return the height above the stated surface from which a peg comes down that has not touched the plate since its grasp,
        m: one that stands `length_bound` further out of the hand touches nothing before.

        Args:
            reach: Largest distance of a point of the peg's end from its axis, m.
        """
        lowest = self.length_bound * math.cos(self.tilt) + reach * math.sin(self.tilt)
        return max(self.height, lowest + FREE_GAP)
