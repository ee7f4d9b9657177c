"""The Modbus RTU server on a pseudo terminal, byte by byte and with a client that is not ours."""

import shutil
import subprocess

import pytest

from drivers.errors import DeviceNotOpenedError
from drivers.transport.serial_line import SerialLine
from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig, RtuConfig
from plc_bridge.modbus.rtu_frames import with_check_sum
from plc_bridge.protocol.messages import Command, Control, Report, Result
from plc_bridge.protocol.registers import DISCRETE_INPUTS, VERSION, table
from tests.cable import Cable
from tests.scan_thread import take

PROGRAM, UNIT = 100, 17
AT = {register.name: register.address for register in table()}
TABLES = {"coil": "0", "discrete": "1", "input": "3", "holding": "4"}
PATIENCE = 10.0


def start(port):
    rtu = RtuConfig(port=port, unit=UNIT, parity="none")  # a pseudo terminal may refuse parity
    patient = PlcConfig(life_timeout=60.0, lease_timeout=60.0, modbus=ModbusConfig(port=0), rtu=rtu)
    bridge = Bridge(patient, {PROGRAM: "insert_peg"})
    bridge.start()
    return bridge


@pytest.fixture
def cable():
    with Cable() as cable:
        yield cable


@pytest.fixture
def bridge(cable):
    bridge = start(cable.ends[0])
    yield bridge
    bridge.close()


@pytest.fixture
def client(cable):
    line = SerialLine(cable.ends[1], 19200)
    line.open()
    yield line
    line.close()


def receive(client, size):
    data = b""
    while len(data) < size:
        more = client.read(PATIENCE)
        assert more, f"silent after {data.hex(' ')}"
        data += more
    return data


def test_bytes_on_the_wire_are_those_of_the_standard(bridge, client):
    client.write(bytes.fromhex("11 04 0001 0001 629A"))
    assert receive(client, 7) == with_check_sum(bytes.fromhex("11 04 02") + VERSION.to_bytes(2, "big"))


def test_line_hears_again_after_hostile_bytes(bridge, client):
    for hostile in (b"\x00" * 300, b"\x11\x10\x00\x00\x00\x7b\xf6", with_check_sum(b"\x11\x04\x00\x01")[:-1] + b"\x00"):
        client.write(hostile)
        client.write(with_check_sum(bytes.fromhex("11 04 0001 0001")))
        assert receive(client, 7)[:3] == bytes.fromhex("11 04 02")
    assert bridge.diagnostics.bad_frames >= 3


def test_port_that_is_missing_is_said_in_one_line_and_leaves_nothing_open():
    with pytest.raises(DeviceNotOpenedError, match=r"^serial port /dev/ttyNONE: no such port[^\n]*$"):
        start("/dev/ttyNONE")


def test_port_in_use_is_said_in_one_line(bridge, cable):
    with pytest.raises(DeviceNotOpenedError, match="in use by another program"):
        SerialLine(cable.ends[0], 19200).open()


def mbpoll(cable, unit, kind, address, *more):
    options = ["-m", "rtu", "-b", "19200", "-P", "none", "-a", str(unit), "-o", "0.5"]
    options += ["-0", "-1", "-q", "-t", TABLES[kind], "-r", str(address)]
    done = subprocess.run(
        ["mbpoll", *options, cable.ends[1], *more], capture_output=True, text=True, timeout=30, check=False
    )
    return done.returncode, done.stdout + done.stderr


def write(cable, kind, address, *values):
    status, said = mbpoll(cable, UNIT, kind, address, *map(str, values))
    assert status == 0, said


def read(cable, kind, address, count=1):
    status, said = mbpoll(cable, UNIT, kind, address, "-c", str(count))
    assert status == 0, said
    return [int(line.split("\t")[1]) for line in said.splitlines() if line.startswith("[")]


with_mbpoll = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed (Debian: mbpoll)")


@with_mbpoll
def test_mbpoll_drives_a_command_from_sequence_to_acknowledge(bridge, cable):
    write(cable, "holding", AT["command_life"], 1, 41, 0)
    write(cable, "holding", AT["command_life"], 2, 42, PROGRAM, 3)
    assert read(cable, "discrete", DISCRETE_INPUTS["busy"]) == [1]
    command = take(bridge)
    assert command is not None
    assert (command.sequence, command.code, command.recipe) == (42, PROGRAM, 3)
    assert command.source.startswith("rtu:")
    bridge.publish(Report(sequence=42, state=6))
    bridge.publish(Report(sequence=42, state=17, result=Result.SUCCESS, run=70_000))
    assert read(cable, "input", AT["report_sequence"], 4) == [42, 42, 0, Result.SUCCESS]
    write(cable, "holding", AT["command_acknowledge"], 42)
    assert read(cable, "input", AT["report_result"]) == [Result.NONE]


@with_mbpoll
def test_mbpoll_gets_no_answer_of_another_unit_and_exceptions_of_this_one(bridge, cable):
    status, said = mbpoll(cable, UNIT + 1, "holding", 0)
    assert (status, "timed out" in said) == (1, True)
    status, said = mbpoll(cable, UNIT, "holding", AT["command_life_tail"] + 1, "1")
    assert (status, "Illegal data address" in said) == (1, True)


@with_mbpoll
def test_mbpoll_stops_the_cell(bridge, cable):
    write(cable, "coil", AT["stop"], 1)
    command = take(bridge)
    assert isinstance(command, Command)
    assert command.code == Control.STOP


def test_a_line_that_cannot_have_the_parity_is_refused_at_start():
    with Cable() as cable:
        rtu = RtuConfig(port=cable.ends[0])
        bridge = Bridge(PlcConfig(modbus=ModbusConfig(port=0), rtu=rtu), {100: "insert_peg"})
        with pytest.raises(DeviceNotOpenedError, match=rf"^serial port {cable.ends[0]}: [^\n]*parity[^\n]*$"):
            bridge.start()
