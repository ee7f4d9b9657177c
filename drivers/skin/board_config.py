"""Config of a skin board and of its wire; pure, no I/O."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from drivers.config_model import ConfigModel, Quantity, Source
from drivers.quantities import FINGERS
from drivers.skin.cyskin_wire import SkinWireConfig
from drivers.skin.health import SkinHealthConfig
from drivers.skin.layout import MODULE_TAXELS, Layout
from drivers.transport.wires import Interface

EMULATED = "emulated"
"""Channel or port name of an emulated board, which is connected to the simulation."""
BOARD_MODULES = 2 * FINGERS
"""Number of modules of both fingers."""
TEMPERATURE = 0
"""Name of the channel with a module's temperature."""
MODULE_CHANNELS = (1, 2, 3, 4, 9, 10, 5, 8, 6, 7)
"""Names of a CySkin module's channels, row by row: 1 to 9 run around the triangle, 10 is in its middle."""


class HubConfig(ConfigModel):
    """A CySkin hub with the modules of both fingers."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["cyskin"] = "cyskin"
    """A CySkin hub."""
    wire: SkinWireConfig = SkinWireConfig()
    """Variable parts of the hub's protocol, which differ between firmwares."""
    modules: tuple[Annotated[int, Field(ge=0, le=0xFFFFFFFF)], ...] = ()
    """Own numbers (sui) of the modules, both of the left finger first; if empty, the modules' order on the hub applies."""
    channels: Annotated[
        tuple[Annotated[int, Field(ge=1, le=11)], ...], Source("[cyskin], calibration files; assumed")
    ] = MODULE_CHANNELS
    """Name of the channel of each taxel of a module, in the order of the layout; to be checked on a real finger."""

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

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["icub"]
    """An iCub skin board."""
    board: Annotated[int, Field(ge=0, le=15)] = 1
    """Number of the board on the bus."""
    triangles: Annotated[tuple[Annotated[int, Field(ge=0, le=15)], ...], Field(min_length=4, max_length=4)] = (
        0,
        1,
        2,
        3,
    )
    """Numbers of the triangles, both of the left finger first."""
    channels: Annotated[
        tuple[Annotated[int, Field(ge=0, le=11)], ...],
        Source("derived from Triangle_10pad.h of robotology/icub-main, a829ee3; assumed"),
    ] = (5, 4, 2, 1, 7, 3, 0, 8, 11, 9)
    """Number of the triangle's channel, of twelve, for each taxel, in the order of the layout; to be checked on a real finger."""


class BoardSkinConfig(ConfigModel):
    """Keys of every skin board."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    rate: Annotated[float, Field(ge=1.0, le=100.0), Quantity("Hz"), Source("[gibbons], Sec. VI")] = 10.0
    """Scan rate set in the board, Hz; boards support 10 to 100."""
    layout: Annotated[Layout, Source("set for each cell")] = "parallelogram"
    """Arrangement of the two modules of a finger."""
    open_timeout: Annotated[float, Field(ge=0.1, le=60.0), Quantity("s")] = 3.0
    """Longest wait for the board's first scan, s."""
    health: SkinHealthConfig = SkinHealthConfig()
    """Conditions under which a taxel is not trusted."""


class HostSkinConfig(BoardSkinConfig):
    """Section [skin] for a hub that the makers' host program reads and writes to a file."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["host"]
    """Kind of the skin: the file of `cyskin_acquisition --buffer file`."""
    file: Annotated[str, Field(min_length=1)]
    """File of the host program, its `--filename`."""
    board: HubConfig = HubConfig()
    """The hub of the host program; the host program starts it, so that `board.wire` has no effect."""


class WiredSkinConfig(BoardSkinConfig):
    """Keys of every skin board on a wire of this computer."""

    SOURCE: ClassVar[str] = "set for each cell"

    record: str = ""
    """File that records all traffic of the wire; an empty name records nothing."""


class CanSkinConfig(WiredSkinConfig):
    """Section [skin] for a board on a CAN bus."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["can"]
    """Kind of the skin: a board on a CAN bus."""
    interface: Interface = "socketcan"
    """Interface to the bus."""
    channel: Annotated[str, Field(min_length=1)] = EMULATED
    """Channel of the interface, as in "can0"; "emulated" is an emulated board in a simulated cell."""
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000), Quantity("bits/s")] = 1_000_000
    """Bit rate of the bus, bits/s."""
    board: Annotated[HubConfig | IcubConfig, Field(discriminator="kind")] = HubConfig()
    """The board on the bus."""


class SerialSkinConfig(WiredSkinConfig):
    """Section [skin] for a board on a serial line."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["serial"]
    """Kind of the skin: a board on a serial line."""
    port: Annotated[str, Field(min_length=1)] = EMULATED
    """Name of the serial port, preferably a permanent one as in /dev/serial/by-id; "emulated" is an emulated board
    in a simulated cell.
    """
    baud_rate: Annotated[int, Field(ge=1200, le=4_000_000), Quantity("bits/s")] = 115_200
    """Bit rate of the line, bits/s."""
    board: HubConfig = HubConfig()
    """The board on the line."""
