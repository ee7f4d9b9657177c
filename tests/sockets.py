"""Bytes from a socket, for tests of servers."""

import socket


def receive(client: socket.socket, size: int) -> bytes:
    """Return so many bytes."""
    data = b""
    while len(data) < size:
        more = client.recv(size - len(data))
        if not more:
            raise ConnectionResetError(f"closed after {len(data)} of {size} bytes")
        data += more
    return data
