"""Config of a skin board and of the wire that it is on; pure, no I/O."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from drivers.config_model import ConfigModel
from drivers.quantities import FINGERS
from drivers.skin.cyskin_wire import SkinWireConfig
from drivers.skin.health import SkinHealthConfig
from drivers.skin.layout import MODULE_TAXELS, MODULES, Layout
from drivers.transport.wires import Interface

EMULATED = "emulated"
"""As the channel or port of a board: an emulated board, wired to the simulated world."""
BOARD_MODULES = FINGERS * MODULES
"""Modules of both fingers."""
TEMPERATURE = 0
"""Name of the channel with a module's temperature."""
FIRST_MODULE = 1
"""Number of a hub's first module."""


class HubConfig(ConfigModel):
    """A CySkin hub with the modules of both fingers."""

    kind: Literal["cyskin"] = "cyskin"
    wire: SkinWireConfig = SkinWireConfig()
    modules: tuple[Annotated[int, Field(ge=0, le=0xFFFFFFFF)], ...] = ()
    """Own numbers (sui) of the modules, both of the left finger first; empty is the order on the hub."""
    channels: tuple[Annotated[int, Field(ge=1, le=11)], ...] = tuple(range(1, MODULE_TAXELS + 1))
    """Name of the channel of each taxel of a module, in the order of the layout."""

    @model_validator(mode="after")
    def _fits(self) -> "HubConfig":
        if len(self.modules) not in (0, BOARD_MODULES) or len(set(self.modules)) != len(self.modules):
            raise ValueError(
                f"modules: {len(set(self.modules))} numbers; none, or {BOARD_MODULES} different ones allowed"
            )
        if len(set(self.channels)) != MODULE_TAXELS or len(self.channels) != MODULE_TAXELS:
            raise ValueError(f"channels: {len(set(self.channels))} names; {MODULE_TAXELS} different ones allowed")
        return self


class IcubConfig(ConfigModel):
    """An iCub skin board with the triangles of both fingers."""

    kind: Literal["icub"]
    board: Annotated[int, Field(ge=0, le=15)] = 1
    triangles: Annotated[tuple[Annotated[int, Field(ge=0, le=15)], ...], Field(min_length=4, max_length=4)] = (
        0,
        1,
        2,
        3,
    )
    """Numbers of the triangles, both of the left finger first."""
    channels: tuple[Annotated[int, Field(ge=0, le=11)], ...] = (0, 1, 2, 3, 4, 5, 7, 8, 9, 11)
    """Which of a triangle's twelve channels is which taxel, in the order of the layout; assumed, to be checked."""


class BoardSkinConfig(ConfigModel):
    """What every skin board has."""

    rate: Annotated[float, Field(ge=1.0, le=100.0)] = 10.0
    """Scans a second that the board is told to make, Hz; 10 to 100 where it can."""
    layout: Layout = "parallelogram"
    """How the two modules of a finger sit."""
    silent_frames: Annotated[float, Field(ge=1.5, le=100.0)] = 3.5
    """Without a scan for so many periods the skin is silent."""
    open_timeout: Annotated[float, Field(ge=0.1, le=60.0)] = 3.0
    """Longest wait for the board's first scan, s."""
    health: SkinHealthConfig = SkinHealthConfig()
    record: str = ""
    """File that all traffic of the wire goes to; empty is none."""


class CanSkinConfig(BoardSkinConfig):
    """[skin] of a board on a CAN bus."""

    kind: Literal["can"]
    interface: Interface = "socketcan"
    """What the bus is reached through."""
    channel: Annotated[str, Field(min_length=1)] = EMULATED
    """As `drivers.transport.can_bus.CanBus` says: "can0"; "emulated" is an emulated board in a simulated cell."""
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    """Bits a second."""
    board: Annotated[HubConfig | IcubConfig, Field(discriminator="kind")] = HubConfig()
    """What stands on the bus."""


class SerialSkinConfig(BoardSkinConfig):
    """[skin] of a board on a serial line."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)] = EMULATED
    """As the operating system has it, best a name that stays; "emulated" is an emulated board in a simulated cell."""
    baud_rate: Annotated[int, Field(ge=1200, le=4_000_000)] = 115_200
    """Bits a second."""
    board: HubConfig = HubConfig()
    """What stands on the line."""
