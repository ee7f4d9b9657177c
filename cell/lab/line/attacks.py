"""Attacks on the cell's Modbus servers from another address of this computer, each for a given time in its own process.

They send only to the loopback range, and stop by themselves.
"""

import multiprocessing
import random
import socket
import ssl
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from cell.lab.line.cell_process import Doors
from cell.lab.line.client import READ_TEN, Address

FROM = "127.0.0.2"
"""Source address of the attacks; the PLC's is 127.0.0.1."""
OPEN_AT_ONCE, FLOODERS, TLS_CLIENTS = 100, 20, 8
_MOST = 200_000
"""Largest number of connections, frames or handshakes of one burst, whatever time remains."""
_FRAME = b"\x00\x01\x00\x00" + (len(READ_TEN) + 1).to_bytes(2, "big") + b"\x01" + READ_TEN


def connect_storm(doors: Doors, until: float) -> None:
    """Connect repeatedly without sending data, a hundred connections at once."""
    waiting: deque[socket.socket] = deque()
    for _ in _while(until):
        with suppress(OSError):
            waiting.append(_connect(doors.plain))
        if len(waiting) > OPEN_AT_ONCE:
            waiting.popleft().close()
    _close(waiting)


def half_frames(doors: Doors, until: float) -> None:
    """Send part of a frame on each connection and stop."""
    rng, waiting = random.Random(1), deque[socket.socket]()
    for _ in _while(until):
        with suppress(OSError):
            client = _connect(doors.plain)
            waiting.append(client)
            client.sendall(_FRAME[: rng.randrange(1, len(_FRAME))])
        if len(waiting) > OPEN_AT_ONCE:
            waiting.popleft().close()
    _close(waiting)


def non_readers(doors: Doors, until: float) -> None:
    """Flood with requests from twenty connections without reading the answers."""
    clients: list[socket.socket] = []
    for _ in range(FLOODERS):
        with suppress(OSError):
            clients.append(_connect(doors.plain))
    for client in clients:
        client.setblocking(False)
    flood = _FRAME * 100
    for _ in _while(until):
        for client in clients:
            with suppress(OSError):
                client.send(flood)
    _close(clients)


def tls_storm(doors: Doors, until: float) -> None:
    """Begin TLS handshakes one after the other, without a client certificate."""
    assert doors.secure is not None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    waiting: deque[socket.socket] = deque()
    for _ in _while(until):
        with suppress(OSError):
            secured = context.wrap_socket(_connect(doors.secure), do_handshake_on_connect=False)
            secured.settimeout(0.05)
            waiting.append(secured)
            secured.do_handshake()
        if len(waiting) > TLS_CLIENTS:
            waiting.popleft().close()
    _close(waiting)


def no_attack(doors: Doors, until: float) -> None:
    """Do nothing, to measure the effect of this computer alone."""


ATTACKS: dict[str, Callable[[Doors, float], None]] = {
    "no attack": no_attack,
    "connect storm": connect_storm,
    "half frames": half_frames,
    "clients that do not read": non_readers,
    "TLS handshake storm": tls_storm,
}


@contextmanager
def attack(name: str, doors: Doors, seconds: float) -> Iterator[None]:
    """Run one attack in another process in parallel; it ends after its time."""
    process = multiprocessing.get_context("fork").Process(target=_attack, args=(name, doors, seconds), daemon=True)
    process.start()
    try:
        yield
        process.join(10.0 * seconds)
    finally:
        process.kill()
        process.join()


def _attack(name: str, doors: Doors, seconds: float) -> None:
    ATTACKS[name](doors, time.monotonic() + seconds)


def _while(until: float) -> Iterator[int]:
    for n in range(_MOST):
        if time.monotonic() > until:
            return
        yield n


def _connect(address: Address) -> socket.socket:
    return socket.create_connection(address, timeout=0.2, source_address=(FROM, 0))


def _close(clients: "deque[socket.socket] | list[socket.socket]") -> None:
    for client in clients:
        with suppress(OSError):
            client.close()
