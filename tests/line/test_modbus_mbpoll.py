"""A Modbus client that is not ours drives a command through the handshake; it opens a connection for every request."""

import shutil
import subprocess

import pytest

from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.protocol.messages import Command, Control, Report, Result
from plc_bridge.protocol.registers import COILS, DISCRETE_INPUTS, VERSION, Lease, table
from tests.scan_thread import take

pytestmark = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed (Debian: mbpoll)")

PROGRAM = 100
AT = {register.name: register.address for register in table()}
TABLES = {"coil": "0", "discrete": "1", "input": "3", "holding": "4"}


@pytest.fixture
def bridge():
    patient = PlcConfig(life_timeout=60.0, lease_timeout=60.0, modbus=ModbusConfig(port=0))
    bridge = Bridge(patient, {PROGRAM: "insert_peg"})
    bridge.start()
    yield bridge
    bridge.close()


def mbpoll(bridge, kind, address, *more):
    port = bridge.address[1]
    options = ["-m", "tcp", "-p", str(port), "-0", "-1", "-q", "-t", TABLES[kind], "-r", str(address)]
    done = subprocess.run(["mbpoll", *options, *more], capture_output=True, text=True, timeout=30, check=False)
    return done.returncode, done.stdout + done.stderr


def write(bridge, kind, address, *values):
    status, said = mbpoll(bridge, kind, address, bridge.address[0], *map(str, values))
    assert status == 0, said


def read(bridge, kind, address, count=1):
    status, said = mbpoll(bridge, kind, address, "-c", str(count), bridge.address[0])
    assert status == 0, said
    return [int(line.split("\t")[1]) for line in said.splitlines() if line.startswith("[")]


def supervise(bridge):
    """Take one command and end it in success."""
    command = take(bridge)
    assert command is not None
    bridge.publish(Report(sequence=command.sequence, state=6))
    bridge.publish(Report(sequence=command.sequence, state=17, result=Result.SUCCESS, run=70_000))
    return command


def test_registers_are_read_and_written(bridge):
    write(bridge, "holding", AT["command_life"], 1, 1, 0, 9, 0, Lease.TAKE_FOR_HOST)
    assert read(bridge, "holding", AT["command_life"], 6) == [1, 1, 0, 9, 0, Lease.TAKE_FOR_HOST]
    assert read(bridge, "input", AT["report_version"]) == [VERSION]


def test_writes_outside_the_command_block_are_refused(bridge):
    status, said = mbpoll(bridge, "holding", AT["command_life_tail"] + 1, bridge.address[0], "1")
    assert (status, "Illegal data address" in said) == (1, True)


def test_command_is_driven_from_sequence_to_acknowledge(bridge):
    write(bridge, "holding", AT["command_life"], 1, 41, 0, 0, 0, Lease.TAKE_FOR_HOST)
    write(bridge, "holding", AT["command_life"], 2, 42, PROGRAM, 3)
    assert read(bridge, "discrete", DISCRETE_INPUTS["busy"]) == [1]
    assert supervise(bridge) == Command(42, PROGRAM, 3, source="127.0.0.1")
    sequence, answered, refusal, result = read(bridge, "input", AT["report_sequence"], 4)
    assert (sequence, answered, refusal, result) == (42, 42, 0, Result.SUCCESS)
    assert read(bridge, "input", AT["report_run"], 2) == [1, 70_000 - 65_536]
    write(bridge, "holding", AT["command_acknowledge"], 42)
    assert read(bridge, "input", AT["report_result"]) == [Result.NONE]


def test_coil_stops(bridge):
    write(bridge, "coil", COILS["stop"], 1)
    command = take(bridge)
    assert command is not None
    assert command.code == Control.STOP
