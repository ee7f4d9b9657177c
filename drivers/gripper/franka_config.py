"""Config of a Franka hand; pure, no I/O."""

from typing import Annotated, Literal

from pydantic import Field

from drivers.config_model import ConfigModel


class FrankaGripperConfig(ConfigModel):
    """[gripper] of a Franka hand."""

    kind: Literal["franka"]
    host: Annotated[str, Field(min_length=1)]
    """Address of the arm's control interface."""
    speed: Annotated[float, Field(ge=0.01, le=0.1)] = 0.05
    """Of the distance between the fingers, m/s."""
