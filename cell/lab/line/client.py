"""Clients that load a Modbus server and check every answer: one with a single pending request, and many at once."""

import asyncio
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from plc_bridge.images import COMMAND, REPORT, CommandImage, command_words, report_image
from plc_bridge.messages import Report
from plc_bridge.registers import COILS, DISCRETE_INPUTS

Address = tuple[str, int]
TIMEOUT = 10.0
"""Longest wait for an answer, s."""
_HEADER = struct.Struct(">HHHB")
READ_TEN = struct.pack(">BHH", 3, 0, 10)
"""FC3 of 10 registers."""
_READ_REPORT = struct.pack(">BHH", 4, REPORT.start, REPORT.words)
_READ_BUSY = struct.pack(">BHH", 2, DISCRETE_INPUTS["busy"], 1)
_STOP, _GO = (struct.pack(">BHH", 5, COILS["stop"], value) for value in (0xFF00, 0))


class Client:
    """A connection with a single pending request."""

    def __init__(self, address: Address) -> None:
        self._socket = socket.create_connection(address, timeout=TIMEOUT)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._transaction = 0

    def ask(self, pdu: bytes) -> bytes:
        """Return the answer to one request.

        Raises:
            ConnectionError: No answer arrived, or the answer to another request.
        """
        self._transaction = (self._transaction + 1) % 0x10000
        self._socket.sendall(_frame(self._transaction, pdu))
        data = b""
        while len(data) < _HEADER.size or len(data) < 6 + _HEADER.unpack_from(data)[2]:
            more = self._socket.recv(4096)
            if not more:
                raise ConnectionError("the server closed the connection")
            data += more
        if _HEADER.unpack_from(data)[0] != self._transaction or data[7] != pdu[0]:
            raise ConnectionError(f"{pdu.hex(' ')}: answered with {data.hex(' ')}")
        return data[7:]

    def write(self, image: CommandImage) -> None:
        """Write the command block in one request."""
        words = command_words(image)
        head = struct.pack(">BHHB", 16, COMMAND.start, len(words), 2 * len(words))
        self.ask(head + struct.pack(f">{len(words)}H", *words))

    def report(self) -> Report:
        """Return the report."""
        return report_image(struct.unpack(f">{REPORT.words}H", self.ask(_READ_REPORT)[2:]))

    def is_busy(self) -> bool:
        """Return the discrete input Busy."""
        return bool(self.ask(_READ_BUSY)[2] & 1)

    def stop(self) -> None:
        """Stop the cell."""
        self.ask(_STOP)
        self.ask(_GO)

    def close(self) -> None:
        """Disconnect."""
        self._socket.close()


@contextmanager
def connected(address: Address) -> Iterator[Client]:
    """Yield a client until the end."""
    client = Client(address)
    try:
        yield client
    finally:
        client.close()


def time_requests(client: Client, count: int) -> list[float]:
    """Return the duration of each of `count` reads of ten registers, s."""
    times = []
    for _ in range(count):
        started = time.perf_counter()
        client.ask(READ_TEN)
        times.append(time.perf_counter() - started)
    return times


@dataclass(frozen=True, slots=True)
class Load:
    """Requests of many clients at once, and their answers."""

    clients: int
    sent: int
    answered: int
    """Number of answers with the right transaction id, function and length."""
    duration: float
    """Duration of the load, s."""

    @property
    def lost(self) -> int:
        """Number of requests without a right answer."""
        return self.sent - self.answered


def load(address: Address, clients: int, requests: int, period: float = 0.0) -> Load:
    """Let `clients` in parallel read ten registers `requests` times each: without pause, or once per `period`, s."""
    started = time.perf_counter()
    answered = asyncio.run(_all(address, clients, requests, period))
    return Load(clients, clients * requests, answered, time.perf_counter() - started)


async def _all(address: Address, clients: int, requests: int, period: float) -> int:
    return sum(await asyncio.gather(*(_one(address, requests, period, n * period / clients) for n in range(clients))))


async def _one(address: Address, requests: int, period: float, delay: float) -> int:
    """Return the number of correct answers; the client ends at the first request without one."""
    answered = 0
    reader, writer = await asyncio.open_connection(*address)
    due = asyncio.get_running_loop().time() + delay
    try:
        for n in range(requests):
            if period:
                await asyncio.sleep(due + n * period - asyncio.get_running_loop().time())
            writer.write(_frame(n % 0x10000, READ_TEN))
            answer = await asyncio.wait_for(reader.readexactly(29), TIMEOUT)
            answered += answer[:9] == _HEADER.pack(n % 0x10000, 0, 23, 1) + bytes([3, 20])
    except (OSError, EOFError, TimeoutError):
        pass
    finally:
        writer.close()
    return answered


def _frame(transaction: int, pdu: bytes) -> bytes:
    return _HEADER.pack(transaction, 0, len(pdu) + 1, 1) + pdu
