"""Modbus TCP server: one thread with one asyncio loop serves every socket."""

import asyncio
import errno
import logging
import socket
import threading
from functools import partial
from ipaddress import ip_address

from drivers.errors import DeviceNotOpenedError
from plc_bridge.config import ModbusConfig
from plc_bridge.modbus.admission import NoPlaceError, who_leaves
from plc_bridge.modbus.connection import Connection
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.peer_log import PeerLog
from plc_bridge.protocol.station import LinkStation, LinkWords

logger = logging.getLogger(__name__)


class ModbusServer:
    """Listens, admits clients, and closes idle connections; `start` and `close` may be called from any thread."""

    section = "plc.modbus"
    """Section of the config with the server's settings, as named in messages."""

    def __init__(self, config: ModbusConfig, mailbox: Mailbox) -> None:
        self._config = config
        self.mailbox = mailbox
        self.counts = Diagnostics()
        self.log = PeerLog(logger)
        self.crowd = 0
        """Number of connections with more requests than one turn answers."""
        self.worked = 0.0
        """Time spent on requests since the start, s."""
        self.loop: asyncio.AbstractEventLoop
        self._stop: asyncio.Event
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._guests: set[Connection] = set()
        """Connections that have a place; an admitted connection also has a station."""
        self._shared: dict[str, LinkWords] = {}

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that clients reach; the configured ones while the server is closed."""
        if self._socket is None:
            return self._config.host, self._config.port
        host, port = self._socket.getsockname()[:2]
        return host, port

    def start(self) -> None:
        """Bind, then serve in a separate thread.

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
        # Number of new connections accepted in a row; then the existing connections get their turn.
        server = await self.loop.create_server(self.receive, sock=listening, backlog=8)
        # Largest number of connections that wait for acceptance.
        listening.listen(128)  # asyncio would use one figure for both
        is_ready.set()
        while not self._stop.is_set():
            try:
                await asyncio.wait_for(self._stop.wait(), self._config.idle_timeout / 4)
            except TimeoutError:
                self._drop_idle()
        # asyncio reports an error if the server closes while a client is being accepted: first let it finish
        self.loop.remove_reader(listening)
        for _ in range(2):
            await asyncio.sleep(0)
        server.close()
        while self.abort_all():
            await asyncio.sleep(0)
        await server.wait_closed()

    def receive(self) -> asyncio.Protocol:
        """Return the protocol for a newly connected client."""
        return Connection(self)

    def abort_all(self) -> int:
        """Abort every connection; return the number of connections that have not ended yet."""
        for connection in self._guests:
            if connection.transport is not None:
                connection.transport.abort()
        return len(self._guests)

    def turn_away(self, connection: Connection, why: str) -> None:
        """Close a connection that is not admitted."""
        self.counts.forbidden += 1
        self.log.warning(connection.address, "%s: refused: %s", connection.source, why)
        if connection.transport is not None:
            connection.transport.abort()

    def reserve(self, connection: Connection) -> bool:
        """Give a new connection a place, or reject it; another connection may be closed for it."""
        if not self.is_allowed(connection.address):
            self.turn_away(connection, f"not in {self.section}.allow")
            return False
        config = self._config
        try:
            leaving = who_leaves(
                self._guests, self._kept(), connection.address, config.connections, config.connections_per_host
            )
        except NoPlaceError:
            self.turn_away(connection, f"no place: see {self.section}.connections")
            return False
        if leaving is not None:
            self._drop(leaving, "to make room")
        self._guests.add(connection)
        return True

    def _kept(self) -> set[Connection]:
        """Return the connections not to close for others: the last active one of each link with the lease or a run."""
        linked = sorted(self._guests, key=lambda each: (each.heard or 0.0, each.arrived))
        newest = {each.station.link.source: each for each in linked if each.station is not None}
        return {newest[source] for source in self.mailbox.kept if source in newest}

    def admit(self, connection: Connection) -> bool:
        """Give a connection its place and its link, or reject it."""
        if connection not in self._guests and not self.reserve(connection):
            return False
        link = self._shared_of(connection.host)
        if link is None:
            link = LinkWords(connection.source)
            self.mailbox.opened(connection.source, connection.host)
        warn, share = partial(self.log.warning, connection.address), partial(self.share, connection)
        connection.station = LinkStation(self.mailbox, link, self.counts, connection.rights, warn, share)
        self.counts.accepted += 1
        self.counts.connections += 1
        return True

    def leave(self, connection: Connection) -> None:
        """Remove a connection that has ended."""
        is_guest = connection in self._guests
        self._guests.discard(connection)
        if not is_guest or connection.station is None:
            return
        self.counts.connections -= 1
        connection.station.leave()
        if connection.station.link.source == connection.source:
            self.mailbox.closed(connection.source)
        else:
            self._shared_of(connection.host)

    def share(self, connection: Connection) -> None:
        """Move `connection` to the link shared by all connections of its host."""
        assert connection.station is not None  # the connection is admitted: it has written a request
        link, host = connection.station.link, connection.host
        if link.source == host:
            return
        self.mailbox.closed(link.source)
        shared = self._shared_of(host)
        if shared is None:
            shared = self._shared[host] = LinkWords(host, list(link.words), is_numbered=link.is_numbered)
            self.mailbox.opened(host, host)
        connection.station.move(shared)

    def _shared_of(self, host: str) -> LinkWords | None:
        """Return the shared link of `host`, None if there is none; end it if it has neither a connection nor the lease."""
        shared = self._shared.get(host)
        is_used = any(each.station is not None and each.station.link is shared for each in self._guests)
        if shared is not None and not is_used and self.mailbox.holder != host:
            del self._shared[host]
            self.mailbox.closed(host)
            return None
        return shared

    def is_allowed(self, host: str) -> bool:
        """Return True if the address may connect."""
        if not self._config.allow:
            return True
        address = ip_address(host.partition("%")[0])
        address = getattr(address, "ipv4_mapped", None) or address
        return any(address in network for network in self._config.allow)

    def _drop_idle(self) -> None:
        oldest = self.loop.time() - self._config.idle_timeout
        for connection in list(self._guests):
            if (connection.arrived if connection.heard is None else connection.heard) < oldest:
                self._drop(connection, "idle")

    def _drop(self, connection: Connection, why: str) -> None:
        self.counts.dropped += 1
        self.log.info(connection.address, "%s: dropped: %s", connection.source, why)
        if connection.transport is not None:
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
