"""Modbus frames on a socket, for tests of servers."""

import socket
import struct

HEADER = struct.Struct(">HHHB")
PATIENCE = 20.0
"""Longest wait for bytes, s."""


def receive(client: socket.socket, size: int) -> bytes:
    """Return so many bytes."""
    data = b""
    while len(data) < size:
        more = client.recv(size - len(data))
        if not more:
            raise ConnectionResetError(f"closed after {len(data)} of {size} bytes")
        data += more
    return data


def frame(pdu: bytes, transaction: int = 1, protocol: int = 0, length: int | None = None, unit: int = 1) -> bytes:
    """Return a request with its header."""
    return HEADER.pack(transaction, protocol, len(pdu) + 1 if length is None else length, unit) + pdu


def answer(client: socket.socket) -> tuple[int, int, bytes]:
    """Return transaction, unit and PDU of the next answer."""
    transaction, protocol, length, unit = HEADER.unpack(receive(client, HEADER.size))
    assert protocol == 0
    return transaction, unit, receive(client, length - 1)


def ask(client: socket.socket, *pdus: bytes) -> bytes:
    """Send requests one after the other and return the last answer."""
    told = b""
    for pdu in pdus:
        client.sendall(frame(pdu))
        told = answer(client)[2]
    return told


def is_closed(client: socket.socket) -> bool:
    """Return True if the server has closed the connection without another answer."""
    try:
        return client.recv(1) == b""
    except OSError:
        return True
