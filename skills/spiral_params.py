"""Parameters of the adjustment: spiral, dither, tilt sweep, and when a peg is given up."""

from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat

from skills.contract import SkillParams
from skills.motion import Gains


class SpiralAdjustParams(SkillParams):
    """How to tilt the peg about its tip along a spiral of the finger centre. The skill uses no tactile measurements.

    Source: chosen, not measured.
    """

    growth: PositiveFloat
    """Growth of the spiral's radius at the finger centre, m/s. Source: derived from [gibbons], Sec. VI, 25 mm in 20 s."""
    turn_rate: PositiveFloat
    """Turning rate of the spiral, rad/s."""
    radius: PositiveFloat
    """Largest radius of the spiral, m; `stall_timeout` may end the spiral before. Source: [gibbons], Sec. VI."""
    stall_timeout: Annotated[float, Field(gt=0.0, le=120.0)]
    """Stall timeout: time in which a peg that goes no deeper by `jammed` is given up, s; such a peg is not in the hole, or
    does not go in this way. The first of several attempts of `insert_peg` has 0.4 of it (docs/tried/adjustment.md). Close to the bottom the time is
    twice as long; a switch that is still open then disagrees with the depth. Source: chosen, not measured; reason in docs/tried/adjustment.md.
    """
    timeout: PositiveFloat
    """Longest adjustment, s; where the radius is largest sooner, the spiral starts again."""
    gains: Gains
    """Stiffness and damping ratio along x and y and in rotation. Source: chosen within the margin that `cell check` prints."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_damping_ratio: PositiveFloat
    """Damping along z, multiple of the critical one; the larger, the slower the peg arrives at the bottom."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    guided_depth: PositiveFloat
    """Depth of the tip from which the hole guides the peg, m; beyond it a growing spiral would only load the hole's walls.
    Source: chosen, not measured; reason in docs/tried/adjustment.md.
    """
    dither_radius: NonNegativeFloat
    """First radius of the dither of the finger centre in the guided peg, m; it fades within each period, because torque
    that friction holds jams the peg. Source: chosen, not measured; reason in docs/tried/adjustment.md.
    """
    dither_rate: PositiveFloat
    """Turning rate of the dither, rad/s."""
    dither_period: PositiveFloat
    """Period of the dither, s; within it the radius fades to nothing."""
    jammed: NonNegativeFloat
    """Least progress of the tip in one period of the dither, m; with less the peg stands still. Below ten times as much theta is
    read anew from the skin, and every other time the peg is aimed along where it rests, so that only the dither's torque
    is left. Source: docs/tried/adjustment.md; a creeping peg docs/tried/adjustment.md.
    """
    arrival: PositiveFloat
    """Distance from the bottom within which the peg is damped more, m; it lets the peg arrive without a blow. Source:
    docs/tried/adjustment.md.
    """
    swing_time: PositiveFloat = 0.6
    """Time for which a peg is let down gently where the hand still turns from the insertion, s; later the hand turns as this skill
    asks for. Source: docs/tried/adjustment.md.
    """
    sweep_time: Annotated[float, Field(gt=0.0, le=5.0)] = 0.5
    """Time for one tilt sweep of a hand whose peg stands still or creeps, to one side and to the other, s. It turns the hand about its
    closing axis; a dither follows. Source: docs/tried/adjustment.md.
    """
