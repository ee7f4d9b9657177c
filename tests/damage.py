"""Bytes on their way: cut into pieces of any size, and with turned bits."""

from collections.abc import Iterator

from hypothesis import strategies as st


def pieces(stream: bytes, data: st.DataObject) -> Iterator[bytes]:
    """Yield the stream in pieces of drawn sizes."""
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        yield stream[:size]
        stream = stream[size:]


def flipped(data: bytes, *bits: int) -> bytes:
    """Return the data with these bits turned."""
    spoiled = bytearray(data)
    for bit in bits:
        spoiled[bit // 8] ^= 1 << bit % 8
    return bytes(spoiled)


def each_bit_flipped(data: bytes) -> list[bytes]:
    """Return the data once for each of its bits, with this bit turned."""
    return [flipped(data, bit) for bit in range(8 * len(data))]
