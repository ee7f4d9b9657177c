"""One Modbus request in, one response out: strict about every length, count and value.

The code is the same for every framing; the station gives the words their meaning. Source of the bytes: Modbus Application
Protocol V1.1b3, chapter 6.
"""

import struct
from collections.abc import Callable, Sequence

from pymodbus.constants import ExcCodes

from plc_bridge.modbus.identity import DEVICE_IDENTIFICATION, RETURN_QUERY_DATA, device_identification, server_id
from plc_bridge.protocol.station import LinkStation

MOST_BITS_READ, MOST_BITS_WRITTEN = 2000, 1968  # 6.1, 6.11
MOST_WORDS_READ, MOST_WORDS_WRITTEN, MOST_WORDS_EXCHANGED = 125, 123, 121  # 6.3, 6.12, 6.17
COIL_ON, COIL_OFF = 0xFF00, 0x0000
DIAGNOSTICS, SERVER_ID, MASK_WRITE, ENCAPSULATED = 8, 17, 22, 43  # 6.8, 6.13, 6.16, 6.21

_HEAD_LENGTH = dict.fromkeys((1, 2, 3, 4, 5, 6, DIAGNOSTICS), 5)
_HEAD_LENGTH |= {15: 6, 16: 6, SERVER_ID: 1, MASK_WRITE: 7, 23: 10, ENCAPSULATED: 4}
"""Length of each request, bytes; for functions in `_COUNTED` the length up to the byte count, which the data follow."""
_COUNTED = {15, 16, 23}
_HEAD = struct.Struct(">BHH")
"""Function, address, and count or value."""


def respond(request: bytes, station: LinkStation) -> bytes:
    """Return the response PDU to a request PDU of at least one byte; never raise, whatever the client sends.

    The station raises LookupError for unmapped addresses, PermissionError for accesses beyond the client's rights, and
    ValueError for values that are never permitted.
    """
    try:
        _check_length(request)
        return _SERVED[request[0]](request, station)
    except (NotImplementedError, PermissionError):  # a missing right: Modbus/TCP Security, R-31
        exception = ExcCodes.ILLEGAL_FUNCTION
    except ValueError:
        exception = ExcCodes.ILLEGAL_VALUE
    except LookupError:
        exception = ExcCodes.ILLEGAL_ADDRESS
    return bytes([request[0] | 0x80, exception])


def is_exception(response: bytes) -> bool:
    """Return True if the response is an exception."""
    return response[0] >= 0x80


def length_of(request: bytes) -> int:
    """Return the length, in bytes, of a request that begins with these bytes; for an echo, with one word of data.

    Raises:
        NotImplementedError: The function does not exist.
    """
    function = request[0]
    if function not in _HEAD_LENGTH:
        raise NotImplementedError(function)
    head = _HEAD_LENGTH[function]
    return head + request[head - 1] if function in _COUNTED and len(request) >= head else head


def _check_length(request: bytes) -> None:
    size, least = len(request), length_of(request)
    _require(size == least or (request[0] == DIAGNOSTICS and size > least and size % 2 == 1))  # an echo may be longer


def _require(is_permitted: bool) -> None:
    if not is_permitted:
        raise ValueError


def _words(data: bytes) -> Sequence[int]:
    return struct.unpack(f">{len(data) // 2}H", data)


def _with_words(function: int, words: Sequence[int]) -> bytes:
    return struct.pack(f">BB{len(words)}H", function, 2 * len(words), *words)


def _read_bits(request: bytes, station: LinkStation) -> bytes:
    function, address, count = _HEAD.unpack(request)
    _require(1 <= count <= MOST_BITS_READ)
    bits = station.read_bits(function, address, count)
    data = sum(bit << place for place, bit in enumerate(bits)).to_bytes((count + 7) // 8, "little")
    return bytes([function, len(data)]) + data


def _read_words(request: bytes, station: LinkStation) -> bytes:
    function, address, count = _HEAD.unpack(request)
    _require(1 <= count <= MOST_WORDS_READ)
    return _with_words(function, station.read_words(function, address, count))


def _write_bit(request: bytes, station: LinkStation) -> bytes:
    _, address, value = _HEAD.unpack(request)
    _require(value in (COIL_ON, COIL_OFF))
    station.write_bits(address, [value == COIL_ON])
    return request


def _write_word(request: bytes, station: LinkStation) -> bytes:
    _, address, value = _HEAD.unpack(request)
    station.write_words(address, [value])
    return request


def _write_bits(request: bytes, station: LinkStation) -> bytes:
    _, address, count, size = struct.unpack_from(">BHHB", request)
    _require(1 <= count <= MOST_BITS_WRITTEN)
    _require(size == (count + 7) // 8)
    data = int.from_bytes(request[6:], "little")
    station.write_bits(address, [bool(data >> place & 1) for place in range(count)])
    return request[:5]


def _write_words(request: bytes, station: LinkStation) -> bytes:
    _, address, count, size = struct.unpack_from(">BHHB", request)
    _require(1 <= count <= MOST_WORDS_WRITTEN)
    _require(size == 2 * count)
    station.write_words(address, _words(request[6:]))
    return request[:5]


def _mask_word(request: bytes, station: LinkStation) -> bytes:
    _, address, kept, added = struct.unpack(">BHHH", request)
    station.mask_word(address, kept, added)
    return request


def _exchange(request: bytes, station: LinkStation) -> bytes:
    function, source, wanted, address, count, size = struct.unpack_from(">BHHHHB", request)
    _require(1 <= wanted <= MOST_WORDS_READ)
    _require(1 <= count <= MOST_WORDS_EXCHANGED)
    _require(size == 2 * count)
    station.read_words(3, source, wanted)  # an address error must come before the write
    station.write_words(address, _words(request[10:]))
    return _with_words(function, station.read_words(3, source, wanted))


def _echo(request: bytes, station: LinkStation) -> bytes:
    station.is_running()  # refuses a client that may not read
    if int.from_bytes(request[1:3]) != RETURN_QUERY_DATA:
        raise NotImplementedError(DIAGNOSTICS)
    return request


def _identify(request: bytes, station: LinkStation) -> bytes:
    station.is_running()  # refuses a client that may not read
    function, kind, code, number = request
    if kind != DEVICE_IDENTIFICATION:
        raise NotImplementedError(kind)
    return bytes([function]) + device_identification(code, number)


def _tell_server(request: bytes, station: LinkStation) -> bytes:
    return request + server_id(station.is_running())


_SERVED: dict[int, Callable[[bytes, LinkStation], bytes]] = {
    1: _read_bits,
    2: _read_bits,
    3: _read_words,
    4: _read_words,
    5: _write_bit,
    6: _write_word,
    DIAGNOSTICS: _echo,
    15: _write_bits,
    16: _write_words,
    SERVER_ID: _tell_server,
    MASK_WRITE: _mask_word,
    23: _exchange,
    ENCAPSULATED: _identify,
}
"""Function that answers each permitted request, by the number of the Modbus function."""
