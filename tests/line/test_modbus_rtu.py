"""The Modbus RTU server on a pseudo terminal, and mbpoll on it and on Modbus TCP; `test_hostile_frames.py` has its bytes."""

from contextlib import closing

import pytest

from drivers.errors import DeviceNotOpenedError
from drivers.transport.serial_line import SerialLine
from plc_bridge.bridge import Bridge
from plc_bridge.config import RtuConfig
from plc_bridge.protocol.messages import Control, Report, Result
from plc_bridge.protocol.registers import DISCRETE_INPUTS, Lease, table
from tests import mbpoll
from tests.hubs import Cable
from tests.plc_lines import patient
from tests.scan_thread import take

PROGRAM, UNIT = 100, 17
AT = {register.name: register.address for register in table()}


def start(port, **settings):
    rtu = RtuConfig(**{"port": port, "unit": UNIT, "parity": "none", **settings})
    bridge = Bridge(patient(rtu=rtu), {PROGRAM: "insert_peg"})
    bridge.start()
    return bridge


@pytest.fixture
def cable():
    with Cable() as cable:
        yield cable


@pytest.fixture
def bridge(cable):
    with closing(start(cable.ends[0])) as bridge:
        yield bridge


def test_a_port_missing_or_in_use_is_reported_in_one_line(bridge, cable):
    with pytest.raises(DeviceNotOpenedError, match=r"^serial port /dev/ttyNONE: no such port[^\n]*$"):
        start("/dev/ttyNONE")
    with pytest.raises(DeviceNotOpenedError, match="in use by another program"):
        SerialLine(cable.ends[0], 19200).open()


def test_a_line_that_cannot_have_the_parity_is_refused_at_start(cable):
    with pytest.raises(DeviceNotOpenedError, match=rf"^serial port {cable.ends[0]}: [^\n]*parity[^\n]*$"):
        start(cable.ends[0], parity="even")


def on_the_line(cable, unit=UNIT):
    return mbpoll.Mbpoll("-m", "rtu", "-b", "19200", "-P", "none", "-a", str(unit), "-o", "0.5", cable.ends[1])


@pytest.fixture(params=["tcp", "rtu"])
def poll(request, bridge, cable):
    return mbpoll.Mbpoll.tcp(bridge.address) if request.param == "tcp" else on_the_line(cable)


@mbpoll.needed
def test_mbpoll_drives_a_command_from_sequence_to_acknowledge(bridge, poll):
    poll.write("holding", AT["command_life"], 1, 41, 0, 0, 0, Lease.TAKE_FOR_HOST)
    assert poll.read("holding", AT["command_life"], 6) == [1, 41, 0, 0, 0, Lease.TAKE_FOR_HOST]
    poll.write("holding", AT["command_life"], 2, 42, PROGRAM, 3)
    assert poll.read("discrete", DISCRETE_INPUTS["busy"]) == [1]
    command = take(bridge)
    assert (command.sequence, command.code, command.recipe) == (42, PROGRAM, 3)
    assert command.source.startswith(("127.0.0.1", "rtu:"))
    bridge.publish(Report(sequence=42, state=6))
    bridge.publish(Report(sequence=42, state=17, result=Result.SUCCESS, run=70_000))
    assert poll.read("input", AT["report_sequence"], 4) == [42, 42, 0, Result.SUCCESS]
    assert poll.read("input", AT["report_run"], 2) == [1, 70_000 - 65_536]
    poll.write("holding", AT["command_acknowledge"], 42)
    assert poll.read("input", AT["report_result"]) == [Result.NONE]


@mbpoll.needed
def test_mbpoll_stops_the_cell_and_is_refused_outside_the_command_block(bridge, poll):
    status, said = poll.said("holding", AT["command_life_tail"] + 1, values=[1])
    assert (status, "Illegal data address" in said) == (1, True)
    poll.write("coil", AT["stop"], 1)
    assert take(bridge).code == Control.STOP


@mbpoll.needed
def test_mbpoll_gets_no_answer_of_another_unit(bridge, cable):
    status, said = on_the_line(cable, UNIT + 1).said("holding", 0, "-c", "1")
    assert (status, "timed out" in said) == (1, True)
