"""Parameters of the adjustment: dither, tilt sweep and timeouts."""

import math
from typing import Annotated, ClassVar

from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from skills.contract import SkillParams
from skills.motion import Gains


class SpiralAdjustParams(SkillParams):
    """Parameters of the adjustment: the peg tilts about its tip on small circles of the finger centre, and in sweeps if it jams."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    stall_timeout: Annotated[
        float,
        Field(gt=0.0, le=120.0),
        Quantity("s", Tempo.WAIT),
        Source("chosen, not measured; reason in docs/tried/adjustment.md"),
    ]
    """Longest time without a depth gain of `jammed`, s; then the attempt ends. In the first of several attempts of `insert_peg`,
    0.4 of it applies (docs/tried/adjustment.md). Close to the bottom, twice the time applies; if the switch is still open
    after it, switch and depth disagree.
    """
    stall_at_bottom: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = math.inf
    """Stall timeout close to the bottom, s."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT)]
    """Longest adjustment, s."""
    gains: Annotated[Gains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along x and y and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness of the push along z, N/m."""
    push_damping_ratio: Annotated[PositiveFloat, Quantity("multiple")]
    """Damping ratio along z, multiple of the critical damping; a larger value slows the peg's arrival at the bottom."""
    push_offset: Annotated[NonNegativeFloat, Quantity("m")]
    """Depth of the tip's setpoint below the tip, m."""
    dither_radius: Annotated[
        NonNegativeFloat, Quantity("m"), Source("chosen, not measured; reason in docs/tried/adjustment.md")
    ]
    """Largest radius of the dither of the finger centre, m; it fades within each period, because torque held by friction jams the peg."""
    dither_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED, "dither_radius")]
    """Turning rate of the dither, rad/s."""
    dither_period: Annotated[PositiveFloat, Quantity("s", Tempo.WAIT)]
    """Period of the dither, s; the radius fades to zero within it."""
    jammed: Annotated[
        NonNegativeFloat, Quantity("m"), Source("docs/tried/adjustment.md; a creeping peg docs/tried/adjustment.md")
    ]
    """Least depth gain in one period of the dither, m; with less, the peg counts as standing still. Below `creep` times this gain, the skill
    measures theta again and aims along the resting peg or the plate's normal in turn. Along the peg, only the dither's torque remains.
    """
    arrival: Annotated[PositiveFloat, Quantity("m"), Source("docs/tried/adjustment.md")]
    """Distance from the bottom within which the damping is larger, m; it prevents an impact on the bottom."""
    swing_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True), Source("docs/tried/adjustment.md")] = 0.6
    """Time from the start during which the descent is gentle if the hand swings, s; later turns of the hand come from this skill's own setpoints."""
    sweep_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True), Source("docs/tried/adjustment.md")] = 0.5
    """Time of one tilt sweep to both sides, s. If the peg stands still or creeps, the hand sweeps about its closing axis; then the
    dither continues.
    """
    swept_beyond: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/adjustment.md")] = 0.015
    """Angle of a tilt sweep beyond the lean that the hole allows, rad; it equals about the error of the hand caused by joint friction."""
    most_swept: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/adjustment.md")] = 0.06
    """Largest angle of a tilt sweep, rad; a wider sweep turns pegs out of their holes."""
    let_go: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Share of rest below which a swept peg counts as sliding, fraction; the sweep then ends, and the hand keeps its orientation."""
    creep: Annotated[float, Figure("multiple"), Field(exclude=True), Source("docs/tried/adjustment.md")] = 10.0
    """Least depth gained in a period of the dither, multiple of `jammed`; with less, the peg counts as jammed. A pushed peg gains fifty times
    `jammed`, and a wedged peg creeps.
    """
    sliding: Annotated[float, Figure("m/s"), Field(exclude=True)] = 0.03
    """Speed of the tip along the hole above which the peg is not dithered, m/s. Friction of a sliding peg opposes its motion and has no
    sideways component to release. A peg that is turned beyond its play while it descends hits the wall.
    """
    smoothing: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.3
    """Weight of a new scan in the smoothed speed of the tip, fraction; the noise of theta moves the tip."""
    raised: Annotated[float, Figure("m"), Field(exclude=True)] = 0.005
    """Height of the tip above the surface, in addition to half the peg's breadth, at which the attempt ends, m: the peg has left the plate. The
    middle of a leaning peg's end is at most half a breadth above the plate, and plate and theta have errors of millimetres. If joint friction
    exceeds the push, the dither itself can lift the hand.
    """
    leaning: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/adjustment.md")] = math.pi / 4.0
    """Tilt of the peg from the plate's normal at which the attempt ends, rad: that of the search, so that the peg is no longer
    aligned.
    """
    swinging: Annotated[float, Figure("rad/s"), Field(exclude=True)] = 0.15
    """Turning rate of the hand beyond which it swings, rad/s; the dither turns it at 0.1 rad/s."""
    swing_smoothing: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Weight of a new scan in the smoothed turning rate of the hand, fraction."""
    swing_damping: Annotated[float, Figure("s/rad"), Field(exclude=True), Source("docs/tried/adjustment.md")] = 10.0
    """Growth of the factor on the damping along z with the turning rate beyond `swinging`, s/rad."""
    most_swing_damping: Annotated[
        float, Figure("multiple"), Field(exclude=True), Source("docs/tried/adjustment.md")
    ] = 5.0
    """Largest factor on the damping along z during a swing, multiple; with torques delayed by 4 ms and a 50 Hz low-pass, 1.2 times this is stable."""
    swing_push: Annotated[float, Figure("s/rad"), Field(exclude=True), Source("docs/tried/adjustment.md")] = 2.0
    """Growth of the divisor of the push with the turning rate beyond `swinging`, s/rad."""
