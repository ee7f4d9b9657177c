"""Config of a switch board and of its line; pure, no I/O."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from drivers.config_model import ConfigModel


class SerialSwitchConfig(ConfigModel):
    """Section [switch] for a board on a serial line."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["serial"]
    """Kind of the switch: a board on a serial line."""
    port: Annotated[str, Field(min_length=1)]
    """Name of the serial port, preferably a permanent one as in /dev/serial/by-id; "emulated" is an emulated board
    in a simulated cell.
    """
    record: str = ""
    """File that records all traffic of the line; an empty name records nothing."""
