"""Parameters of the method of [gibbons]: those that it leaves open, and times and radii of Sec. VII. Other printed values are constants."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from skills.contract import SkillParams
from skills.motion import DampedGains, Gains


class PaperSearchParams(SkillParams):
    """The printed search, [gibbons], Sec. IV. Approach, tilt and timeout come from `search`."""

    SOURCE: ClassVar[str] = "measured by `cell study paper`"

    speed: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s", Tempo.SPEED)]
    """Peak speed of the end point along the path, m/s."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0), Quantity("multiple")]
    """Largest distance between neighbouring passes, multiple of the hole's diameter."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, N/m."""
    gains: Annotated[Gains, Source("measured by `cell study paper`")]
    """Stiffness and damping ratio along the path and in rotation."""
    threshold: Annotated[float, Field(gt=0.0, lt=1.0), Quantity("fraction")]
    """Change of the average response between frames that indicates the hole, fraction of the running average."""


class PaperInsertParams(SkillParams):
    """The printed insertion, [gibbons], Sec. V.A."""

    SOURCE: ClassVar[str] = "measured by `cell study paper`"

    gains: Annotated[DampedGains, Source("measured by `cell study paper`")]
    """Stiffness K along x and y and in rotation, and damping ratio."""
    integral_gain: Annotated[PositiveFloat, Quantity("N·m/(rad·s)"), Source("[gibbons], Eq. (6)")]
    """Integral gain K_I on orientation, N·m/(rad·s); [gibbons], Eq. (6)."""
    integral_limit: Annotated[float, Figure("N·m"), Field(exclude=True), Source("chosen, not printed")] = 3.0
    """Saturation of the integral, N·m."""
    push_stiffness: Annotated[tuple[PositiveFloat, PositiveFloat], Quantity("N/m"), Source("chosen, not measured")]
    """K_min and K_max of [gibbons], Eq. (7), N/m."""
    timeout: Annotated[float, Figure("s", Tempo.LIMIT), Field(exclude=True), Source("chosen, not measured")] = 60.0
    """Longest insertion, s."""


class PaperAdjustParams(SkillParams):
    """The printed adjustment, [gibbons], Sec. V.B."""

    SOURCE: ClassVar[str] = "measured by `cell study paper`"

    gains: Annotated[Gains, Source("measured by `cell study paper`")]
    """Stiffness and damping ratio along x and y and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness along z, N/m."""
    push_damping_ratio: Annotated[float, Figure("multiple"), Field(exclude=True), Source("chosen, not printed")] = 1.5
    """Damping ratio along z, multiple of the critical damping."""
    turn_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED, "radius")]
    """Turning rate of the spiral, rad/s."""
    timeout: Annotated[float, Figure("s", Tempo.LIMIT), Field(exclude=True), Source("chosen, not measured")] = 60.0
    """Longest adjustment, s."""
    radius: Annotated[float, Figure("m"), Field(exclude=True), Source("[gibbons], Sec. VII")] = 0.025
    """Largest radius of the spiral, m."""
    growing_time: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True), Source("[gibbons], Sec. VII")] = 20.0
    """Growing time of the spiral, s; after this time the spiral restarts from radius 0."""


class PaperParams(SkillParams):
    """The printed method; it needs round pegs and a success switch."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    skills: Annotated[tuple[Literal["search", "insert", "adjust"], ...], Source("[gibbons]")]
    """Skills that use the printed method of [gibbons] instead of the cell's own; an empty list disables the section."""
    search: PaperSearchParams
    """The printed search."""
    insert: PaperInsertParams
    """The printed insertion."""
    adjust: PaperAdjustParams
    """The printed adjustment."""
