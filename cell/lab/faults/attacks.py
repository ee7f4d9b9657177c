"""Attacks on the cell's Modbus servers from another address of this computer, each for a given time in its own process.

The attacks send only to the loopback range, and stop by themselves.
"""

import multiprocessing
import random
import socket
import ssl
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

Address = tuple[str, int]
FROM = "127.0.0.2"
"""Source address of the attacks; the PLC's is 127.0.0.1."""
MOST = 200_000
"""Largest number of connections of one attack, whatever time remains."""
READ_TEN = b"\x00\x01\x00\x00\x00\x06\x01\x03\x00\x00\x00\x0a"
"""Modbus TCP frame that requests 10 holding registers (function code 3)."""


def _connect(address: Address) -> socket.socket:
    return socket.create_connection(address, timeout=0.2, source_address=(FROM, 0))


def _half_frame(address: Address) -> socket.socket:
    """Send part of a frame and stop."""
    client = _connect(address)
    client.sendall(READ_TEN[: random.randrange(1, len(READ_TEN))])
    return client


def _unread(address: Address) -> socket.socket:
    """Send requests without reading the answers, until no more can be sent."""
    client = _connect(address)
    client.setblocking(False)
    with suppress(OSError):
        for _ in range(MOST):
            client.send(100 * READ_TEN)
    return client


def _handshake(address: Address) -> socket.socket:
    """Begin a TLS handshake without a client certificate."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    client = context.wrap_socket(_connect(address), do_handshake_on_connect=False)
    client.settimeout(0.05)
    with suppress(OSError):
        client.do_handshake()
    return client


class Attack(NamedTuple):
    """An attack that opens connections one after the other."""

    open: Callable[[Address], socket.socket]
    most: int
    """Number of connections that stay open at once."""
    needs_tls: bool = False


ATTACKS = {
    "connect storm": Attack(_connect, 100),
    "half frames": Attack(_half_frame, 100),
    "clients that do not read": Attack(_unread, 20),
    "TLS handshake storm": Attack(_handshake, 8, needs_tls=True),
}


def in_process(attack: Attack, address: Address, seconds: float) -> None:
    """Run an attack in a process of its own until its end."""
    process = multiprocessing.get_context("fork").Process(target=_run, args=(attack, address, seconds), daemon=True)
    process.start()
    process.join(10.0 * seconds)
    process.kill()
    process.join()


def _run(attack: Attack, address: Address, seconds: float) -> None:
    waiting, until = deque[socket.socket](), time.monotonic() + seconds
    for _ in range(MOST):
        if time.monotonic() > until:
            break
        with suppress(OSError):
            waiting.append(attack.open(address))
        if len(waiting) > attack.most:
            waiting.popleft().close()
    for client in waiting:
        client.close()
