import errno

import pytest
import serial

from drivers.errors import DeviceNotOpenedError
from drivers.transport.serial_line import SerialLine
from drivers.transport.wires import LineLostError


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
def test_why_a_port_cannot_be_opened_is_said_in_one_line(monkeypatch, error, said):
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
