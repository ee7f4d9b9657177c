"""Parameters of the search for the hole."""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from skills.contract import SkillParams
from skills.motion import DampedGains, Transfer
from skills.pull_out import PullOut

TOUCHED_TIME = 0.1
"""Time for which the plate must bear the push before it counts as touched, s; the impact at touch-down is shorter. Source: chosen, not measured."""


class SpraySearchParams(SkillParams):
    """Parameters of the search for the hole."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    transfer: Annotated[Transfer, Figure(""), Field(exclude=True)] = Transfer()
    """Motion of the hand to the start of the search, above the surface."""
    gains: Annotated[DampedGains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along the path and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness of the push along z, N/m."""
    push_back: Annotated[
        float,
        Field(gt=0.0, le=1.0),
        Quantity("fraction"),
        Source("chosen, not measured; reason in docs/tried/search.md"),
    ]
    """Push-back: share of the push that remains after each slip of the peg in the hand, fraction; friction at the tip turns the peg."""
    least_push: Annotated[
        float,
        Field(gt=0.0, le=1.0),
        Quantity("fraction"),
        Source("chosen, not measured; reason in docs/tried/search.md"),
    ]
    """Smallest remaining share of the push after slips, fraction."""
    push_offset: Annotated[PositiveFloat, Quantity("m"), Source("[gibbons], Sec. IV")]
    """Depth of the tip's setpoint below the surface, m; 0.01 in [gibbons]."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4), Quantity("rad"), Source("[gibbons], Sec. IV")]
    """Tilt of the peg from the vertical, rad; 45 degrees in [gibbons]."""
    tilt_azimuth: Annotated[float, Field(ge=-math.pi, le=math.pi), Quantity("rad"), Source("set for each cell")]
    """Tilt azimuth: direction in which the peg's upper end leans from the vertical, rad; from the base frame's x axis
    towards y. For a peg with corners it is the azimuth of the hand's closing axis, and must be a multiple of the peg's
    angle of symmetry.
    """
    turned: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/search.md")] = 0.35
    """Rotation of the peg in the hand at which the search lifts the peg and turns the hand by the same angle, rad. In the air the pads hold the
    peg; on the plate it would turn further. At 0.35, a peg that leaned by 45 degrees leans by 48.
    """
    fast_axis: Annotated[Literal["x", "y"], Source("set for each cell")]
    """Axis of the base frame along which the lanes run; for a peg with corners they always run along the hand's closing axis."""
    speed: Annotated[
        float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED), Source("measured by `cell study frontier`")
    ]
    """Peak speed of the tip, m/s."""
    run_up: Annotated[
        PositiveFloat, Quantity("s", Tempo.WAIT), Source("chosen, not measured; reason in docs/tried/search.md")
    ]
    """Time in which the tip reaches its speed, s; if it started at full speed, the peg's edge would dig into the plate."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0), Quantity("multiple"), Source("measured by `cell trials`")]
    """Largest distance between neighbouring passes, multiple of the hole's diameter or shorter side."""
    margin: Annotated[float, Field(ge=0.0, le=0.01), Quantity("m"), Source("docs/tried/search.md")]
    """Reach of the passes beyond the area, m; it covers errors of the tip's place, and the lag by which friction holds the tip behind its setpoint."""
    height: Annotated[float, Field(gt=0.0, le=0.1), Quantity("m")]
    """Height above the surface at the end of the free-space approach, m."""
    descent: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED)]
    """Speed at which the setpoint descends to the surface, m/s; the impact at touch-down grows with it."""
    length_bound: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/search.md")] = 0.006
    """Largest correction of the peg's length in the hand by the first touch-down, m."""
    touch_down: Annotated[float, Field(gt=TOUCHED_TIME), Quantity("s", Tempo.LIMIT)]
    """Longest time of the descent to the surface, s; the path begins as soon as the plate bears the push."""
    trim_rate: Annotated[PositiveFloat, Quantity("1/s")]
    """Integral gain from the tip's error across the lanes to the setpoint, 1/s; joint friction causes this error."""
    trim_limit: Annotated[NonNegativeFloat, Quantity("m")]
    """Largest correction of the setpoint across the lanes, m."""
    dip_threshold: Annotated[
        PositiveFloat, Quantity("m"), Source("set by hand, its rate of false evidence measured by `cell study events`")
    ]
    """Dip threshold: depth of the tip below the surface estimate that is evidence of an edge, m; the exact fall at 45
    degrees is 2.4 mm. For a round peg of 5 mm or less, it is at most 0.025 of the peg's thickness.
    """
    lag: Annotated[float | None, Figure("m"), Field(exclude=True), Source("docs/tried/corners.md")] = None
    """Lag of the tip behind its setpoint along a pass that also is evidence of an edge, m; multiplied by the stiffness, it bounds the force on a
    wall that holds the tip. None disables this evidence.
    """
    fall: Annotated[PositiveFloat, Quantity("m"), Source("chosen, not measured; reason in docs/tried/search.md")]
    """Depth below the surface from which the resting tip counts as in the hole, m. For a round peg of 5 mm or less, it is
    multiplied by the peg's thickness over 8 mm.
    """
    rest: Annotated[PositiveFloat, Quantity("s", Tempo.WAIT), Source("docs/tried/search.md")]
    """Time at rest before the search judges the tip's depth by the newest frame, s."""
    probe_radius: Annotated[
        PositiveFloat, Quantity("m"), Source("chosen, not measured; reason in docs/tried/search.md")
    ]
    """Radius of the spiral that probes the place of the evidence, m; it follows a rest in which the tip is not deep enough."""
    probe_speed: Annotated[PositiveFloat, Quantity("m/s", Tempo.SPEED), Source("chosen, not measured")]
    """Speed of the tip along the probing spiral, m/s."""
    probe_pitch: Annotated[PositiveFloat, Quantity("m"), Source("chosen, not measured")]
    """Distance between the turns of the probing spiral, m."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT), Source("[gibbons], Sec. VI")]
    """Longest search, s; 100 in [gibbons]."""

    return_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.4
    """Time in which the tip returns to its course after a rest or a probe, s."""
    pull: Annotated[PullOut, Figure(""), Field(exclude=True)] = PullOut()
    """Motion that pulls the peg out of the hole before another attempt."""
    outside: Annotated[tuple[float, float], Figure("m"), Field(exclude=True)] = (2e-3, 4e-3)
    """Least and largest distance between the touch-down and the rim of a hole at the border of the area, m; each search draws it uniformly
    from this range.
    """
    free_gap: Annotated[float, Figure("m"), Field(exclude=True)] = 1.5e-3
    """Gap between the longest plausible peg and the plate before the descent, m; it covers errors of heights and the lag of the hand."""
    trimmed_below: Annotated[float, Figure("m"), Field(exclude=True)] = 5e-3
    """Height of the setpoint over the plate below which the trim is active, m; higher up, friction of joints at rest would wind it up."""
    touched: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Share of the push along z above which the plate counts as bearing it, fraction."""
    late: Annotated[float, Figure("s"), Field(exclude=True)] = 0.06
    """Delay before a height updates the surface estimate, s. Without it, a peg that falls early in the search would pull the estimate
    down, so that no dip would show. A peg that crosses half a hole of 8 mm at 0.14 m/s falls for 0.03 s.
    """
    sudden: Annotated[float, Figure("s"), Field(exclude=True)] = 0.08
    """Time within which the hand drops together with a peg that falls into the hole, s; the rim stops the peg after 0.02 to 0.05 s."""
    shared: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/search.md")] = 0.5
    """Least drop of the hand that must accompany a dip, share of the dip threshold, fraction. If the dip is that of an earlier rest without a
    hole, or comes from a new angle of the peg, the tip is lower but the hand does not drop.
    """
    borne: Annotated[float, Figure("s"), Field(exclude=True), Source("docs/tried/search.md")] = 0.2
    """Time window of the forces with which the newest force is compared to detect a loss of the push, s."""
    newest: Annotated[float, Figure("s"), Field(exclude=True), Source("docs/tried/search.md")] = 0.04
    """Time over which the newest force is averaged, s, because the estimate of the wrench is noisy."""
    rest_damping: Annotated[float, Figure("ratio"), Field(exclude=True)] = 2.5
    """Factor on the translational damping while the hand rests; the hand must stop within a millimetre or two. Rotational damping stays: with
    this factor and delayed torques, a light wrist would oscillate.
    """
    gone: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/search.md")] = 0.5
    """Share of the dip threshold below which a dip counts as gone at rest, fraction."""
    is_doubtful: Annotated[bool, Figure(""), Field(exclude=True)] = False
    """True if most dips of this peg are not the hole, because it is thin or has corners: one that is gone at rest is not probed."""
    stuck_within: Annotated[float, Figure("m"), Field(exclude=True)] = 1e-3
    """Largest distance between two rests that count as one place, m: the peg is stuck there."""
    stuck_after: Annotated[int, Figure("count"), Field(exclude=True)] = 3
    """Number of rests at one place after which the search treats it as a decoy."""
    stated: Annotated[float, Figure("m"), Field(exclude=True), Source("[gibbons], Sec. VI")] = 8e-3
    """Thickness of the peg for which `dip_threshold` and `fall` are stated, m."""
    thin: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/search.md")] = 5e-3
    """Largest thickness of a thin peg, m; thicker pegs use the stated figures, because a limit of 6 mm brought no gain."""
    thin_dip: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/search.md")] = 0.025
    """Dip threshold of a thin peg, share of its thickness, fraction."""
    thin_push: Annotated[float, Figure("N"), Field(exclude=True), Source("docs/tried/search.md")] = 7.5
    """Least push on a thin peg, N: the load that the pads bear on a plate with the shipped grip."""
    crossings: Annotated[float, Figure("1/s"), Field(exclude=True), Source("docs/tried/search.md")] = 21.0
    """Largest speed along a lane in hole diameters, or shorter sides, per second, 1/s: 0.17 m/s over a hole of 8.1 mm. With the dip threshold
    of a 4 mm peg it is 0.15 m/s over its hole, at which few falls are missed.
    """
    crossed_dip: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/search.md")] = 3e-4
    """Dip threshold with which `crossings` was found, m."""

    def first_height(self, reach: float, is_length_known: bool = False) -> float:
        """Return the height of the tip above the stated surface before the descent, m; the whole leaning peg is clear there.

        Args:
            reach: Largest distance of a point of the peg's end from its axis, m.
            is_length_known: True if the peg has touched the plate since its grasp; before, it may reach further by `length_bound`.
        """
        further = 0.0 if is_length_known else self.length_bound * math.cos(self.tilt)
        return max(self.height, reach * math.sin(self.tilt) + further + self.free_gap)
