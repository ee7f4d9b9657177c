"""The CANopen node on a bus: canopen's own RemoteNode against it, then a PLC in another process's cell."""

import queue
import socket
import subprocess
import sys
import threading
from contextlib import closing

import canopen
import pytest

from cell.records.journal import Journal
from drivers.errors import CellError, FaultCode
from drivers.transport.can_bus import CanBus
from plc_bridge.bridge import Bridge
from plc_bridge.canopen.node import ANYBODY
from plc_bridge.canopen.objects import dictionary
from plc_bridge.config import CanConfig, ModbusConfig, PlcConfig
from plc_bridge.peer import CellSilentError
from plc_bridge.protocol.messages import UNNUMBERED, Command, Control, LeaseState, Refusal, Report, Result
from plc_bridge.protocol.registers import Parameter, table
from skills.catalogue import CATALOGUE
from tests.can_peer import CanPeer, SdoRefusedError
from tests.scan_thread import take

NODE, PLC, PROGRAM = 16, 1, 100
PATIENCE = 10.0
PARAMETERS = (Parameter("search.speed", "m/s", 1e-4, 0.001, 0.5, "peak speed"),)
GROUP = "239.74.163.2"


@pytest.fixture
def config(request):
    return CanConfig(interface="virtual", channel=request.node.name, node_id=NODE, plc_node=PLC, plc_timeout=60.0)


@pytest.fixture
def bridge(config):
    plc = PlcConfig(life_timeout=60.0, lease_timeout=60.0, modbus=ModbusConfig(port=0), can=config)
    bridge = Bridge(plc, {PROGRAM: "insert_peg"}, PARAMETERS)
    bridge.start()
    yield bridge
    bridge.close()


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


def test_canopen_starts_the_node_and_sees_its_heartbeat(remote):
    remote.wait_for_state(127)
    remote.start()
    remote.node.nmt.state = "STOPPED"
    remote.wait_for_state(4)


def test_canopen_reads_the_mapping_over_the_bus(remote):
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


@pytest.mark.parametrize(("raw", "code"), [(9, 0x06090032), (5001, 0x06090031)])
def test_canopen_is_told_which_limit_a_parameter_breaks(remote, raw, code):
    with pytest.raises(canopen.SdoAbortedError) as caught:
        remote.node.sdo["command"]["command_parameter_1"].raw = raw
    assert caught.value.code == code


def test_canopen_hears_a_fault(bridge, remote):
    bridge.publish(Report(fault=FaultCode.ARM_REFLEX, run=7))
    error = remote.errors.get(timeout=PATIENCE)
    assert (error.code, int.from_bytes(error.data[:2], "little")) == (0xFF02, FaultCode.ARM_REFLEX)
    assert error.get_desc() == "Device Specific"


def test_a_bus_that_fails_is_rebuilt_and_serves_again(monkeypatch, bridge, remote):
    """The first frames after the cut meet a bus whose every call raises; python-can's notifier would have died."""
    remote.wait_for_state(127)
    broken = threading.Event()

    def fail(*_):
        broken.set()
        raise OSError("cut")

    node_bus = next(s for s in bridge._servers if hasattr(s, "step"))._bus._bus
    monkeypatch.setattr(node_bus, "recv", fail)
    monkeypatch.setattr(node_bus, "send", fail)
    assert broken.wait(PATIENCE)
    error = remote.errors.get(timeout=PATIENCE)
    assert error.code == 0x8140
    assert bridge.diagnostics.dropped == 1
    assert remote.node.sdo[0x1000].raw == 0


# Our own PLC.


@pytest.fixture
def served(bridge):
    """A bridge whose commands all succeed at the second look; returns the commands it got."""
    got, stop = [], threading.Event()

    def scan():
        report = Report(state=4)
        while not stop.wait(0.002):
            command = take(bridge)
            if command is not None:
                got.append(command)
                if command.code == PROGRAM:
                    bridge.publish(Report(sequence=command.sequence, state=6))
                    report = Report(
                        command.sequence, 17, Result.SUCCESS, run=len(got), stage_times=(0.5,), total_time=2
                    )
            bridge.publish(report)

    thread = threading.Thread(target=scan)
    thread.start()
    yield got
    stop.set()
    thread.join()


@pytest.fixture
def peer(served, config):
    with closing(CanPeer(config, period=0.002, timeout=PATIENCE)) as peer:
        peer.connect()
        yield peer


def test_the_plc_runs_a_command_and_reads_everything_of_it(peer, served):
    report = peer.run(PROGRAM, 3, "SN-4711-long enough for segments", [(0, 500)], timeout=PATIENCE)
    assert (report.result, report.code, report.lease, report.holder) == (
        Result.SUCCESS,
        PROGRAM,
        LeaseState.YOURS,
        f"node {PLC}",
    )
    assert (report.stage_times[0], report.total_time) == (0.5, 2.0)
    assert (served[0].serial, served[0].recipe) == ("SN-4711-long enough for segments", 3)
    assert served[0].parameters == (("search.speed", pytest.approx(0.05)),)


def test_fifty_commands_run_fifty_times(peer, served):
    results = [peer.run(PROGRAM, timeout=PATIENCE).result for _ in range(50)]
    assert results == [Result.SUCCESS] * 50
    assert [command.code for command in served].count(PROGRAM) == 50


def test_a_plc_that_comes_back_goes_on_from_the_last_number(served, config):
    for _ in range(2):
        with closing(CanPeer(config, period=0.002, timeout=PATIENCE)) as peer:
            peer.connect()
            assert peer.run(PROGRAM, timeout=PATIENCE).result == Result.SUCCESS
    assert [command.code for command in served].count(PROGRAM) == 2


def test_the_plc_learns_at_once_that_a_value_is_beyond_its_limits(peer):
    with pytest.raises(SdoRefusedError, match="written too high"):
        peer.trigger(PROGRAM, parameters=[(0, 5001)])


def test_the_lease_is_taken_and_released_over_can(peer, bridge):
    assert peer.take()
    assert bridge.holder == f"node {PLC}"
    peer.release()
    assert bridge.holder == ""


def test_who_holds_the_lease_elsewhere_is_said_over_can(peer, bridge):
    bridge.take("terminal")
    assert not peer.take()
    assert peer.trigger(PROGRAM).refusal == Refusal.NOT_HOLDER
    assert peer.read_report().holder == "terminal"


def test_the_plc_stops_the_cell_by_the_stop_object(bridge, config):
    with closing(CanPeer(config, timeout=PATIENCE)) as peer:
        peer.connect()
        peer.stop()
        assert next_command(bridge) == Command(UNNUMBERED, Control.STOP, source=ANYBODY)


def test_a_silent_cell_is_said_in_one_line(config):
    with (
        closing(CanPeer(config, timeout=0.1)) as peer,
        pytest.raises(CellError, match=r"^CANopen node 16[^\n]*no report"),
    ):
        peer.connect()


# A whole cell, from another process.


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_a_run_in_another_process_stops_when_the_heartbeat_of_the_plc_ends(tmp_path):
    config = CanConfig(interface="udp_multicast", channel=f"{GROUP}:{free_port()}")
    bus = CanBus(config.interface, config.channel, config.bitrate)
    try:
        bus.open()
    except CellError as error:
        pytest.skip(f"no multicast on this computer: {error}")
    bus.close()
    sets = ["plc.modbus.port=0", 'plc.can.interface="udp_multicast"', f'plc.can.channel="{config.channel}"']
    sets += ["plc.life_timeout=60.0", "plc.can.plc_timeout=60.0"]  # a busy computer makes a late PLC
    command = [sys.executable, "-m", "cell", "serve", "--journal", str(tmp_path)]
    command += [word for text in sets for word in ("--set", text)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            process.stdout.readline()
            with closing(CanPeer(config, timeout=PATIENCE)) as peer:
                peer.connect()
                peer.trigger(CATALOGUE["insert_peg"].code, serial="SN 1")
                while peer.cycle().stage == 0:
                    pass
                peer.end_heartbeat()
                peer._node.sdo[0x1016][1].raw = config.plc_node << 16 | 200  # from the next beat on
                peer._wire.send_message(0x700 + config.plc_node, b"\x05")
                with pytest.raises(CellSilentError, match="PRE-OPERATIONAL"):
                    peer.wait_for_result(PATIENCE)
                peer.close()
                peer.resume()
                report = peer.wait_for_result(PATIENCE)
            assert (report.result, report.fault) == (Result.FAULT, FaultCode.PLC_LOST)
            process.terminate()
            process.wait(PATIENCE)
        finally:
            process.kill()
    with Journal(tmp_path) as journal:
        row = journal.find(1)
    assert (row.source, row.serial, row.outcome, row.fault) == ("node 1", "SN 1", "fault", FaultCode.PLC_LOST)
