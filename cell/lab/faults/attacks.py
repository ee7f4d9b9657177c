"""Attacks on the cell's Modbus servers from another address of this computer, each for a given time in its own process.

They send only to the loopback range, and stop by themselves.
"""

import multiprocessing
import random
import socket
import ssl
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

Address = tuple[str, int]
Send = Callable[[Address], socket.socket]
FROM = "127.0.0.2"
"""Source address of the attacks; the PLC's is 127.0.0.1."""
MOST = 200_000
"""Largest number of connections or floods of one attack, whatever time remains."""
READ_TEN = b"\x00\x01\x00\x00\x00\x06\x01\x03\x00\x00\x00\x0a"
"""FC3 of 10 registers in its frame."""


def _connect(address: Address) -> socket.socket:
    return socket.create_connection(address, timeout=0.2, source_address=(FROM, 0))


def _half_frame(address: Address) -> socket.socket:
    """Send part of a frame and stop."""
    client = _connect(address)
    client.sendall(READ_TEN[: random.randrange(1, len(READ_TEN))])
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


def storm(address: Address, seconds: float, send: Send = _connect, most: int = 100) -> None:
    """Open one connection after the other, with the last `most` of them open at once."""
    waiting, until = deque[socket.socket](), time.monotonic() + seconds
    for _ in range(MOST):
        if time.monotonic() > until:
            break
        with suppress(OSError):
            waiting.append(send(address))
        if len(waiting) > most:
            waiting.popleft().close()
    for client in waiting:
        client.close()


def half_frames(address: Address, seconds: float) -> None:
    """Send part of a frame on each connection."""
    storm(address, seconds, _half_frame)


def tls_storm(address: Address, seconds: float) -> None:
    """Begin TLS handshakes one after the other."""
    storm(address, seconds, _handshake, most=8)


def flood(address: Address, seconds: float) -> None:
    """Flood with requests from twenty connections without reading the answers."""
    until, clients = time.monotonic() + seconds, list[socket.socket]()
    for _ in range(20):
        with suppress(OSError):
            clients.append(_connect(address))
            clients[-1].setblocking(False)
    for _ in range(MOST):
        if time.monotonic() > until:
            break
        for client in clients:
            with suppress(OSError):
                client.send(100 * READ_TEN)
    for client in clients:
        client.close()


ATTACKS: dict[str, Callable[[Address, float], None]] = {
    "connect storm": storm,
    "half frames": half_frames,
    "clients that do not read": flood,
    "TLS handshake storm": tls_storm,
}


def in_process(attack: Callable[[Address, float], None], address: Address, seconds: float) -> None:
    """Run an attack in a process of its own until its end."""
    process = multiprocessing.get_context("fork").Process(target=attack, args=(address, seconds), daemon=True)
    process.start()
    process.join(10.0 * seconds)
    process.kill()
    process.join()
