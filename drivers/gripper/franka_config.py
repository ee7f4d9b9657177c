"""Config of a Franka hand; pure, no I/O."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Source


class FrankaGripperConfig(ConfigModel):
    """Section [gripper] for a Franka hand."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["franka"]
    """Kind of the gripper: a Franka hand behind the maker's control interface."""
    host: Annotated[str, Field(min_length=1)]
    """Network address of the arm's control interface, which the hand shares."""
    speed: Annotated[float, Figure("m/s"), Field(exclude=True), Source("chosen, not measured")] = 0.05
    """Speed at which the distance between the fingers changes, m/s."""
