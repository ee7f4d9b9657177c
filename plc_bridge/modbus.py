"""Modbus TCP server: one thread, one asyncio loop, every socket; strict framing, answers in the order of requests.

A malformed header closes the connection, because nothing after it can be trusted; a well-framed request that cannot
be served gets its exception. The unit identifier is not used for addressing on TCP; it is echoed.
"""

import asyncio
import errno
import logging
import socket
import struct
import threading
from ipaddress import ip_address

from drivers.errors import DeviceNotOpenedError
from plc_bridge.config import ALL_RIGHTS, ModbusConfig, Right
from plc_bridge.images import Diagnostics
from plc_bridge.pdu import is_exception, respond
from plc_bridge.station import LinkStation, LinkWords, Mailbox

logger = logging.getLogger(__name__)

HEADER = struct.Struct(">HHHB")
"""Transaction, protocol, length of what follows the length field, unit."""
SHORTEST, LONGEST = 2, 254  # MBAP length: unit + function .. unit + the longest PDU
FRAMES_PER_TURN = 32
"""Requests of one connection that are answered before the others get their turn."""


class Connection(asyncio.Protocol):
    """One client: frames its bytes."""

    def __init__(self, server: "ModbusServer") -> None:
        self._server = server
        self._identity = ""
        self._is_lost = False
        self.rights = ALL_RIGHTS
        self._mailbox = server.mailbox
        self._buffer = bytearray()
        self._is_writable = True
        self._is_scheduled = True  # nothing is answered before it is admitted
        self.transport: asyncio.Transport
        self.address = ""
        self.host = ""
        self.source = ""
        self.station: LinkStation
        self.heard = 0.0

    def identify(self, identity: str, rights: frozenset[Right]) -> None:
        """Say who it is, before it is made; clients of other identity are others even at the same address."""
        self._identity, self.rights = identity, rights

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask to be admitted."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        # asyncio does this only where the socket names its protocol; without it a second answer waits for an ACK
        if not self._is_lost:
            transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        peer = transport.get_extra_info("peername")
        if peer is None or self._is_lost:  # gone before it was accepted
            transport.abort()
            return
        self.address = peer[0]
        self.host, self.source = f"{self._identity}{peer[0]}", f"{self._identity}{peer[0]}:{peer[1]}"
        if self._server.admit(self):
            self._turn()

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave."""
        self._is_lost = True
        self._server.leave(self)

    def data_received(self, data: bytes) -> None:
        """Take what has arrived."""
        self._buffer += data
        if not self._is_scheduled:
            self._turn()

    def pause_writing(self) -> None:
        """Let a client that does not read wait."""
        self._is_writable = False
        self.transport.pause_reading()

    def resume_writing(self) -> None:
        """Go on."""
        self._is_writable = True
        self._turn()

    def _turn(self) -> None:
        """Answer what has arrived, but leave the others their turn."""
        self._is_scheduled = False
        for _ in range(FRAMES_PER_TURN):
            if not self._is_writable or self.transport.is_closing():
                return
            if not self._answer_next():
                self.transport.resume_reading()
                return
        self._is_scheduled = True
        self.transport.pause_reading()
        self._server.loop.call_soon(self._turn)

    def _answer_next(self) -> bool:
        """Answer one request; return False when there is no whole one or the connection had to be closed."""
        if len(self._buffer) < HEADER.size:
            return False
        transaction, protocol, length, unit = HEADER.unpack_from(self._buffer)
        if protocol != 0 or not SHORTEST <= length <= LONGEST:
            self._server.counts.malformed += 1
            logger.warning("%s: closed: protocol id %d, length %d in the frame", self.source, protocol, length)
            self.transport.abort()
            return False
        end = 6 + length
        if len(self._buffer) < end:
            return False
        request = bytes(self._buffer[HEADER.size : end])
        del self._buffer[:end]
        self.heard = self._server.loop.time()
        self._mailbox.heard(self.station.link.source)
        response = respond(request, self.station)
        self._server.counts.requests += 1
        if is_exception(response):
            self._server.counts.exceptions += 1
            self.station.refused(request[0], response[1])
        self.transport.write(HEADER.pack(transaction, 0, len(response) + 1, unit) + response)
        return True


class ModbusServer:
    """Listens, admits clients, drops the idle; `start` and `close` may be called from any thread."""

    section = "plc.modbus"
    """Where its settings are, for messages."""

    def __init__(self, config: ModbusConfig, mailbox: Mailbox) -> None:
        self._config = config
        self.mailbox = mailbox
        self.counts = Diagnostics()
        self.loop: asyncio.AbstractEventLoop
        self._stop: asyncio.Event
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._connections: dict[str, Connection] = {}
        self._shared: dict[str, LinkWords] = {}

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that clients reach; the configured ones while nothing listens."""
        if self._socket is None:
            return self._config.host, self._config.port
        host, port = self._socket.getsockname()[:2]
        return host, port

    def start(self) -> None:
        """Bind, then serve in a thread of its own.

        Raises:
            DeviceNotOpenedError: The port is in use, not permitted, or the address is not this computer's.
        """
        self._socket = _bind(self._config.host, self._config.port, self.section)
        is_ready = threading.Event()
        self._thread = threading.Thread(
            target=asyncio.run, args=(self._serve(self._socket, is_ready),), name="modbus", daemon=True
        )
        self._thread.start()
        is_ready.wait()
        logger.info("%s: listening on %s port %d", self.section, *self.address)

    def close(self) -> None:
        """Close every connection and wait for the thread to end; may be called again."""
        if self._thread is None or self._socket is None:
            return
        self.loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
        self._socket.close()
        self._thread = self._socket = None

    async def _serve(self, listening: socket.socket, is_ready: threading.Event) -> None:
        self.loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        server = await self.loop.create_server(self.receive, sock=listening)
        is_ready.set()
        while not self._stop.is_set():
            try:
                await asyncio.wait_for(self._stop.wait(), self._config.idle_timeout / 4)
            except TimeoutError:
                self._drop_idle()
        # a client whose accept is under way must not meet a closed server, which asyncio calls an error
        self.loop.remove_reader(listening)
        for _ in range(2):
            await asyncio.sleep(0)
        server.close()
        while self.abort_all():
            await asyncio.sleep(0)
        await server.wait_closed()

    def receive(self) -> asyncio.Protocol:
        """Return what shall talk to a client that has just connected."""
        return Connection(self)

    def abort_all(self) -> int:
        """End every connection; return how many have not ended yet."""
        for connection in self._connections.values():
            connection.transport.abort()
        return len(self._connections)

    def turn_away(self, transport: asyncio.BaseTransport, source: str, why: str) -> None:
        """Close a connection that is not let in."""
        self.counts.forbidden += 1
        logger.warning("%s: refused: %s", source, why)
        assert isinstance(transport, asyncio.Transport)
        transport.abort()

    def admit(self, connection: Connection) -> bool:
        """Let a new connection in, or turn it away; make room by dropping the one that was idle longest."""
        if not self.is_allowed(connection.address):
            self.turn_away(connection.transport, connection.source, f"not in {self.section}.allow")
            return False
        if len(self._connections) >= self._config.connections:
            self._drop(min(self._connections.values(), key=lambda other: other.heard), "to make room")
        connection.heard = self.loop.time()
        shared = self._shared_of(connection.host)
        if shared is None:
            link = LinkWords(connection.source)
            self.mailbox.opened(connection.source, connection.host)
        else:
            link = shared
            shared.users += 1
        connection.station = LinkStation(
            self.mailbox, link, self.counts, connection.rights, lambda: self.share(connection)
        )
        self._connections[connection.source] = connection
        self.counts.accepted += 1
        self.counts.connections = len(self._connections)
        return True

    def leave(self, connection: Connection) -> None:
        """Forget a connection that has ended."""
        if self._connections.get(connection.source) is not connection:
            return
        del self._connections[connection.source]
        self.counts.connections = len(self._connections)
        connection.station.link.users -= 1
        if connection.station.link.source == connection.source:
            self.mailbox.closed(connection.source)
        else:
            self._shared_of(connection.host)

    def share(self, connection: Connection) -> None:
        """Move `connection` to the link that all connections of its host have together."""
        link, host = connection.station.link, connection.host
        if link.source == host:
            return
        shared = self._shared_of(host)
        if shared is None:
            shared = self._shared[host] = LinkWords(host, users=0)
            self.mailbox.opened(host, host)
        shared.words[:], shared.users = link.words, shared.users + 1
        shared.is_numbered |= link.is_numbered
        connection.station.link = shared
        self.mailbox.closed(link.source)

    def _shared_of(self, host: str) -> LinkWords | None:
        """Return the shared link of `host`; it ends with its lease, once no connection is left."""
        shared = self._shared.get(host)
        if shared is not None and shared.users == 0 and self.mailbox.holder != host:
            del self._shared[host]
            self.mailbox.closed(host)
            return None
        return shared

    def is_allowed(self, host: str) -> bool:
        """Tell whether the address may connect."""
        if not self._config.allow:
            return True
        address = ip_address(host.partition("%")[0])
        address = getattr(address, "ipv4_mapped", None) or address
        return any(address in network for network in self._config.allow)

    def _drop_idle(self) -> None:
        oldest = self.loop.time() - self._config.idle_timeout
        for connection in list(self._connections.values()):
            if connection.heard < oldest:
                self._drop(connection, "idle")

    def _drop(self, connection: Connection, why: str) -> None:
        self.counts.dropped += 1
        logger.info("%s: dropped: %s", connection.source, why)
        connection.transport.abort()
        self.leave(connection)


def _bind(host: str, port: int, section: str) -> socket.socket:
    """Return a listening socket."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            remedy = f"in use by another program: stop it, or set {section}.port (0 takes a free one)"
        elif error.errno == errno.EACCES:
            remedy = f"not permitted: set {section}.port to 1024 or above"
        else:
            remedy = f"{error.strerror or error}: set {section}.host to an address of this computer"
        raise DeviceNotOpenedError(f"Modbus TCP server: {host} port {port} is {remedy}") from error
