"""The bridge to the PLC: the mailbox, and the servers of all buses behind it."""

import time
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.errors import CellError, ConfigError
from drivers.transport.serial_line import SerialLine
from plc_bridge.config import PlcConfig
from plc_bridge.modbus.rtu import RtuServer
from plc_bridge.modbus.server import ModbusServer
from plc_bridge.modbus.tls_server import SecureModbusServer
from plc_bridge.protocol.intervals import Intervals
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.packml import PackTags
from plc_bridge.protocol.registers import Parameter, table

if TYPE_CHECKING:
    from plc_bridge.canopen.bus import CanopenServer
    from plc_bridge.opcua.server import OpcUaServer


@dataclass(frozen=True, slots=True)
class Figures:
    """Counts and times since the start."""

    counts: Diagnostics
    tags: PackTags
    intervals: Intervals
    """Time between two scans."""
    served: float
    """Time spent by the Modbus TCP servers on requests, s."""


class Bridge(Mailbox):
    """The mailbox with its servers.

    The constructor opens nothing. `start` opens the sockets; the scan thread calls `poll` and `publish` once a scan.

    Args:
        config: Addresses to listen on, and the time-outs.
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters, at most eight.
        now: Monotonic time, s.
        opcua: Host and port of the OPC UA server; None if it is off.
    """

    def __init__(
        self,
        config: PlcConfig,
        programs: Mapping[int, str],
        parameters: Sequence[Parameter] = (),
        now: Callable[[], float] = time.monotonic,
        opcua: tuple[str, int] | None = None,
    ) -> None:
        super().__init__(dict(programs), tuple(parameters), config.life_timeout, config.lease_timeout, now)
        self._server = ModbusServer(config.modbus, self)
        self._servers: list[ModbusServer | RtuServer | CanopenServer | OpcUaServer] = [self._server]
        self._secure: SecureModbusServer | None = None
        if config.tls is not None:
            self._secure = SecureModbusServer(config.tls, self)
            self._servers.append(self._secure)
        if config.rtu is not None:
            line = SerialLine(config.rtu.port, config.rtu.baud_rate, config.rtu.parity, config.rtu.stop_bits)
            self._servers.append(RtuServer(config.rtu, line, self))
        registers = table(programs, parameters)
        if config.can is not None:
            # Imported here: importing the CAN libraries takes 0.1 s, which only a cell with CANopen should spend.
            from drivers.transport.can_bus import CanBus
            from plc_bridge.canopen import bus

            wire = CanBus(config.can.interface, config.can.channel, config.can.bitrate)
            self._servers.append(bus.CanopenServer(config.can, registers, wire, self))
        self._opcua: OpcUaServer | None = None
        if opcua is not None:
            # Imported here: the library is an optional extra of the package, and its import takes a second.
            try:
                from plc_bridge.opcua import server
            except ModuleNotFoundError as error:
                raise ConfigError(f"--opcua: {error}: install the extra, as by uv pip install -e '.[opcua]'") from error
            self._opcua = server.OpcUaServer(opcua, config, self, registers, parameters)
            self._servers.append(self._opcua)

    def start(self) -> None:
        """Listen for the PLC.

        Raises:
            DeviceNotOpenedError: A port is in use or missing, or the address is not this computer's.
        """
        try:
            for server in self._servers:
                server.start()
        except CellError:
            self.close()
            raise

    def close(self) -> None:
        """Stop listening and drop every connection; may be called again."""
        for server in self._servers:
            server.close()

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the Modbus TCP server."""
        return self._server.address

    @property
    def secure_address(self) -> tuple[str, int] | None:
        """Host and port of the TLS server; None if it is off."""
        return self._secure.address if self._secure is not None else None

    @property
    def opcua_address(self) -> tuple[str, int] | None:
        """Host and port of the OPC UA server; None if it is off."""
        return self._opcua.address if self._opcua is not None else None

    @property
    def figures(self) -> Figures:
        """Present counts and times since the start."""
        counts = self.diagnostics
        served = self._server.worked + (self._secure.worked if self._secure is not None else 0.0)
        with self._lock:
            return Figures(counts, deepcopy(self._orders.tags), deepcopy(self._intervals), served)

    @property
    def diagnostics(self) -> Diagnostics:
        """Counts since the start."""
        total = super().diagnostics
        for server in self._servers:
            total = total + server.counts
        return total
