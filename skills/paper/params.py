"""Parameters of the printed method that [gibbons] leaves open; printed values are constants of the skills."""

from typing import Annotated, Literal

from pydantic import Field, PositiveFloat

from drivers.config_model import Figure, Quantity, Tempo
from skills.contract import SkillParams
from skills.motion import DampedGains, Gains


class PaperSearchParams(SkillParams):
    """The printed search, [gibbons], Sec. IV. Approach, tilt and timeout come from `search`.

    Source: measured by `cell study paper`.
    """

    speed: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED)]
    """Peak speed of the end point along the path, m/s."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0), Quantity("multiple")]
    """Largest distance between neighbouring passes, multiple of the hole's diameter."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, N/m."""
    gains: Gains
    """Stiffness and damping ratio along the path and in rotation. Source: measured by `cell study paper`."""
    threshold: Annotated[float, Field(gt=0.0, lt=1.0), Quantity("fraction")]
    """Change of the average response between frames that indicates the hole, fraction of the running average."""


class PaperInsertParams(SkillParams):
    """The printed insertion, [gibbons], Sec. V.A.

    Source: measured by `cell study paper`.
    """

    gains: DampedGains
    """Stiffness K along x and y and in rotation, and damping ratio. Source: measured by `cell study paper`."""
    integral_gain: Annotated[PositiveFloat, Quantity("N·m/(rad·s)")]
    """Integral gain K_I on orientation, N·m/(rad·s); [gibbons], Eq. (6)."""
    push_stiffness: Annotated[tuple[PositiveFloat, PositiveFloat], Quantity("N/m")]
    """K_min and K_max of [gibbons], Eq. (7), N/m. Source: chosen, not measured."""
    timeout: Annotated[float, Figure("s", Tempo.LIMIT), Field(exclude=True)] = 60.0
    """Longest insertion, s. Source: chosen, not measured."""


class PaperAdjustParams(SkillParams):
    """The printed adjustment, [gibbons], Sec. V.B.

    Source: measured by `cell study paper`.
    """

    gains: Gains
    """Stiffness and damping ratio along x and y and in rotation. Source: measured by `cell study paper`."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, N/m."""
    turn_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED, "radius")]
    """Turning rate of the spiral, rad/s."""
    timeout: Annotated[float, Figure("s", Tempo.LIMIT), Field(exclude=True)] = 60.0
    """Longest adjustment, s. Source: chosen, not measured."""
    radius: Annotated[float, Figure("m"), Field(exclude=True)] = 0.025
    """Largest radius of the spiral, m. Source: [gibbons], Sec. VII."""
    growing_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 20.0
    """Growing time of the spiral, s; then the spiral restarts. Source: [gibbons], Sec. VII."""


class PaperParams(SkillParams):
    """The printed method; it needs round pegs and a success switch.

    Source: chosen, not measured.
    """

    skills: tuple[Literal["search", "insert", "adjust"], ...]
    """Skills that use the printed method of [gibbons] instead of the cell's own; an empty list disables the section."""
    search: PaperSearchParams
    """The printed search."""
    insert: PaperInsertParams
    """The printed insertion."""
    adjust: PaperAdjustParams
    """The printed adjustment."""
