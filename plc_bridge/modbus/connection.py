"""One Modbus TCP connection: strict framing, answers in the order of requests, and a bounded share of the time.

After a malformed header the connection closes, because the following bytes cannot be trusted. If a well-framed request
cannot be served, it gets an exception response. TCP needs no addressing by the unit identifier; the response echoes it.
"""

import asyncio
import socket
import struct
from typing import TYPE_CHECKING

from plc_bridge.config import ALL_RIGHTS, Right
from plc_bridge.modbus.pdu import is_exception, respond
from plc_bridge.protocol.station import LinkStation

if TYPE_CHECKING:
    from plc_bridge.modbus.server import ModbusServer

HEADER = struct.Struct(">HHHB")
"""Transaction, protocol, number of bytes after the length field, unit."""
SHORTEST, LONGEST = 2, 254  # MBAP length: unit + function .. unit + the longest PDU
SEND_BUFFER = 8192
"""Number of unsent bytes buffered here if a client does not read; the system buffers about twice as many."""


class Connection(asyncio.Protocol):
    """Connection to one client."""

    def __init__(self, server: "ModbusServer") -> None:
        self._server = server
        self._identity = ""
        self._is_lost = False
        self._buffer = bytearray()
        self._is_writable = True
        self._is_waiting = True  # no request is answered before the connection is admitted
        self.rights = ALL_RIGHTS
        self.transport: asyncio.Transport | None = None
        self.address = ""
        self.host = ""
        self.source = ""
        self.station: LinkStation | None = None
        """View of the registers; None until the connection is admitted."""
        self.arrived = 0.0
        """Time at which the connection was accepted, s."""
        self.heard: float | None = None
        """Time of the client's last request, s; None before the first."""

    @property
    def holds_stop(self) -> bool:
        """True if its stop coil is 1; the coil falls when the connection ends."""
        return self.station is not None and self.station.holds_stop

    def identify(self, identity: str, rights: frozenset[Right]) -> None:
        """Set the client's identity before the connection is made; clients with another identity are separate hosts even at
        the same address.
        """
        self._identity, self.rights = identity, rights
        self._name(self.address, self.source.rpartition(":")[2])

    def arrive(self, transport: asyncio.Transport) -> bool:
        """Take the transport, encrypted or not; return False if the client left before its acceptance."""
        self.transport, self.arrived = transport, self._server.loop.time()
        peer = transport.get_extra_info("peername")
        if peer is None or self._is_lost:
            transport.abort()
            return False
        self._name(peer[0], peer[1])
        link = transport.get_extra_info("socket")
        # asyncio sets TCP_NODELAY only if the socket names its protocol; without it, a second answer waits for an ACK
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        return True

    def _name(self, address: str, port: int | str) -> None:
        self.address = address
        self.host, self.source = f"{self._identity}{address}", f"{self._identity}{address}:{port}"

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Request admission."""
        assert isinstance(transport, asyncio.Transport)
        if self.transport is None and not self.arrive(transport):
            return
        if self._is_lost:
            transport.abort()
            return
        self.transport = transport
        transport.set_write_buffer_limits(high=SEND_BUFFER)
        if self._server.admit(self):
            self._is_waiting = False
            self._turn()

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave the server."""
        self._is_lost = True
        self._server.leave(self)

    def data_received(self, data: bytes) -> None:
        """Take the received bytes."""
        self._buffer += data
        if not self._is_waiting:
            self._turn()

    def pause_writing(self) -> None:
        """Stop answering while the client does not read."""
        self._is_writable = False
        self._accepted().pause_reading()

    def resume_writing(self) -> None:
        """Continue answering."""
        self._is_writable = True
        if not self._is_waiting:
            self._turn()

    def _accepted(self) -> asyncio.Transport:
        assert self.transport is not None  # set by `arrive`
        return self.transport

    def _turn(self) -> None:
        """Answer one turn of the received requests; if there may be more, pause before the next turn."""
        began = self._server.loop.time()
        has_more = self._answer_some()
        took = self._server.loop.time() - began
        self._server.worked += took
        if not has_more:
            return
        self._is_waiting = True
        self._accepted().pause_reading()
        self._server.crowd += 1
        # Pause before the next turn: 3 times the turn's duration for each connection with more requests. Even if a
        # client floods the server, three quarters of the time remain for the others and for the scan, on a computer of
        # any speed.
        self._server.loop.call_later(3.0 * took * self._server.crowd, self._next_turn)

    def _answer_some(self) -> bool:
        """Answer the requests of one turn; return True if there may be more."""
        transport = self._accepted()
        # Number of requests in one turn; then the other connections get their turn.
        for _ in range(8):
            if not self._is_writable or transport.is_closing():
                return False
            if not self._answer_next():
                transport.resume_reading()
                return False
        return True

    def _next_turn(self) -> None:
        self._is_waiting = False
        self._server.crowd -= 1
        self._turn()

    def _answer_next(self) -> bool:
        """Answer one request; return False if no whole request has arrived, or if the connection had to be closed."""
        station, transport, counts = self.station, self._accepted(), self._server.counts
        if station is None or len(self._buffer) < HEADER.size:
            return False
        transaction, protocol, length, unit = HEADER.unpack_from(self._buffer)
        if protocol != 0 or not SHORTEST <= length <= LONGEST:
            counts.malformed += 1
            said = "%s: closed: protocol id %d, length %d in the frame"
            self._server.log.warning(self.address, said, self.source, protocol, length)
            transport.abort()
            return False
        end = 6 + length
        if len(self._buffer) < end:
            return False
        request = bytes(self._buffer[HEADER.size : end])
        del self._buffer[:end]
        self.heard = self._server.loop.time()
        self._server.mailbox.heard(station.link.source)
        response = respond(request, station)
        counts.requests += 1
        if is_exception(response):
            counts.exceptions += 1
            station.refused(request[0], response[1])
        transport.write(HEADER.pack(transaction, 0, len(response) + 1, unit) + response)
        return True
