"""CAN buses of every supported kind, as frames in and out; the callers decode the frames.

Data frames of classic CAN with identifiers of 11 and of 29 bits are passed on; other frames on the bus are ignored.
"""

import errno
import socket
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

import can

from drivers.errors import DeviceNotOpenedError
from drivers.transport.wires import CanFrame, CanLostError, Interface

MOST_ERRORS = 3
"""Number of errors in a row after which the bus counts as lost; one undecodable frame or one full buffer is tolerated."""
MOST_OTHERS = 1000
"""Largest number of ignored frames (echoes, errors, remote and FD frames) that one read skips."""
_SOCKETCAN_TROUBLE = {
    errno.EAFNOSUPPORT: "this computer's kernel has no CAN: load its modules (modprobe can_raw), or use another interface",
    errno.ENODEV: "no such network interface: plug the adapter in and load its driver, or name another channel",
    errno.ENOBUFS: "nobody acknowledges the frames: check supply, wires, a terminator at both ends, and the bit rate",
    errno.ENETDOWN: "the network interface is down: ip link set NAME up type can bitrate RATE",
}
_SOCKETCAND_PORT, _MULTICAST_PORT = 29536, 43113


class CanBus:
    """One bus with no other user in this process; not for use by several threads.

    Args:
        interface: Interface to the bus.
        channel: `socketcan`: network interface, "can0". `slcan`: serial port, "/dev/ttyACM0". `socketcand`:
            "HOST:PORT/can0", the port is optional. `udp_multicast`: group and port, "239.74.163.2:43113", the port
            is optional; frames never leave this computer. `virtual`: any name; frames never leave this process.
        bitrate: Bit rate, bits/s; it is used for `slcan` only, other interfaces are set up outside this program.
    """

    def __init__(self, interface: Interface, channel: str, bitrate: int) -> None:
        self.interface: Interface = interface
        self.name = f"{interface} {channel}"
        self.bad_frames = 0
        """Number of frames since the start that could not be decoded or sent."""
        self._channel, self._bitrate = channel, bitrate
        self._bus: can.BusABC | None = None
        self._read_errors = self._write_errors = 0
        self._echoes: deque[tuple[float, CanFrame]] = deque(maxlen=MOST_OTHERS)

    def open(self) -> None:
        """Open the bus; no effect if it is open.

        Raises:
            DeviceNotOpenedError: The interface or port is missing, not permitted, or in use.
        """
        if self._bus is not None:
            return
        try:
            self._bus = can.Bus(**self._settings(), ignore_config=True)
        except Exception as error:  # every interface has exceptions of its own
            raise DeviceNotOpenedError(f"CAN bus {self.name}: {self._why(error)}") from error
        self._read_errors = self._write_errors = 0
        self._echoes.clear()

    def close(self) -> None:
        """Close the bus; may be called again."""
        bus, self._bus = self._bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except Exception:  # a lost bus cannot be shut down properly
                self.bad_frames += 1

    def read(self, timeout: float) -> CanFrame | None:
        """Return the next frame; None if none arrived within `timeout`, s, or only ignored frames did.

        Raises:
            CanLostError: The bus is lost or was never opened.
        """
        bus, end = self._opened(), time.monotonic() + timeout
        # The caller reads until it gets None, so an ignored frame must not return None.
        for _ in range(MOST_OTHERS):
            try:
                message = bus.recv(max(end - time.monotonic(), 0.0))
            except Exception as error:  # every interface has exceptions of its own
                self._read_errors = self._count(error, self._read_errors)
                return None
            self._read_errors = 0
            if message is None:
                return None
            if message.is_error_frame:
                self.bad_frames += 1
            elif not (message.is_remote_frame or message.is_fd):
                waited = self._waited(message.timestamp)
                frame = CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id, waited)
                if not self._is_echo(frame):
                    return frame
        return None

    def write(self, frame: CanFrame) -> None:
        """Send one frame; if a single frame cannot be sent, it is dropped and counted.

        Raises:
            CanLostError: The bus is lost, was never opened, or has accepted nothing for several frames.
        """
        bus = self._opened()
        message = can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=frame.is_extended)
        try:
            # Longest wait of one frame for the adapter, s.
            bus.send(message, 0.1)
            self._write_errors = 0
            if self.interface == "udp_multicast":
                self._echoes.append((time.monotonic(), frame))
        except Exception as error:  # every interface has exceptions of its own
            self._write_errors = self._count(error, self._write_errors)

    def _waited(self, stamp: float) -> float:
        """Return the time since the kernel's stamp of a frame, s; 0 on interfaces without kernel stamps."""
        waited = time.time() - stamp if self.interface in ("socketcan", "udp_multicast") else 0.0
        # Longest plausible wait of a frame, s; if it is longer, the computer's clock was set.
        return waited if 0.0 < waited < 10.0 else 0.0

    def _is_echo(self, frame: CanFrame) -> bool:
        """Return True if a frame is the echo of an own frame, as in network multicast; echoes arrive in order."""
        # Time after which an own frame without an echo counts as lost, s.
        while self._echoes and self._echoes[0][0] < time.monotonic() - 1.0:
            self._echoes.popleft()
        for place, (_, sent) in enumerate(self._echoes):
            if sent == frame:
                for _ in range(place + 1):
                    self._echoes.popleft()
                return True
        return False

    def _count(self, error: Exception, before: int) -> int:
        self.bad_frames += 1
        if before + 1 >= MOST_ERRORS:
            raise CanLostError(f"CAN bus {self.name}: {self._why(error)}") from error
        return before + 1

    def _why(self, error: Exception) -> str:
        """Return the error, with its remedy if one is known."""
        code = getattr(error, "errno", None) or getattr(error, "error_code", None)
        if self.interface == "socketcan" and code in _SOCKETCAN_TROUBLE:
            return _SOCKETCAN_TROUBLE[code]
        if self.interface == "socketcan" and "Transmit buffer full" in str(error):
            return _SOCKETCAN_TROUBLE[errno.ENOBUFS]
        return _one_line(error)

    def _opened(self) -> can.BusABC:
        if self._bus is None:
            raise CanLostError(f"CAN bus {self.name}: not open")
        return self._bus

    def _settings(self) -> Mapping[str, Any]:
        settings: dict[str, Any] = {"interface": self.interface, "channel": self._channel}
        if self.interface == "slcan":
            settings["bitrate"] = self._bitrate
        elif self.interface == "udp_multicast":
            group, port = _with_port(self._channel, _MULTICAST_PORT)
            settings.update(channel=group, port=port, hop_limit=0, fd=False)
        elif self.interface == "socketcand":
            place, slash, channel = self._channel.rpartition("/")
            host, port = _with_port(place, _SOCKETCAND_PORT)
            if not slash or not host or not channel:
                raise ValueError('"HOST:PORT/can0" or "HOST/can0" allowed')
            # python-can itself would retry for ten seconds in a busy loop
            # Longest wait for a socketcand server, s.
            socket.create_connection((host, port), 1.0).close()
            settings.update(channel=channel, host=host, port=port, tcp_tune=True)
        return settings


def _with_port(text: str, default: int) -> tuple[str, int]:
    """Return host and port of `HOST` or `HOST:PORT`."""
    host, colon, port = text.partition(":")
    if not colon:
        return host, default
    if not port.isdecimal() or not 0 < int(port) < 65536:
        raise ValueError(f'port "{port}": 1 to 65535 allowed')
    return host, int(port)


def _one_line(error: Exception) -> str:
    said = " ".join(str(error).split()) or type(error).__name__
    cause = " ".join(str(error.__cause__ or "").split())
    return said if cause in said else f"{said}: {cause}"
