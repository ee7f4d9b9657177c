"""Parameters of the printed method: what [gibbons] prints, and what a fit of its Table I found for what it leaves open."""

import math
from typing import Annotated, Literal

from pydantic import Field, PositiveFloat

from skills.contract import SkillParams
from skills.motion import Gains


class PaperSearchParams(SkillParams):
    """The printed search, [gibbons], Sec. IV. The approach, the tilt and the timeout are those of `search`.

    Source: measured by `cell study paper`.
    """

    speed: Annotated[float, Field(gt=0.0, le=0.5)] = 0.0707
    """Peak speed of the end point along the path, m/s."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0)] = 1.09
    """Largest distance between neighbouring passes, multiple of the hole's diameter."""
    push_stiffness: PositiveFloat = 1390.0
    """Stiffness along z, N/m."""
    gains: Gains = Gains(translation=667.0, rotation=40.0)
    """Stiffness and damping ratio along the path and in rotation. Source: measured by `cell study paper`."""
    threshold: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.122
    """Change of the average response from one frame to the next that shows the hole, fraction of the running average."""
    memory: Annotated[int, Field(ge=1, le=1000)] = 10
    """Number of frames that the running average is made of. Source: chosen, not measured."""


class PaperInsertParams(SkillParams):
    """The printed insertion, [gibbons], Sec. V.A.

    Source: measured by `cell study paper`.
    """

    gains: Gains = Gains(translation=1460.0, rotation=1.84, damping_ratio=1.3)
    """Stiffness K along x and y and in rotation, and damping ratio. Source: measured by `cell study paper`."""
    integral_gain: PositiveFloat = 0.0794
    """Integral gain K_I on orientation, N·m/(rad·s); [gibbons], Eq. (6)."""
    integral_limit: PositiveFloat = 3.0
    """Saturation of the integral, N·m. Source: chosen, not measured."""
    push_stiffness: tuple[PositiveFloat, PositiveFloat] = (800.0, 1000.0)
    """K_min and K_max of [gibbons], Eq. (7), N/m. Source: chosen, not measured."""
    aligned: Annotated[float, Field(gt=0.0, lt=0.8)] = math.radians(15.0)
    """Angle phi below which the adjustment takes over, rad. Source: [gibbons], Sec. VII."""
    timeout: PositiveFloat = 60.0
    """Longest insertion, s. Source: chosen, not measured."""


class PaperAdjustParams(SkillParams):
    """The printed adjustment, [gibbons], Sec. V.B.

    Source: measured by `cell study paper`.
    """

    gains: Gains = Gains(translation=800.0, rotation=8.0)
    """Stiffness and damping ratio along x and y and in rotation. Source: measured by `cell study paper`."""
    push_stiffness: PositiveFloat = 1000.0
    """Stiffness along z, N/m."""
    push_damping_ratio: PositiveFloat = 1.5
    """Damping along z, multiple of the critical one. Source: chosen, not measured."""
    turn_rate: PositiveFloat = 6.28
    """Turning rate of the spiral, rad/s."""
    radius: PositiveFloat = 0.025
    """Largest radius of the spiral, m. Source: [gibbons], Sec. VII."""
    growing_time: PositiveFloat = 20.0
    """Time in which the radius grows to its largest, s; then the spiral begins anew. Source: [gibbons], Sec. VII."""
    timeout: PositiveFloat = 60.0
    """Longest adjustment, s. Source: chosen, not measured."""


class PaperParams(SkillParams):
    """The printed method, for round pegs and a success switch.

    Source: chosen, not measured.
    """

    skills: tuple[Literal["search", "insert", "adjust"], ...] = ()
    """Skills that are done as [gibbons] prints them in place of the cell's own."""
    push_offset: PositiveFloat = 0.01
    """Depth of the end point's setpoint below the surface, m; in the adjustment below the end point. Source: [gibbons], Sec. IV."""
    search: PaperSearchParams = PaperSearchParams()
    """The printed search."""
    insert: PaperInsertParams = PaperInsertParams()
    """The printed insertion."""
    adjust: PaperAdjustParams = PaperAdjustParams()
    """The printed adjustment."""
