"""Config of a Franka arm; pure, no I/O."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from drivers.arm.model import ArmName
from drivers.config_model import ConfigModel, Quantity


class FrankaArmConfig(ConfigModel):
    """[arm] of a Franka arm."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["franka"]
    """A Franka arm behind the maker's control interface."""
    model: ArmName = "fr3"
    """Name of an arm that ships with the program, or a file of figures beside the config."""
    host: Annotated[str, Field(min_length=1)]
    """Network address of the arm's control interface."""
    collision_torque: Annotated[float, Field(ge=5.0, le=100.0), Quantity("N·m")]
    """Estimated external torque on a joint at which the arm's reflex stops it, N·m; no default."""
    collision_force: Annotated[float, Field(ge=5.0, le=100.0), Quantity("N")]
    """Estimated external force at the hand at which the reflex stops the arm, N; the same number, in N·m, is the threshold
    of the torque at the hand; no default."""
    realtime: Literal["enforce", "ignore"] = "enforce"
    """Requirement of a real-time kernel and priority; with `ignore` the loop runs without them, for simulated arms."""
