"""Config of a switch board and of the line that it is on; pure, no I/O."""

from typing import Annotated, Literal

from pydantic import Field

from drivers.config_model import ConfigModel


class SerialSwitchConfig(ConfigModel):
    """[switch] of a board on a serial line."""

    kind: Literal["serial"]
    """The switch board on a serial line."""
    port: Annotated[str, Field(min_length=1)]
    """Name of the serial port, best one that stays, as those of /dev/serial/by-id; "emulated" is an emulated board in
    a simulated cell."""
    record: str = ""
    """File that all traffic of the line goes to; empty is none."""
