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
    """How the hand goes to the first point and down to the surface."""
    gains: Gains
    """Stiffness and damping along the path and in rotation."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_back: Annotated[float, Field(gt=0.0, le=1.0)]
    """Share of the push that is kept at every slip of the peg in the hand, fraction; friction at the tip turns it."""
    least_push: Annotated[float, Field(gt=0.0, le=1.0)]
    """Smallest share of the push that is left after slips, fraction."""
    push_damping: PositiveFloat
    """Damping along z, N·s/m; the push over this is the fastest fall."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the surface, m; 0.01 in [gibbons]."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4)]
    """Tilt of the peg from the vertical, rad; 45 degrees in [gibbons]."""
    tilt_azimuth: Annotated[float, Field(ge=-math.pi, le=math.pi)]
    """Tilt azimuth, of the peg's upper end, rad."""
    fast_axis: Literal["x", "y"]
    """Axis of the base frame that is swept fast."""
    path: Literal["sinusoids", "lanes"]
    """Path over the plate: sinusoids as in [gibbons], or straight lanes at one speed."""
    speed: Annotated[float, Field(gt=0.0, le=0.5)]
    """Peak speed of the tip, m/s."""
    run_up: NonNegativeFloat
    """Time in which the tip reaches its speed, s; sliding off at once digs the edge in."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0)]
    """Largest distance between neighbouring passes, multiple of the hole's diameter or shorter side."""
    margin: tuple[Annotated[float, Field(ge=0.0, le=0.01)], Annotated[float, Field(ge=0.0, le=0.01)]]
    """Reach of the passes beyond the area, along its fast axis and across it, m."""
    edge_leads: bool
    """Whether the path is drawn by the lowest point of the peg's edge, which falls in, and not by the middle of its
    end."""
    height: Annotated[float, Field(gt=0.0, le=0.1)]
    """Height above the surface at the end of the free-space approach, m."""
    descent: Annotated[float, Field(gt=0.0, le=0.5)]
    """Speed at which the setpoint comes down to the surface, m/s; the blow grows with it."""
    touch_down: Annotated[float, Field(gt=TOUCHED_TIME)]
    """Longest time to come down to the surface, s; the path begins as soon as the push is felt."""
    trim_rate: NonNegativeFloat
    """Rate at which the setpoint across the lanes is moved against the tip's error there, 1/s; joint friction holds
    the arm off."""
    trim_limit: NonNegativeFloat
    """Largest move of the setpoint across the lanes, m."""
    evidence: Literal["skin", "height"]
    """Contact evidence that stops the path: an event of the skin, as in [gibbons], or a dip of the tip, which no frame
    can miss."""
    event: HoleEventParams
    """How a hole event of the skin is told from noise."""
    dip_threshold: PositiveFloat
    """Dip of the tip below the surface that is evidence of an edge, m; the exact fall at 45 degrees is 2.4 mm."""
    fall: NonNegativeFloat
    """Depth below the surface at which the resting tip is in the hole, m; 0 takes the evidence for the hole, as
    [gibbons] does."""
    rest: PositiveFloat
    """Time for which the hand rests before the tip's depth is judged, by a frame of its end, s."""
    probe_radius: NonNegativeFloat
    """Radius of the spiral that looks round the place of the evidence where the resting tip is not deep enough, m."""
    probe_speed: PositiveFloat
    """Speed of the tip along the probing spiral, m/s."""
    probe_pitch: PositiveFloat
    """Distance between the turns of the probing spiral, m."""
    timeout: PositiveFloat
    """Longest search, s; 100 in [gibbons]."""
