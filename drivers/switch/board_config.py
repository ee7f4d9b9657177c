"""Config of a switch board and of the line that it is on; pure, no I/O."""

from typing import Annotated, Literal

from pydantic import Field

from drivers.config_model import ConfigModel


class SerialSwitchConfig(ConfigModel):
    """[switch] of a board on a serial line."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)]
    """As the operating system has it, best a name that stays, as those of /dev/serial/by-id."""
    record: str = ""
    """File that all traffic of the line goes to; empty is none."""
