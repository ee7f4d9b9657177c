"""The CANopen node on a bus: canopen's own RemoteNode against it."""

import queue
import threading
from contextlib import closing

import canopen
import pytest

from drivers.errors import CellError, FaultCode
from plc_bridge.bridge import Bridge
from plc_bridge.canopen.objects import dictionary
from plc_bridge.config import CanConfig, ModbusConfig, PlcConfig
from plc_bridge.protocol.messages import Command, Report, Result
from plc_bridge.protocol.registers import Parameter, table
from tests.can_peer import CanPeer
from tests.scan_thread import take

NODE, PLC, PROGRAM = 16, 1, 100
PATIENCE = 10.0
PARAMETERS = (Parameter("search.speed", "m/s", 1e-4, 0.001, 0.5, "peak speed"),)


@pytest.fixture
def config(request):
    return CanConfig(interface="virtual", channel=request.node.name, node_id=NODE, plc_node=PLC, plc_timeout=60.0)


@pytest.fixture
def bridge(config):
    plc = PlcConfig(life_timeout=60.0, lease_timeout=60.0, modbus=ModbusConfig(port=0), can=config)
    with closing(Bridge(plc, {PROGRAM: "insert_peg"}, PARAMETERS)) as bridge:
        bridge.start()
        yield bridge


class Remote:
    """canopen's view of the node, on python-can's own notifier."""

    def __init__(self, config):
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = 0.05
        self.network.connect(interface=config.interface, channel=config.channel)
        objects = dictionary(table({PROGRAM: "insert_peg"}, PARAMETERS), NODE)
        self.node = self.network.add_node(canopen.RemoteNode(NODE, objects))
        self.node.sdo.RESPONSE_TIMEOUT = PATIENCE
        self.states, self.errors, self.reports = queue.Queue(), queue.Queue(), queue.Queue()
        self.node.nmt.add_heartbeat_callback(self.states.put)
        self.node.emcy.add_callback(self.errors.put)
        self.node.tpdo.read()  # over the bus, by SDO
        self.node.rpdo.read()
        self.node.tpdo[1].add_callback(lambda pdo: self.reports.put([variable.raw for variable in pdo]))

    def close(self):
        self.network.disconnect()

    def wait_for_state(self, state):
        while self.states.get(timeout=PATIENCE) != state:
            pass

    def wait_for_report(self, report):
        while self.reports.get(timeout=PATIENCE) != report:
            pass

    def start(self):
        self.node.nmt.state = "OPERATIONAL"
        self.wait_for_state(5)

    def command(self, life, sequence, code=0, recipe=0):
        values = (life, sequence, code, recipe)
        for variable, value in zip(self.node.rpdo[1], values, strict=True):
            variable.raw = value
        self.node.rpdo[1].transmit()


@pytest.fixture
def remote(bridge, config):
    with closing(Remote(config)) as remote:
        yield remote


def next_command(bridge):
    """Return the next command; the bus has a thread of its own."""
    for _ in range(int(PATIENCE / 0.01)):
        command = take(bridge)
        if command is not None:
            return command
        threading.Event().wait(0.01)
    raise AssertionError("no command came")


def test_canopen_starts_the_node_sees_its_heartbeat_and_reads_the_mapping(remote):
    remote.wait_for_state(127)
    remote.start()
    remote.node.nmt.state = "STOPPED"
    remote.wait_for_state(4)
    names = [variable.name for variable in remote.node.rpdo[1]]
    assert names == [f"command.command_{name}" for name in ("life", "sequence", "code", "recipe")]
    assert remote.node.tpdo[1].cob_id == 0x180 + NODE


def test_canopen_commands_by_pdo_and_reads_the_answer(bridge, remote):
    remote.node.sdo["command"]["command_serial"].raw = "SN 0815"
    remote.start()
    remote.command(1, 1)
    remote.wait_for_report([1, 1, 0, 0])
    remote.command(2, 2, PROGRAM, 3)
    assert next_command(bridge) == Command(2, PROGRAM, 3, "SN 0815", source=f"node {PLC}")
    bridge.publish(Report(sequence=2, state=17, result=Result.SUCCESS, run=9))
    remote.wait_for_report([2, 2, Result.SUCCESS, 0])
    assert remote.node.sdo["report"]["report_holder"].raw == f"node {PLC}"


def test_canopen_hears_a_fault(bridge, remote):
    bridge.publish(Report(fault=FaultCode.ARM_REFLEX, run=7))
    error = remote.errors.get(timeout=PATIENCE)
    assert (error.code, int.from_bytes(error.data[:2], "little")) == (0xFF02, FaultCode.ARM_REFLEX)
    assert error.get_desc() == "Device Specific"


def test_a_silent_cell_is_said_in_one_line(config):
    with (
        closing(CanPeer(config, timeout=0.1)) as peer,
        pytest.raises(CellError, match=r"^CANopen node 16[^\n]*no report"),
    ):
        peer.connect()
