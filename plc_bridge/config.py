"""Config of the cell's lines to its PLC."""

from ipaddress import IPv4Network, IPv6Network
from typing import Annotated, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from drivers.config_model import ConfigModel, FilePath, Quantity, Source
from drivers.transport.wires import Interface, Parity

Bitrate = Literal[10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000]
BITRATES: tuple[int, ...] = get_args(Bitrate)
"""Bit rates of CiA 301, bits/s."""
Right = Literal["read", "command", "stop"]
ALL_RIGHTS: frozenset[Right] = frozenset({"read", "command", "stop"})
Seconds = Annotated[float, Field(ge=0.05, le=3600.0)]


class ModbusConfig(ConfigModel):
    """The Modbus TCP server."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    host: Annotated[str, Source("set for each cell")] = "127.0.0.1"
    """Network address of the listening socket; only this computer by default."""
    port: Annotated[int, Field(ge=0, le=65535), Source("set for each cell")] = 5020
    """TCP port of the listening socket; 0 selects a free one."""
    connections: Annotated[int, Field(ge=1, le=500)] = 64
    """Largest number of connections at once, including TLS handshakes. If it is reached, a newcomer replaces a connection that
    has sent no request, else the longest idle one. A connection that holds the lease or has a run under way is never replaced.
    """
    connections_per_host: Annotated[int, Field(ge=1, le=500)] = 32
    """Largest number of connections at once from one address; if it is reached, a newcomer replaces one of its own host."""
    idle_timeout: Annotated[Seconds, Quantity("s")] = 60.0
    """Time without a request after which a connection is closed, s."""
    allow: Annotated[tuple[IPv4Network | IPv6Network, ...], Source("set for each cell")] = ()
    """Networks or addresses that may connect; if empty, every address that can reach the port."""


class TlsConfig(ModbusConfig):
    """The Modbus/TCP Security server: mutual TLS, and rights by the role in the client's certificate."""

    SOURCE: ClassVar[str] = "set for each cell"

    port: Annotated[int, Field(ge=0, le=65535)] = 802
    """TCP port of the listening socket; 802 is the registered one, ports below 1024 require permission, 0 selects a free one."""
    certificate: FilePath
    """File of the cell's own certificate, PEM, followed by its chain."""
    key: FilePath
    """File of the certificate's private key, PEM, without a password."""
    authority: FilePath
    """File of the certificates of the authorities that sign the clients' certificates, PEM."""
    revoked: FilePath | None = None
    """File of the authorities' lists of revoked certificates, PEM, read at the start; without it no certificate counts as revoked."""
    roles: dict[Annotated[str, Field(min_length=1, max_length=64)], tuple[Right, ...]] = Field(default_factory=dict)
    """Rights of each role: "read", "command" and, for a stop without commands, "stop"; an unlisted role has none."""
    without_role: tuple[Right, ...] = ()
    """Rights of a client if its certificate names no role."""


class RtuConfig(ConfigModel):
    """The Modbus RTU server on a serial line; defaults of Modbus over Serial Line V1.02, 2.5.1, 3.2."""

    SOURCE: ClassVar[str] = "set for each cell"

    port: Annotated[str, Field(min_length=1)]
    """Name of the serial port, as in /dev/ttyUSB0."""
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    """Unit identifier of the cell; the cell does not answer requests to other units."""
    baud_rate: Annotated[
        int, Field(ge=1200, le=4_000_000), Quantity("bits/s"), Source("Modbus over Serial Line V1.02, 3.2")
    ] = 19200
    """Bit rate of the line, bits/s."""
    parity: Annotated[Parity, Source("Modbus over Serial Line V1.02, 2.5.1")] = "even"
    """Parity of the line."""
    stop_bits: Annotated[Literal[1, 2], Source("Modbus over Serial Line V1.02, 2.5.1; set for each cell")] = 1
    """Number of stop bits; the standard requires 2 without parity, but many devices use 1."""
    idle_timeout: Annotated[Seconds, Quantity("s"), Source("chosen, not measured")] = 60.0
    """Silence after which the next request begins a new link, s; the first sequence number of a link is adopted, not run."""


class CanConfig(ConfigModel):
    """The CANopen node."""

    SOURCE: ClassVar[str] = "set for each cell"

    interface: Interface
    """Interface to the bus."""
    channel: Annotated[str, Field(min_length=1)]
    """Channel of the interface, as in "can0", "/dev/ttyACM0", "HOST:PORT/can0" or "239.74.163.2"."""
    bitrate: Annotated[Bitrate, Quantity("bits/s")] = 250_000
    """Bit rate of the bus, bits/s; it is used for `slcan` only, other interfaces are set up outside this program."""
    node_id: Annotated[int, Field(ge=1, le=127)] = 16
    """Node-ID of the cell."""
    plc_node: Annotated[int, Field(ge=1, le=127)] = 1
    """Node-ID of the PLC; the cell watches its heartbeat and obeys its commands."""
    heartbeat: Annotated[float, Field(ge=0.01, le=60.0), Quantity("s"), Source("chosen, not measured")] = 0.1
    """Period of the cell's own heartbeat, s."""
    plc_timeout: Annotated[float, Field(ge=0.0, le=60.0), Quantity("s"), Source("chosen, not measured")] = 1.0
    """Longest time between two heartbeats of the PLC, s; if it is exceeded, the run stops; 0 disables the watch."""

    @model_validator(mode="after")
    def _differ(self) -> Self:
        if self.node_id == self.plc_node:
            raise ValueError(f"node_id = {self.node_id}: that is the PLC's, plc_node; another one allowed")
        return self


class PlcConfig(ConfigModel):
    """Settings of the cell's connection to the PLC."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    life_timeout: Annotated[Seconds, Quantity("s")] = 1.0
    """Longest time without a change of the life counter of the link that started a run, s; the run then stops."""
    lease_timeout: Annotated[Seconds, Quantity("s")] = 5.0
    """Time without a request from the lease's holder after which the lease is free again, s."""
    modbus: ModbusConfig = ModbusConfig()
    """The Modbus TCP server."""
    tls: TlsConfig | None = None
    """The Modbus/TCP Security server; off without this section."""
    rtu: RtuConfig | None = None
    """The Modbus RTU server on a serial line; off without this section."""
    can: CanConfig | None = None
    """The CANopen node; off without this section."""
    opcua_anonymous: Annotated[bool, Source("set for each cell")] = False
    """True if clients without a certificate may read over OPC UA; they never command."""
