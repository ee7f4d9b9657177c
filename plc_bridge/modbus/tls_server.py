"""Modbus/TCP Security server: the Modbus TCP server with mutual TLS, and with the rights of the client's role."""

import asyncio
import ssl

from plc_bridge.config import TlsConfig
from plc_bridge.modbus.connection import Connection
from plc_bridge.modbus.server import ModbusServer
from plc_bridge.modbus.tls import BadRoleError, rights_of, role_of, server_context
from plc_bridge.protocol.mailbox import Mailbox


class _Door(asyncio.Protocol):
    """Protocol of a client until its TLS handshake begins; TLS then takes the client's bytes."""

    def __init__(self, server: "SecureModbusServer") -> None:
        self._server = server

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        # Python 3.11.2 (Debian 12) starts to read after this call even if reading is paused; the bytes would be lost.
        self._server.loop.call_soon(transport.pause_reading)
        self._server.knock(transport)


class SecureModbusServer(ModbusServer):
    """Listens for TLS; a client's identity is its role and its address.

    A client counts as a connection from its arrival on. Until its handshake ends, it is a connection without requests.
    """

    section = "plc.tls"

    def __init__(self, config: TlsConfig, mailbox: Mailbox) -> None:
        super().__init__(config, mailbox)
        self._tls = config
        self._context: ssl.SSLContext
        self._pace: asyncio.Lock
        self._handshakes: dict[Connection, asyncio.Task[None]] = {}

    def start(self) -> None:
        """Read the certificates, bind, then serve in a separate thread.

        Raises:
            DeviceNotOpenedError: A certificate or key cannot be used, or the port cannot be opened.
        """
        self._context, self._pace = server_context(self._tls), asyncio.Lock()
        super().start()

    def receive(self) -> asyncio.Protocol:
        """Return the protocol for a newly connected client."""
        return _Door(self)

    def knock(self, transport: asyncio.Transport) -> None:
        """Count a client as a connection, and begin its handshake in its turn."""
        connection = Connection(self)
        if connection.arrive(transport) and self.reserve(connection):
            self._handshakes[connection] = self.loop.create_task(self._shake_hands(connection))

    def leave(self, connection: Connection) -> None:
        """Remove a connection that has ended, during its handshake or afterwards."""
        super().leave(connection)
        task = self._handshakes.pop(connection, None)
        if task is not None:
            task.cancel()

    def abort_all(self) -> int:
        """Abort every handshake and every connection; return the number of connections that have not ended yet."""
        left = super().abort_all()
        for connection in list(self._handshakes):
            self.leave(connection)
        return left

    async def _shake_hands(self, connection: Connection) -> None:
        await self._pace.acquire()
        # Least time between the beginnings of two handshakes, s; each blocks the open connections for milliseconds.
        self.loop.call_later(0.01, self._pace.release)
        # the protocol needs the role, which only the handshake provides; TLS needs the protocol before the handshake
        # Longest TLS handshake, s.
        timeout = min(10.0, self._tls.idle_timeout)
        assert connection.transport is not None
        try:
            secure = await self.loop.start_tls(
                connection.transport, connection, self._context, server_side=True, ssl_handshake_timeout=timeout
            )
            role = role_of(_certificate(secure))
        except (OSError, BadRoleError) as error:  # SSLError is an OSError
            del self._handshakes[connection]
            self.turn_away(connection, f"TLS: {error}".replace("\n", " "))
            self.leave(connection)
            return
        assert secure is not None
        del self._handshakes[connection]
        connection.identify(f"{role}@", rights_of(role, self._tls))
        connection.connection_made(secure)


def _certificate(transport: asyncio.Transport | None) -> bytes:
    tls = transport.get_extra_info("ssl_object") if transport is not None else None
    try:
        certificate: bytes | None = tls.getpeercert(binary_form=True) if tls is not None else None
    except ValueError:  # the client left during the handshake
        certificate = None
    if certificate is None:
        raise BadRoleError("the client left, or has no certificate")
    return certificate
