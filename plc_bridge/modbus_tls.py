"""Modbus/TCP Security server: the Modbus TCP server behind mutual TLS, with the rights of the client's role."""

import asyncio
import logging
import ssl

from plc_bridge.config import TlsConfig
from plc_bridge.modbus import Connection, ModbusServer
from plc_bridge.station import Mailbox
from plc_bridge.tls import BadRoleError, rights_of, role_of, server_context

logger = logging.getLogger(__name__)

HANDSHAKE_TIMEOUT = 10.0
"""Longest TLS handshake, s."""


class _Door(asyncio.Protocol):
    """A client whose TLS handshake is not over; what it sends goes to TLS."""

    def __init__(self, server: "SecureModbusServer") -> None:
        self._server = server

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        transport.pause_reading()
        self._server.knock(transport)


class SecureModbusServer(ModbusServer):
    """Listens for TLS; a client is known by its role and its address."""

    section = "plc.tls"

    def __init__(self, config: TlsConfig, mailbox: Mailbox) -> None:
        super().__init__(config, mailbox)
        self._tls = config
        self._context: ssl.SSLContext
        self._handshakes: dict[asyncio.Task[None], tuple[asyncio.Transport, str]] = {}  # in the order they began

    def start(self) -> None:
        """Read the certificates, bind, then serve in a thread of its own.

        Raises:
            DeviceNotOpenedError: A certificate or key cannot be used, or the port cannot be had.
        """
        self._context = server_context(self._tls)
        super().start()

    def receive(self) -> asyncio.Protocol:
        """Return what shall talk to a client that has just connected."""
        return _Door(self)

    def knock(self, transport: asyncio.Transport) -> None:
        """Begin the handshake with a client whose address is allowed; where too many are under way, the oldest ends."""
        peer = transport.get_extra_info("peername")
        if peer is None:  # gone before it was accepted
            transport.abort()
            return
        source = f"{peer[0]}:{peer[1]}"
        if not self.is_allowed(peer[0]):
            self.turn_away(transport, source, f"not in {self.section}.allow")
            return
        if len(self._handshakes) >= self._tls.connections:
            self._end_oldest()
        task = self.loop.create_task(self._shake_hands(transport, source))
        self._handshakes[task] = transport, source
        task.add_done_callback(lambda done: self._handshakes.pop(done, None))

    def _end_oldest(self) -> None:
        task = next(iter(self._handshakes))
        transport, source = self._handshakes.pop(task)
        logger.info("%s: dropped in its TLS handshake: to make room", source)
        self.counts.dropped += 1
        task.cancel()
        transport.abort()  # a task that has not begun does not close it

    def abort_all(self) -> int:
        """End every handshake and every connection; return how many have not ended yet."""
        for task, (transport, _) in self._handshakes.items():
            task.cancel()
            transport.abort()
        return super().abort_all() + len(self._handshakes)

    async def _shake_hands(self, transport: asyncio.Transport, source: str) -> None:
        # the protocol needs the role, which the handshake brings; TLS needs a protocol before
        connection = Connection(self)
        timeout = min(HANDSHAKE_TIMEOUT, self._tls.idle_timeout)
        try:
            secure = await self.loop.start_tls(
                transport, connection, self._context, server_side=True, ssl_handshake_timeout=timeout
            )
            role = role_of(_certificate(secure))
        except (OSError, BadRoleError) as error:  # SSLError is an OSError
            self.turn_away(transport, source, f"TLS: {error}".replace("\n", " "))
            return
        assert secure is not None
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
