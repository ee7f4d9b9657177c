"""What is done otherwise with a peg that has corners: it searches with a corner, and is turned until it drops in."""

from typing import Annotated

from pydantic import Field, PositiveFloat

from drivers.config_model import ConfigModel
from skills.corner_adjust import CornerAdjustParams
from skills.corner_insert import CornerInsertParams
from skills.search.params import SpraySearchParams


class CornerParams(ConfigModel):
    """How a peg with corners is handled; where nothing is said, as a round one."""

    tilt: Annotated[float, Field(gt=0.0, lt=1.4)]
    """Tilt of the peg in the search, rad; the closing axis is beside the plane of the tilt, so that theta's error is
    felt as height."""
    speed: Annotated[float, Field(gt=0.0, le=0.5)]
    """Peak speed of the tip along the path, m/s; a corner that has fallen in meets the wall with all of it."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0)]
    """Largest distance between neighbouring passes, multiple of the hole's shorter side."""
    dip_threshold: PositiveFloat
    """Dip of the corner below the surface that is evidence of an edge, m."""
    fall: PositiveFloat
    """Depth below the surface at which the resting corner is in the hole, m."""
    blend: Annotated[float, Field(gt=0.0, le=1.0)]
    """Weight of a new frame in the running estimate of theta, fraction; it stands for `smoothing.blend`, because
    theta's error is felt as height."""
    retries: Annotated[int, Field(ge=0, le=20)]
    """Number of times that `insert_peg` searches anew with a peg that has corners; each attempt turns about another
    middle."""
    insert: CornerInsertParams
    """How the peg is raised and turned."""
    adjust: CornerAdjustParams
    """How the peg is worked in."""

    def searching(self, search: SpraySearchParams) -> SpraySearchParams:
        """Return the parameters of the search with a corner."""
        return search.model_copy(
            update={
                "tilt": self.tilt,
                "speed": self.speed,
                "pitch": self.pitch,
                "dip_threshold": self.dip_threshold,
                "fall": self.fall,
                "edge_leads": True,
            }
        )
