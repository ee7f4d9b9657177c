"""CAN buses and serial lines: opened or refused with a remedy, read, written and lost."""

import errno
import os
import socket
import time

import can
import pytest
import serial

from drivers.errors import DeviceNotOpenedError
from drivers.transport.can_bus import MOST_ERRORS, CanBus
from drivers.transport.serial_line import SerialLine
from drivers.transport.wires import CanFrame, CanLostError, LineLostError


class FakeBus:
    """Bus that python-can would open; receives scripted frames."""

    def __init__(self, **settings):
        self.settings = settings
        self.incoming = []
        self.fails = False

    def recv(self, timeout):
        if self.fails:
            raise can.CanOperationError("network\nis down")
        found = self.incoming.pop(0) if self.incoming else None
        if isinstance(found, Exception):
            raise found
        return found

    def send(self, message, timeout):
        if self.fails:
            raise can.CanOperationError("Transmit buffer full")

    def shutdown(self):
        if self.fails:
            raise OSError("gone")


@pytest.fixture
def fake(monkeypatch):
    made = []

    def make(**settings):
        made.append(FakeBus(**settings))
        return made[-1]

    monkeypatch.setattr(can, "Bus", make)
    monkeypatch.setattr(socket, "create_connection", lambda *place: socket.socket())
    return made


@pytest.mark.parametrize(
    ("interface", "channel", "expected"),
    [
        ("socketcan", "can0", {"channel": "can0"}),
        ("slcan", "/dev/ttyACM0", {"channel": "/dev/ttyACM0", "bitrate": 125_000}),
        ("virtual", "any", {"channel": "any"}),
        ("udp_multicast", "239.1.2.3", {"channel": "239.1.2.3", "port": 43113, "hop_limit": 0, "fd": False}),
        ("udp_multicast", "239.1.2.3:5000", {"channel": "239.1.2.3", "port": 5000, "hop_limit": 0, "fd": False}),
        ("socketcand", "plc/can0", {"channel": "can0", "host": "plc", "port": 29536, "tcp_tune": True}),
        ("socketcand", "plc:5000/can0", {"channel": "can0", "host": "plc", "port": 5000, "tcp_tune": True}),
    ],
)
def test_each_interface_gets_its_own_settings_and_no_others(fake, interface, channel, expected):
    CanBus(interface, channel, 125_000).open()
    assert fake[0].settings == {"interface": interface, "ignore_config": True, **expected}


@pytest.mark.parametrize(
    ("interface", "channel", "said"),
    [
        ("socketcand", "can0", '"HOST:PORT/can0"'),
        ("socketcand", "host:99999/can0", "1 to 65535"),
        ("udp_multicast", "239.1.2.3:x", "1 to 65535"),
        ("socketcan", "no-such-can", ""),
        ("slcan", "/dev/no-such-port", ""),
        ("udp_multicast", "127.0.0.1", "Invalid argument"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_named_in_one_line(interface, channel, said):
    with pytest.raises(DeviceNotOpenedError, match=rf"^CAN bus {interface} {channel}: [^\n]*{said}[^\n]*$"):
        CanBus(interface, channel, 125_000).open()


def test_a_socketcand_server_that_is_not_there_is_not_waited_for():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DeviceNotOpenedError, match="refused"):
        CanBus("socketcand", f"127.0.0.1:{port}/can0", 125_000).open()


@pytest.fixture
def bus(fake):
    made = CanBus("socketcan", "can0", 125_000)
    made.open()
    return made


def message(number, data=b"", **kind):
    return can.Message(arbitration_id=number, data=data, is_extended_id=False, **kind)


@pytest.mark.parametrize(
    ("other", "bad"),
    [
        (message(1, is_remote_frame=True), 0),
        (message(1, is_fd=True), 0),
        (can.Message(is_error_frame=True), 1),
        (ValueError("noise"), 1),
    ],
    ids=["remote", "CAN FD", "error frame", "error"],
)
def test_other_frames_hide_nothing_behind_them_and_errors_are_counted(fake, bus, other, bad):
    fake[0].incoming = [other, message(2)] * 3
    got = [bus.read(0.0) for _ in range(6)]
    assert got.count(CanFrame(2)) == 3
    assert bus.bad_frames == 3 * bad


def test_single_frames_that_cannot_be_sent_are_counted_and_borne(fake, bus):
    for is_full in (True, True, False) * 5:
        fake[0].fails = is_full
        bus.write(CanFrame(1))
    assert bus.bad_frames == 10


@pytest.mark.parametrize(
    ("use", "words"),
    [
        (lambda bus: bus.read(0.0), "[^\n]+$"),
        (lambda bus: bus.write(CanFrame(1)), r"[^\n]*nobody acknowledges[^\n]*bit rate[^\n]*$"),
    ],
    ids=["read", "write"],
)
def test_errors_in_a_row_are_a_lost_bus(fake, bus, use, words):
    fake[0].fails = True
    for _ in range(MOST_ERRORS - 1):
        use(bus)
    with pytest.raises(CanLostError, match=f"^CAN bus socketcan can0: {words}"):
        use(bus)


def test_a_bus_that_is_gone_can_be_closed_and_opened_again(fake, bus):
    fake[0].fails = True
    bus.close()
    bus.close()
    with pytest.raises(CanLostError, match="not open"):
        bus.read(0.0)
    bus.open()
    assert len(fake) == 2
    bus.write(CanFrame(1))


@pytest.mark.parametrize(
    ("code", "told"),
    [
        (errno.EAFNOSUPPORT, "modprobe can_raw"),
        (errno.ENODEV, "no such network interface"),
        (errno.ENETDOWN, "ip link set"),
        (errno.ENOMEM, "Cannot allocate memory"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_named_with_its_remedy(monkeypatch, code, told):
    def refuse(**settings):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(DeviceNotOpenedError, match=told):
        CanBus("socketcan", "can7", 1_000_000).open()


def test_echoes_of_a_multicast_are_left_out_once_each(fake):
    bus = CanBus("udp_multicast", "239.74.163.2", 125_000)
    bus.open()
    for data in (b"a", b"b"):
        bus.write(CanFrame(1, data))
    fake[0].incoming = [message(1, data) for data in (b"a", b"x", b"b", b"a")]
    assert [bus.read(0.0) for _ in range(3)] == [CanFrame(1, b"x"), CanFrame(1, b"a"), None]


STAMPED = [("socketcan", 0.5, 0.5), ("udp_multicast", 0.5, 0.5)]
NOT_STAMPED = [("socketcan", -0.5, 0.0), ("socketcan", 1e6, 0.0), ("socketcand", 0.5, 0.0)]


@pytest.mark.parametrize(("interface", "age", "waited"), STAMPED + NOT_STAMPED)
def test_a_frame_has_its_waiting_time_if_this_computer_stamped_it(fake, interface, age, waited):
    bus = CanBus(interface, "239.74.163.2" if interface == "udp_multicast" else "host/can0", 125_000)
    bus.open()
    fake[0].incoming = [message(1, timestamp=time.time() - age)]
    assert bus.read(0.0).waited == pytest.approx(waited, abs=0.2)


@pytest.mark.parametrize(
    ("parity", "stop_bits", "bits"), [("none", 1, 10), ("even", 1, 11), ("odd", 1, 11), ("none", 2, 11)]
)
def test_character_takes_all_its_bits(parity, stop_bits, bits):
    assert SerialLine("-", 9600, parity, stop_bits).character_time == pytest.approx(bits / 9600)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (serial.SerialException(errno.ENOENT, "could not open"), "no such port"),
        (serial.SerialException(errno.EACCES, "could not open"), "not permitted"),
        (serial.SerialException(errno.EAGAIN, "could not lock"), "in use by another program"),
        (OSError(errno.EINVAL, "Invalid argument"), "does not know this baud rate, parity"),
        (ValueError("odd\nthing"), "odd thing"),
    ],
)
def test_a_port_that_cannot_be_opened_is_named_with_its_cause(monkeypatch, error, said):
    def refuse(*args, **settings):
        raise error

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(DeviceNotOpenedError, match=rf"^serial port COM7: [^\n]*{said}[^\n]*$"):
        SerialLine("COM7", 9600).open()


def test_line_that_was_never_opened_is_lost():
    line = SerialLine("COM7", 9600)
    line.close()
    with pytest.raises(LineLostError, match="COM7: not open"):
        line.read(0.0)
    with pytest.raises(LineLostError, match="COM7: not open"):
        line.write(b"")
