"""Parameters of a peg with corners: the skills search with one corner and turn the peg until it drops into the hole."""

import math
from typing import Annotated, ClassVar

from pydantic import Field, PositiveFloat

from drivers.config_model import ConfigModel, Quantity, Source
from skills.corner.adjust import CornerAdjustParams
from skills.corner.insert import CornerInsertParams
from skills.search.params import SpraySearchParams


class CornerParams(ConfigModel):
    """Parameters of a peg with corners; keys not given here come from the sections of the round peg's skills."""

    SOURCE: ClassVar[str] = "chosen, not measured; reason in docs/tried/corners.md"

    tilt: Annotated[float, Field(gt=0.0, lt=1.4), Quantity("rad")]
    """Tilt of the peg in the search, rad. The closing axis is oblique to the plane of the tilt, so that an error of theta
    changes the measured height.
    """
    speed: Annotated[float, Field(gt=0.0, le=0.5), Quantity("m/s")]
    """Peak speed of the tip along the path, m/s; after a drop the corner hits the hole's wall at this speed."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0), Quantity("multiple")]
    """Largest distance between neighbouring passes, multiple of the hole's shorter side."""
    dip_threshold: Annotated[PositiveFloat, Quantity("m"), Source("docs/tried/corners.md")]
    """Dip threshold: depth of the corner below the surface estimate that is evidence of an edge, m. It is larger than that
    of a round peg, because an error of theta changes the measured height.
    """
    lag: Annotated[PositiveFloat, Quantity("m"), Source("docs/tried/corners.md")]
    """Lag of the corner behind its setpoint along a pass that is also evidence of an edge, m."""
    fall: Annotated[PositiveFloat, Quantity("m"), Source("docs/tried/corners.md")]
    """Depth of the resting corner below the surface at which the corner is in the hole, m; it allows for the error of theta."""
    retries: Annotated[int, Field(ge=0, le=20)]
    """Number of further searches of `insert_peg` for a peg with corners; each attempt sweeps the yaw about another
    middle.
    """
    insert: CornerInsertParams
    """Parameters of raising and turning the peg in the hole."""
    adjust: CornerAdjustParams
    """Parameters of seating the peg."""

    def searching(self, search: SpraySearchParams) -> SpraySearchParams:
        """Return the parameters of a search with a corner: those of the round peg's search, overridden by `corner`."""
        return search.model_copy(
            update={
                "tilt": self.tilt,
                "speed": self.speed,
                "pitch": self.pitch,
                "dip_threshold": self.dip_threshold,
                "lag": self.lag,
                "is_doubtful": True,
                "fall": self.fall,
                "fast_axis": "x" if abs(math.cos(search.tilt_azimuth)) > math.sqrt(0.5) else "y",
            }
        )
