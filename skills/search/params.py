"""How to search."""

import math
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat

from skills.contract import SkillParams
from skills.motion import Gains, Transfer
from skills.tactile.hole_event import HoleEventParams

TOUCHED_TIME = 0.1
"""The plate counts as touched once the push has been felt for so long, s: a blow is shorter."""


class SpraySearchParams(SkillParams):
    """How to search."""

    transfer: Transfer
    """To the first point and down to the surface."""
    gains: Gains
    """Along the path."""
    push_stiffness: PositiveFloat
    """Along z, N/m."""
    relief: Annotated[float, Field(gt=0.0, le=1.0)]
    """The push is taken back to this share at every slip of the peg in the hand: friction at the tip turns it."""
    least_push: Annotated[float, Field(gt=0.0, le=1.0)]
    """But not below this share."""
    push_damping: PositiveFloat
    """Along z, N·s/m: the push over this is the fastest fall."""
    push_offset: NonNegativeFloat
    """The tip's setpoint lies so far below the surface, m; 0.01 in [gibbons]."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4)]
    """Of the peg, rad; 45 degrees in [gibbons]."""
    lean: Annotated[float, Field(ge=-math.pi, le=math.pi)]
    """Azimuth that the peg's upper end leans to, rad."""
    fast_axis: Literal["x", "y"]
    """Axis of the base frame that is swept fast."""
    path: Literal["sinusoids", "lanes"]
    """As [gibbons] has it, or straight lanes at one speed."""
    speed: Annotated[float, Field(gt=0.0, le=0.5)]
    """Peak speed of the tip, m/s."""
    run_up: NonNegativeFloat
    """Time in which the tip reaches its speed, s: sliding off at once digs the edge in."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0)]
    """Largest distance between neighbouring passes, in diameters of the hole, or shorter sides."""
    margin: tuple[Annotated[float, Field(ge=0.0, le=0.01)], Annotated[float, Field(ge=0.0, le=0.01)]]
    """The strips that the passes cover reach so far beyond the area, along its fast axis and across it, m."""
    edge_leads: bool
    """The path is drawn by the lowest point of the peg's edge, which falls in, and not by the middle of its end."""
    height: Annotated[float, Field(gt=0.0, le=0.1)]
    """Above the surface at the end of the free-space approach, m."""
    descent: Annotated[float, Field(gt=0.0, le=0.5)]
    """Speed at which the setpoint comes down to the surface, m/s: the blow grows with it."""
    touch_down: Annotated[float, Field(gt=TOUCHED_TIME)]
    """Longest time to come down to the surface, s; the path begins as soon as the push is felt."""
    trim_rate: NonNegativeFloat
    """At which the setpoint across the lanes is moved against the tip's error there, 1/s: joint friction holds the arm off."""
    trim_limit: NonNegativeFloat
    """Largest such move, m."""
    evidence: Literal["skin", "height"]
    """What stops the path: an event of the skin, as in [gibbons], or a dip of the tip, which no frame can miss."""
    event: HoleEventParams
    dip: PositiveFloat
    """Of the tip below the surface, that is evidence of an edge, m; the exact fall at 45 degrees is 2.4 mm."""
    fall: NonNegativeFloat
    """The resting tip must stand so far below the surface, m; 0 takes the evidence for the hole, as [gibbons] does."""
    rest: PositiveFloat
    """Time for which the hand rests before the tip's depth is judged, by a frame of its end, s."""
    probe_radius: NonNegativeFloat
    """Where the resting tip is not deep enough, a spiral of this radius looks round the place of the evidence, m."""
    probe_speed: PositiveFloat
    """Along that spiral, m/s."""
    probe_pitch: PositiveFloat
    """Between its turns, m."""
    timeout: PositiveFloat
    """Longest search, s; 100 in [gibbons]."""
