"""Serial lines, as bytes in and out; the callers decode the bytes."""

import errno
from typing import Literal

import serial

from drivers.errors import DeviceNotOpenedError
from drivers.transport.wires import LineLostError, Parity

_PARITY = {"none": serial.PARITY_NONE, "even": serial.PARITY_EVEN, "odd": serial.PARITY_ODD}
_WRITE_TIMEOUT = 1.0
"""Longest wait of a write for the port, s."""


class SerialLine:
    """One serial port, 8 data bits, with no other user; not for use by several threads.

    Args:
        port: Name of the port in the operating system.
        baud_rate: Bit rate, bits/s.
        parity: Parity bit of every character.
        stop_bits: Number of stop bits, 1 or 2.
    """

    def __init__(self, port: str, baud_rate: int, parity: Parity = "none", stop_bits: Literal[1, 2] = 1) -> None:
        self.port = port
        self.character_time = (1 + 8 + (parity != "none") + stop_bits) / baud_rate
        """Transfer time of one character, s."""
        self._settings = {"baudrate": baud_rate, "parity": _PARITY[parity], "stopbits": stop_bits}
        self._serial: serial.Serial | None = None

    def open(self) -> None:
        """Open the port; no effect if it is open.

        Raises:
            DeviceNotOpenedError: The port is missing, not permitted, or in use.
        """
        if self._serial is not None:
            return
        try:
            self._serial = serial.Serial(self.port, exclusive=True, write_timeout=_WRITE_TIMEOUT, **self._settings)
            # a pseudo-terminal accepts an unsupported parity once, and refuses every later setting: fail here, not later
            self._serial.timeout = _WRITE_TIMEOUT
        except Exception as error:  # pyserial lets termios.error through, which derives from Exception alone
            self.close()
            raise DeviceNotOpenedError(f"serial port {self.port}: {_why(error)}") from error

    def close(self) -> None:
        """Close the port; may be called again."""
        if self._serial is not None:
            self._serial.close()
            self._serial = None

    def read(self, timeout: float) -> bytes:
        """Return the received bytes; wait up to `timeout`, s, for the first one, and return none if none arrived.

        Raises:
            LineLostError: The port is lost or was never opened.
        """
        port = self._opened()
        try:
            if port.timeout != timeout:
                port.timeout = timeout
            data: bytes = port.read(1)
            return data + port.read(port.in_waiting) if data else data
        except Exception as error:  # termios.error derives from Exception alone, a closed handle raises TypeError
            raise LineLostError(f"serial port {self.port}: {error}") from error

    def write(self, data: bytes) -> None:
        """Send `data`.

        Raises:
            LineLostError: The port is lost, was never opened, or accepts nothing.
        """
        port = self._opened()
        try:
            port.write(data)
        except (OSError, TypeError) as error:
            raise LineLostError(f"serial port {self.port}: {error}") from error

    def _opened(self) -> serial.Serial:
        if self._serial is None:
            raise LineLostError(f"serial port {self.port}: not open")
        return self._serial


def _why(error: Exception) -> str:
    code = getattr(error, "errno", None) or (error.args[0] if error.args else None)
    if code == errno.ENOENT:
        return "no such port: plug it in, or name another one"
    if code == errno.EACCES:
        return "not permitted: add this user to the group that owns it"
    if code in (errno.EAGAIN, errno.EBUSY) or "exclusively lock" in str(error):
        return "in use by another program: stop it"
    if code == errno.EINVAL:
        return "does not know this baud rate, parity or number of stop bits"
    return str(error).replace("\n", " ")
