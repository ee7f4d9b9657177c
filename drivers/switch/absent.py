"""A cell whose holes have no switch, as a SuccessSwitch."""

from typing import Literal

from drivers.config_model import ConfigModel
from drivers.quantities import SwitchState


class NoSwitchConfig(ConfigModel):
    """Section [switch] for a cell without a switch.

    Source: set for each cell.
    """

    kind: Literal["none"]
    """Kind of the switch: there is none, so that every hole of the cell needs other evidence, see `hole.evidence`."""


class AbsentSwitch:
    """Is never pressed."""

    def open(self) -> None:
        """Do nothing: there is no device."""

    def close(self) -> None:
        """Do nothing: there is no device."""

    def read(self) -> SwitchState:
        """Return OPEN: nothing is ever on a switch that is not there."""
        return SwitchState.OPEN
