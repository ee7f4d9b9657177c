"""Parameters of the search for the hole."""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from skills.contract import SkillParams
from skills.motion import DampedGains, Transfer
from skills.pull_out import PullOut

TOUCHED_TIME = 0.1
"""Time for which the plate has to bear the push before it counts as touched, s; the blow at touch-down is shorter. Source: chosen, not measured."""


class SpraySearchParams(SkillParams):
    """Parameters of the search for the hole."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    transfer: Annotated[Transfer, Figure(""), Field(exclude=True)] = Transfer()
    """How the hand goes to the first point and down to the surface."""
    gains: Annotated[DampedGains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along the path and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, which makes the push, N/m."""
    push_back: Annotated[
        float,
        Field(gt=0.0, le=1.0),
        Quantity("fraction"),
        Source("chosen, not measured; reason in docs/tried/search.md"),
    ]
    """Push-back: share of the push that is kept at every slip of the peg in the hand, fraction; friction at the tip turns the peg there."""
    least_push: Annotated[
        float,
        Field(gt=0.0, le=1.0),
        Quantity("fraction"),
        Source("chosen, not measured; reason in docs/tried/search.md"),
    ]
    """Smallest share of the push that is left after slips, fraction."""
    push_offset: Annotated[PositiveFloat, Quantity("m"), Source("[gibbons], Sec. IV")]
    """Depth of the tip's setpoint below the surface, m; 0.01 in [gibbons]."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4), Quantity("rad"), Source("[gibbons], Sec. IV")]
    """Tilt of the peg from the vertical, rad; 45 degrees in [gibbons]."""
    tilt_azimuth: Annotated[float, Field(ge=-math.pi, le=math.pi), Quantity("rad"), Source("set for each cell")]
    """Tilt azimuth: direction in which the peg's upper end stands off the vertical, rad; from the base frame's x axis
    towards y. For a peg with corners it is the azimuth of the hand's closing axis, and a multiple of the peg's
    symmetry.
    """
    turned: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/search.md")] = 0.35
    """Turn of the peg in the hand at which it is lifted off and the hand turns after it, rad. In the air the pads hold it; on the plate they would
    let it turn on. With 0.35 a peg that leaned by 45 degrees leans by 48.
    """
    fast_axis: Annotated[Literal["x", "y"], Source("set for each cell")]
    """Axis of the base frame that is swept fast; a peg with corners is always swept along its hand's closing axis."""
    speed: Annotated[
        float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED), Source("measured by `cell study frontier`")
    ]
    """Peak speed of the tip, m/s."""
    run_up: Annotated[
        PositiveFloat, Quantity("s", Tempo.WAIT), Source("chosen, not measured; reason in docs/tried/search.md")
    ]
    """Time in which the tip reaches its speed, s; the edge digs in where it slides off at once."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0), Quantity("multiple"), Source("measured by `cell trials`")]
    """Largest distance between neighbouring passes, multiple of the hole's diameter or shorter side."""
    margin: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=0.01)], Annotated[float, Field(ge=0.0, le=0.01)]],
        Quantity("m"),
        Source("docs/tried/search.md"),
    ]
    """Reach of the passes beyond the area, along its fast axis and across it, m."""
    height: Annotated[float, Field(gt=0.0, le=0.1), Quantity("m")]
    """Height above the surface at the end of the free-space approach, m."""
    descent: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED)]
    """Speed at which the setpoint comes down to the surface, m/s; the blow at touch-down grows with it."""
    length_bound: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/search.md")] = 0.006
    """Largest correction of the peg's length in the hand by the first touch-down, m."""
    touch_down: Annotated[float, Field(gt=TOUCHED_TIME), Quantity("s", Tempo.LIMIT)]
    """Longest time to come down to the surface, s; the path begins as soon as the plate bears the push."""
    trim_rate: Annotated[PositiveFloat, Quantity("1/s")]
    """Rate at which the setpoint across the lanes is moved against the tip's error there, 1/s, which joint friction causes."""
    trim_limit: Annotated[NonNegativeFloat, Quantity("m")]
    """Largest move of the setpoint across the lanes, m."""
    dip_threshold: Annotated[
        PositiveFloat, Quantity("m"), Source("set by hand, its rate of false evidence measured by `cell study events`")
    ]
    """Dip threshold: depth of the tip below the surface estimate that is evidence of an edge, m; the exact fall at 45
    degrees is 2.4 mm. A round peg of 5 mm or less has 0.025 of its thickness at most.
    """
    lag: Annotated[float | None, Figure("m"), Field(exclude=True), Source("docs/tried/corners.md")] = None
    """Lag of the tip behind its setpoint along a pass that is evidence of an edge as well, m; times the stiffness it bounds the force on a wall
    that holds the tip. None leaves it out.
    """
    fall: Annotated[PositiveFloat, Quantity("m"), Source("chosen, not measured; reason in docs/tried/search.md")]
    """Depth below the surface at which the resting tip is in the hole, m. For a round peg of 5 mm or less it is less in
    proportion to 8 mm.
    """
    rest: Annotated[
        PositiveFloat, Quantity("s", Tempo.WAIT), Source("chosen, not measured; reason in docs/tried/search.md")
    ]
    """Time for which the hand rests before the tip's depth is judged, by a frame of its end, s."""
    probe_radius: Annotated[
        PositiveFloat, Quantity("m"), Source("chosen, not measured; reason in docs/tried/search.md")
    ]
    """Radius of the spiral that probes the place of the evidence where the resting tip is not deep enough, m."""
    probe_speed: Annotated[PositiveFloat, Quantity("m/s", Tempo.SPEED), Source("chosen, not measured")]
    """Speed of the tip along the probing spiral, m/s."""
    probe_pitch: Annotated[PositiveFloat, Quantity("m"), Source("chosen, not measured")]
    """Distance between the turns of the probing spiral, m."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT), Source("[gibbons], Sec. VI")]
    """Longest search, s; 100 in [gibbons]."""

    return_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.4
    """Time in which the tip comes back to its course after a rest or a probe, s."""
    pull: Annotated[PullOut, Figure(""), Field(exclude=True)] = PullOut()
    """Motion that pulls the peg out of the hole before another attempt."""
    outside: Annotated[tuple[float, float], Figure("m"), Field(exclude=True)] = (2e-3, 4e-3)
    """Least and largest distance at which the peg comes down from the rim of a hole at the border of the area, m; drawn evenly between
    the two.
    """
    free_gap: Annotated[float, Figure("m"), Field(exclude=True)] = 1.5e-3
    """Gap that a peg of the largest length leaves above the plate before it comes down, m: heights that err, a hand that lags."""
    trimmed_below: Annotated[float, Figure("m"), Field(exclude=True)] = 5e-3
    """Height of the setpoint over the plate from which on the way down the trim works, m; in the air it would wind up against joints at rest."""
    touched: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Share of the push along z above which the plate counts as bearing it, fraction."""
    late: Annotated[float, Figure("s"), Field(exclude=True)] = 0.06
    """Time after which a height teaches the surface estimate, s: a peg that falls while little of the plate is felt yet would take the
    estimate down with it, and the dip would not be seen. A peg that crosses half a hole of 8 mm at 0.14 m/s falls for 0.03 s.
    """
    sudden: Annotated[float, Figure("s"), Field(exclude=True)] = 0.08
    """Time within which the hand drops with a peg that falls into the hole, s: it is caught after 0.02 to 0.05 s."""
    shared: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/search.md")] = 0.5
    """Least drop of the hand with a dip, share of the dip threshold, fraction. A dip that stands still after a rest without a hole, or a new
    angle of the peg, moves the tip and not the hand.
    """
    borne: Annotated[float, Figure("s"), Field(exclude=True), Source("docs/tried/search.md")] = 0.2
    """Time in which a lost push is lost against what the plate bore before, s."""
    newest: Annotated[float, Figure("s"), Field(exclude=True), Source("docs/tried/search.md")] = 0.04
    """Time over which the push that is left is averaged, s: the estimate of the wrench is noisy."""
    rest_damping: Annotated[float, Figure("ratio"), Field(exclude=True)] = 2.5
    """Factor on the translational damping while the hand rests; the hand has to stop within a millimetre or two. Rotation keeps its damping:
    so much more lets a light wrist swing where torques act late.
    """
    gone: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/search.md")] = 0.5
    """Share of the dip threshold below which the dip of a corner has gone, fraction."""
    stuck_within: Annotated[float, Figure("m"), Field(exclude=True)] = 1e-3
    """Largest distance between two rests of a peg that has not got away in between, m."""
    stuck_after: Annotated[int, Figure("count"), Field(exclude=True)] = 3
    """Number of rests in one place from which on the place is passed over."""
    stated: Annotated[float, Figure("m"), Field(exclude=True), Source("[gibbons], Sec. VI")] = 8e-3
    """Thickness of the peg for which `dip_threshold` and `fall` are stated, m."""
    thin: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/search.md")] = 5e-3
    """Largest thickness of a thin peg, m; with 6 mm nothing was gained, and thicker pegs are searched with as stated."""
    thin_dip: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/search.md")] = 0.025
    """Dip threshold of a thin peg, share of its thickness, fraction."""
    thin_push: Annotated[float, Figure("N"), Field(exclude=True), Source("docs/tried/search.md")] = 7.5
    """Least push on a thin peg, N: what pads of the shipped grip bear over a plate."""
    crossings: Annotated[float, Figure("1/s"), Field(exclude=True), Source("docs/tried/search.md")] = 21.0
    """Largest number of hole diameters, or shorter sides, that a lane crosses in a second, 1/s; 0.17 m/s over a hole of 8.1 mm, and with the
    dip of a 4 mm peg 0.15 m/s over its hole, where few falls are missed.
    """
    crossed_dip: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/search.md")] = 3e-4
    """Dip threshold with which `crossings` was found, m."""

    def first_height(self, reach: float, is_length_known: bool = False) -> float:
        """Return the height above the stated surface from which the tip comes down, m; all of a leaning peg is free there.

        Args:
            reach: Largest distance of a point of the peg's end from its axis, m.
            is_length_known: True if the peg has touched the plate since its grasp; before, it may reach further by `length_bound`.
        """
        further = 0.0 if is_length_known else self.length_bound * math.cos(self.tilt)
        return max(self.height, reach * math.sin(self.tilt) + further + self.free_gap)
