"""The identity of the device for Modbus clients: Modbus Application Protocol V1.1b3, 6.8, 6.13 and 6.21; pure.

Engineering tools request these functions first: Read Device Identification (function 43, MEI type 14), Report Server
ID (function 17), and an echo (function 8, sub-function 0).
"""

import struct
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

from plc_bridge.protocol.registers import DEVICE_NAME, VERSION_MAJOR, VERSION_MINOR

DEVICE_IDENTIFICATION = 14
"""MEI type of function 43; the server does not support type 13, CANopen, because CANopen has its own bus here."""
RETURN_QUERY_DATA = 0
"""The only sub-function of function 8 that the servers support, on TCP and on serial lines."""
_LAST_OF = {1: 0x02, 2: 0x7F, 3: 0x7F}
"""Last object of each stream, by read device ID code.

There are no extended objects; a request for the extended stream gets the regular objects (6.21).
"""
_PROGRAM = "tactile-insertion-cell"
_ON, _OFF = 0xFF, 0x00


def objects() -> Mapping[int, str]:
    """Return the objects of the identification by number: vendor, product code, revision, product and model name."""
    try:
        revision = version(_PROGRAM)
    except PackageNotFoundError:
        revision = "unknown"
    return {
        0x00: _PROGRAM,
        0x01: "cell",
        0x02: revision,
        0x04: DEVICE_NAME,
        0x05: f"register map {VERSION_MAJOR}.{VERSION_MINOR}",
    }


def device_identification(code: int, number: int) -> bytes:
    """Return the bytes after the function code in the response to Read Device Identification.

    Args:
        code: Read device ID code.
        number: First object, or the single requested object.

    Raises:
        LookupError: The single requested object does not exist.
        ValueError: The code does not exist.
    """
    known = objects()
    # Read device ID code 4 requests one object; codes 1 to 3 request a stream of basic, regular or extended objects.
    if code == 4:
        chosen = {number: known[number]}
    elif code in _LAST_OF:
        within = {each: text for each, text in known.items() if each <= _LAST_OF[code]}
        first = number if number in within else 0  # 6.21: if the object is unknown, the stream starts at object 0
        chosen = {each: text for each, text in within.items() if each >= first}
    else:
        raise ValueError(code)
    # 0x82 is the conformity level: regular identification, as a stream and by single objects.
    head = struct.pack("BBBBBB", DEVICE_IDENTIFICATION, code, 0x82, 0, 0, len(chosen))
    return head + b"".join(bytes([each, len(text)]) + text.encode("ascii") for each, text in chosen.items())


def server_id(is_running: bool) -> bytes:
    """Return the bytes after the function code in the response to Report Server ID: name, then run indicator.

    Args:
        is_running: True if the cell scans, so that it can execute commands.
    """
    told = _PROGRAM.encode("ascii") + bytes([_ON if is_running else _OFF])
    return bytes([len(told)]) + told
