"""A SuccessSwitch for a cell whose holes have no switch."""

from typing import ClassVar, Literal

from drivers.config_model import ConfigModel
from drivers.quantities import SwitchState


class NoSwitchConfig(ConfigModel):
    """Section [switch] for a cell without a switch."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["none"]
    """Kind of the switch: none; every hole of the cell then needs other evidence, see `hole.evidence`."""


class AbsentSwitch:
    """A switch that is always open."""

    def open(self) -> None:
        """Do nothing: there is no device."""

    def close(self) -> None:
        """Do nothing: there is no device."""

    def read(self) -> SwitchState:
        """Return OPEN: an absent switch is never pressed."""
        return SwitchState.OPEN
