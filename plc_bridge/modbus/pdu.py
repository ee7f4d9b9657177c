"""One Modbus request in, one response out: strict about every length, count and value, with pymodbus's codec.

The code is the same for every framing; the `Station` gives the words their meaning.
"""

import struct
from collections.abc import Sequence
from typing import Protocol

from pymodbus.constants import ExcCodes
from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.bit_message import (
    ReadCoilsResponse,
    ReadDiscreteInputsResponse,
    WriteMultipleCoilsRequest,
    WriteMultipleCoilsResponse,
    WriteSingleCoilResponse,
)
from pymodbus.pdu.exceptionresponse import ExceptionResponse
from pymodbus.pdu.register_message import (
    MaskWriteRegisterResponse,
    ReadHoldingRegistersResponse,
    ReadInputRegistersResponse,
    ReadWriteMultipleRegistersRequest,
    ReadWriteMultipleRegistersResponse,
    WriteMultipleRegistersRequest,
    WriteMultipleRegistersResponse,
    WriteSingleRegisterResponse,
)

from plc_bridge.modbus.identity import DEVICE_IDENTIFICATION, RETURN_QUERY_DATA, device_identification, server_id

MOST_BITS_READ, MOST_BITS_WRITTEN = 2000, 1968  # Modbus Application Protocol V1.1b3, 6.1, 6.11
MOST_WORDS_READ, MOST_WORDS_WRITTEN, MOST_WORDS_EXCHANGED = 125, 123, 121  # the same, 6.3, 6.12, 6.17
COIL_ON, COIL_OFF = 0xFF00, 0x0000

DIAGNOSTICS, SERVER_ID, MASK_WRITE, ENCAPSULATED = 8, 17, 22, 43  # the same, 6.8, 6.13, 6.16, 6.21

_FIXED_LENGTH = {1: 5, 2: 5, 3: 5, 4: 5, 5: 5, 6: 5, SERVER_ID: 1, MASK_WRITE: 7, ENCAPSULATED: 4}
_HEAD_LENGTH = {15: 6, 16: 6, 23: 10}
"""Number of bytes before the data, the last of which is the number of data bytes."""


class Station(Protocol):
    """The registers and bits behind the requests, for one client.

    Unmapped addresses raise LookupError, accesses beyond the client's rights PermissionError, and values that are never
    permitted ValueError.
    """

    def read_words(self, function: int, address: int, count: int) -> list[int]:
        """Return holding registers (3) or input registers (4)."""

    def read_bits(self, function: int, address: int, count: int) -> list[bool]:
        """Return coils (1) or discrete inputs (2)."""

    def write_words(self, address: int, words: Sequence[int]) -> None:
        """Write holding registers, all or none."""

    def write_bits(self, address: int, bits: Sequence[bool]) -> None:
        """Write coils, all or none."""

    def mask_word(self, address: int, kept: int, added: int) -> None:
        """Write a holding register through two masks: bits in `kept` stay, the others come from `added`."""

    def is_running(self) -> bool:
        """Return True if the cell scans."""


class _IllegalError(Exception):
    """A request that cannot be served, with its Modbus exception."""

    def __init__(self, code: ExcCodes) -> None:
        super().__init__(code)
        self.code = code


def respond(request: bytes, station: Station) -> bytes:
    """Return the response PDU to a request PDU of at least one byte; no client input makes it raise."""
    function = request[0]
    try:
        _check_length(request)
        if function in (DIAGNOSTICS, SERVER_ID, ENCAPSULATED):
            return bytes([function]) + _tell(function, request[1:], station)
        response = _serve(function, request[1:], station)
    except _IllegalError as illegal:
        response = ExceptionResponse(function & 0x7F, illegal.code)
    except PermissionError:  # Modbus/TCP Security, R-31
        response = ExceptionResponse(function & 0x7F, ExcCodes.ILLEGAL_FUNCTION)
    except ValueError:
        response = ExceptionResponse(function & 0x7F, ExcCodes.ILLEGAL_VALUE)
    except LookupError:
        response = ExceptionResponse(function & 0x7F, ExcCodes.ILLEGAL_ADDRESS)
    return bytes([response.function_code]) + response.encode()


def is_exception(response: bytes) -> bool:
    """Return True if the response is an exception."""
    return response[0] >= 0x80


def _check_length(request: bytes) -> None:
    function = request[0]
    if function in _FIXED_LENGTH:
        is_whole = len(request) == _FIXED_LENGTH[function]
    elif function in _HEAD_LENGTH:
        head = _HEAD_LENGTH[function]
        is_whole = len(request) > head and len(request) == head + request[head - 1]
    elif function == DIAGNOSTICS:
        is_whole = len(request) >= 5 and len(request) % 2 == 1
    else:
        raise _IllegalError(ExcCodes.ILLEGAL_FUNCTION)
    if not is_whole:
        raise _IllegalError(ExcCodes.ILLEGAL_VALUE)


def _check_count(count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise _IllegalError(ExcCodes.ILLEGAL_VALUE)


def _tell(function: int, body: bytes, station: Station) -> bytes:
    """Return the body of an answer about the device itself."""
    is_running = station.is_running()  # a client that may not read is refused here
    if function == SERVER_ID:
        return server_id(is_running)
    if function == DIAGNOSTICS:
        if int.from_bytes(body[:2], "big") != RETURN_QUERY_DATA:
            raise _IllegalError(ExcCodes.ILLEGAL_FUNCTION)
        return body
    kind, code, number = body
    if kind != DEVICE_IDENTIFICATION:
        raise _IllegalError(ExcCodes.ILLEGAL_FUNCTION)
    return device_identification(code, number)


def _serve(function: int, body: bytes, station: Station) -> ModbusPDU:
    address, value = struct.unpack(">HH", body[:4])
    match function:
        case 1 | 2:
            _check_count(value, MOST_BITS_READ)
            bits = station.read_bits(function, address, value)
            return ReadCoilsResponse(bits=bits) if function == 1 else ReadDiscreteInputsResponse(bits=bits)
        case 3 | 4:
            _check_count(value, MOST_WORDS_READ)
            words = station.read_words(function, address, value)
            if function == 3:
                return ReadHoldingRegistersResponse(registers=words)
            return ReadInputRegistersResponse(registers=words)
        case 5:
            if value not in (COIL_ON, COIL_OFF):
                raise _IllegalError(ExcCodes.ILLEGAL_VALUE)
            station.write_bits(address, [value == COIL_ON])
            return WriteSingleCoilResponse(address=address, bits=[value == COIL_ON])
        case 6:
            station.write_words(address, [value])
            return WriteSingleRegisterResponse(address=address, registers=[value])
        case 15:
            return _write_coils(body, station)
        case 16:
            return _write_registers(body, station)
        case 22:  # MASK_WRITE
            (added,) = struct.unpack(">H", body[4:])
            station.mask_word(address, value, added)
            return MaskWriteRegisterResponse(address=address, and_mask=value, or_mask=added)
        case _:
            return _exchange(body, station)


def _write_coils(body: bytes, station: Station) -> ModbusPDU:
    count, size = struct.unpack(">HB", body[2:5])
    _check_count(count, MOST_BITS_WRITTEN)
    if size != (count + 7) // 8:
        raise _IllegalError(ExcCodes.ILLEGAL_VALUE)
    request = WriteMultipleCoilsRequest()
    request.decode(body)
    station.write_bits(request.address, request.bits)
    return WriteMultipleCoilsResponse(address=request.address, count=count)


def _write_registers(body: bytes, station: Station) -> ModbusPDU:
    count, size = struct.unpack(">HB", body[2:5])
    _check_count(count, MOST_WORDS_WRITTEN)
    if size != 2 * count:
        raise _IllegalError(ExcCodes.ILLEGAL_VALUE)
    request = WriteMultipleRegistersRequest()
    request.decode(body)
    station.write_words(request.address, request.registers)
    return WriteMultipleRegistersResponse(address=request.address, count=count)


def _exchange(body: bytes, station: Station) -> ModbusPDU:
    _, read_count, _, write_count, size = struct.unpack(">HHHHB", body[:9])
    _check_count(read_count, MOST_WORDS_READ)
    _check_count(write_count, MOST_WORDS_EXCHANGED)
    if size != 2 * write_count:
        raise _IllegalError(ExcCodes.ILLEGAL_VALUE)
    request = ReadWriteMultipleRegistersRequest()
    request.decode(body)
    station.read_words(3, request.read_address, read_count)  # an address error must come before the write
    station.write_words(request.write_address, request.write_registers)
    return ReadWriteMultipleRegistersResponse(registers=station.read_words(3, request.read_address, read_count))
