"""Parameters of the adjustment: dither, tilt sweep and timeouts."""

import math
from typing import Annotated, ClassVar

from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from skills.contract import SkillParams
from skills.motion import Gains


class SpiralAdjustParams(SkillParams):
    """Parameters of tilting the peg about its tip on small circles of the finger centre, and on sweeps if it jams."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    stall_timeout: Annotated[
        float,
        Field(gt=0.0, le=120.0),
        Quantity("s", Tempo.WAIT),
        Source("chosen, not measured; reason in docs/tried/adjustment.md"),
    ]
    """Stall timeout: longest time without a depth gain of `jammed`, s; such a peg is not in the hole, or cannot enter it in
    this attempt. The first of several attempts of `insert_peg` has 0.4 of it (docs/tried/adjustment.md). Close to the bottom the time is
    twice as long; if the switch is still open then, it disagrees with the depth.
    """
    stall_at_bottom: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = math.inf
    """Stall timeout close to the bottom, s."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT)]
    """Longest adjustment, s."""
    gains: Annotated[Gains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along x and y and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, which makes the push, N/m."""
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
    """Least depth gain in one period of the dither, m; with less, the peg stands still. Below ten times this gain, the skill measures
    theta again. Every other time it aims along the resting peg, so that only the torque of the dither remains.
    """
    arrival: Annotated[PositiveFloat, Quantity("m"), Source("docs/tried/adjustment.md")]
    """Distance from the bottom within which the damping is larger, m; it prevents an impact on the bottom."""
    swing_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True), Source("docs/tried/adjustment.md")] = 0.6
    """Time of a gentle descent while the hand still turns from the insertion, s; later turns come from this skill's own setpoints."""
    sweep_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True), Source("docs/tried/adjustment.md")] = 0.5
    """Time of one tilt sweep to both sides, s; it follows if the peg stands still or creeps. It turns the hand about its closing axis;
    a dither follows.
    """
