"""Config of the cell's lines to its PLC."""

from ipaddress import IPv4Network, IPv6Network
from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from drivers.config_model import ConfigModel, FilePath
from drivers.transport.wires import Interface, Parity

Bitrate = Literal[10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000]
BITRATES: tuple[int, ...] = get_args(Bitrate)
"""Bit rates of CiA 301, bits/s."""
Right = Literal["read", "command", "stop"]
ALL_RIGHTS: frozenset[Right] = frozenset({"read", "command", "stop"})
Seconds = Annotated[float, Field(ge=0.05, le=3600.0)]


class ModbusConfig(ConfigModel):
    """The Modbus TCP server.

    Source: chosen, not measured.
    """

    host: str = "127.0.0.1"
    """Network address to listen on; only this computer unless set otherwise. Source: set for each cell."""
    port: Annotated[int, Field(ge=0, le=65535)] = 5020
    """TCP port to listen on; 0 takes a free one. Source: set for each cell."""
    connections: Annotated[int, Field(ge=1, le=500)] = 64
    """Number of connections at once, TLS handshakes included. A newcomer beyond takes the place of one that has never
    sent a request, else of the one that was idle longest, but never of one that holds the lease or has a run under way.
    """
    connections_per_host: Annotated[int, Field(ge=1, le=500)] = 32
    """Number of connections at once from one address; a newcomer beyond takes a place of its own host."""
    idle_timeout: Seconds = 60.0
    """Time without a request after which a connection is closed, s."""
    allow: tuple[IPv4Network | IPv6Network, ...] = ()
    """Networks or addresses that may connect; none given means every one that can reach the port. Source: set for each cell."""


class TlsConfig(ModbusConfig):
    """The Modbus/TCP Security server: mutual TLS, and rights by the role in the client's certificate.

    Source: set for each cell.
    """

    port: Annotated[int, Field(ge=0, le=65535)] = 802
    """TCP port to listen on; 802 is the registered one, below 1024 a user needs permission, 0 takes a free one."""
    certificate: FilePath
    """File of the cell's own certificate, PEM, with the chain above it."""
    key: FilePath
    """File of the certificate's private key, PEM, without a password."""
    authority: FilePath
    """File of the certificates of those who sign the clients' certificates, PEM."""
    revoked: FilePath | None = None
    """File of those signers' lists of revoked certificates, PEM, read at the start; without it no certificate counts as revoked."""
    roles: dict[Annotated[str, Field(min_length=1, max_length=64)], tuple[Right, ...]] = Field(default_factory=dict)
    """Rights of each role: "read", "command" and, without commanding, "stop"; a role not named has none."""
    without_role: tuple[Right, ...] = ()
    """Rights of a client whose certificate names no role."""


class RtuConfig(ConfigModel):
    """The Modbus RTU server on a serial line; defaults of Modbus over Serial Line V1.02, 2.5.1, 3.2.

    Source: set for each cell.
    """

    port: Annotated[str, Field(min_length=1)]
    """Name of the serial port, as in /dev/ttyUSB0."""
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    """Unit identifier of the cell; requests to other units are left unanswered."""
    baud_rate: Annotated[int, Field(ge=1200, le=4_000_000)] = 19200
    """Bit rate of the line, bits/s. Source: Modbus over Serial Line V1.02, 3.2."""
    parity: Parity = "even"
    """Parity of the line. Source: Modbus over Serial Line V1.02, 2.5.1."""
    stop_bits: Literal[1, 2] = 1
    """Number of stop bits; the standard asks for 2 where there is no parity, and many devices use 1. Source: Modbus over
    Serial Line V1.02, 2.5.1; set for each cell.
    """
    idle_timeout: Seconds = 60.0
    """Silence after which the next request begins a new conversation, whose first number is adopted, s. Source: chosen, not measured."""


class CanConfig(ConfigModel):
    """The CANopen node.

    Source: set for each cell.
    """

    interface: Interface
    """Interface through which the bus is reached."""
    channel: Annotated[str, Field(min_length=1)]
    """Channel of the interface, as in "can0", "/dev/ttyACM0", "HOST:PORT/can0" or "239.74.163.2"."""
    bitrate: Bitrate = 250_000
    """Bit rate of the bus, bits/s; set here for `slcan`, elsewhere by whoever set the interface up."""
    node_id: Annotated[int, Field(ge=1, le=127)] = 16
    """Node-ID of the cell."""
    plc_node: Annotated[int, Field(ge=1, le=127)] = 1
    """Node-ID of the PLC, whose heartbeat is watched and whose commands count."""
    heartbeat: Annotated[float, Field(ge=0.01, le=60.0)] = 0.1
    """Period of the cell's own heartbeat, s. Source: chosen, not measured."""
    plc_timeout: Annotated[float, Field(ge=0.0, le=60.0)] = 1.0
    """Time for which the PLC's heartbeat, once heard, may stay away before a run stops, s; 0 is no watch. Source: chosen, not measured."""

    @model_validator(mode="after")
    def _differ(self) -> Self:
        if self.node_id == self.plc_node:
            raise ValueError(f"node_id = {self.node_id}: that is the PLC's, plc_node; another one allowed")
        return self


class PlcConfig(ConfigModel):
    """The PLC's side of the cell.

    Source: chosen, not measured.
    """

    life_timeout: Seconds = 1.0
    """Time for which the life counter of whoever started a run may stand still before the run stops, s."""
    lease_timeout: Seconds = 5.0
    """Time without a request of its holder after which the lease is free again, s."""
    modbus: ModbusConfig = ModbusConfig()
    """The Modbus TCP server."""
    tls: TlsConfig | None = None
    """The Modbus/TCP Security server; off where the section is missing."""
    rtu: RtuConfig | None = None
    """The Modbus RTU server on a serial line; off where the section is missing."""
    can: CanConfig | None = None
    """The CANopen node; off where the section is missing."""
