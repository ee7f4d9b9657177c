"""One cell and one PLC over every CAN interface of the config; hubs of the tests replace kernel support."""

import socket
import time
from contextlib import closing
from types import SimpleNamespace

import can.interfaces.slcan
import pytest

from drivers.errors import CellError
from drivers.transport.can_bus import MOST_ERRORS, CanBus
from drivers.transport.wires import CanFrame, CanLostError
from plc_bridge.config import CanConfig
from plc_bridge.protocol.messages import Result
from tests.can_peer import CanPeer
from tests.hubs import SlcanHub, SocketcandHub
from tests.plc_lines import patient
from tests.quick_cell import CODE, quick_cell

PATIENT = {"plc_timeout": 60.0}  # a busy computer makes a late PLC
PATIENCE = 10.0  # s


@pytest.fixture(autouse=True)
def hub_that_is_ready_at_once(monkeypatch):
    """Spare the two seconds that a serial adapter needs after its port opens."""
    monkeypatch.setattr(can.interfaces.slcan, "time", SimpleNamespace(sleep=lambda seconds: None, time=time.time))


@pytest.fixture
def two_ends(request):
    """Two configs, the cell's and the PLC's, of one bus of the interface that the test names."""
    interface = request.param
    if interface == "slcan":
        with closing(SlcanHub()) as hub:
            yield [CanConfig(interface=interface, channel=end, **PATIENT) for end in hub.ends]
    elif interface == "socketcand":
        with closing(SocketcandHub()) as hub:
            yield [CanConfig(interface=interface, channel=f"127.0.0.1:{hub.port}/can0", **PATIENT)] * 2
    elif interface == "udp_multicast":
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        yield [or_skip(CanConfig(interface=interface, channel=f"239.74.163.2:{port}", **PATIENT))] * 2
    elif interface == "socketcan":
        yield [or_skip(CanConfig(interface=interface, channel="vcan0", **PATIENT))] * 2
    else:
        yield [CanConfig(interface=interface, channel=request.node.name, **PATIENT)] * 2


def opened(config):
    bus = CanBus(config.interface, config.channel, config.bitrate)
    bus.open()
    return bus


def or_skip(config):
    try:
        opened(config).close()
    except CellError as error:
        pytest.skip(str(error))
    return config


def served(loaded, folder, config):
    """Serve a cell on CAN whose program ends at once."""
    return quick_cell(loaded, patient(can=config), folder)


@pytest.mark.parametrize("two_ends", ["virtual", "udp_multicast", "socketcand", "slcan", "socketcan"], indirect=True)
def test_frames_with_29_bit_identifiers_and_commands_pass_over_every_interface(two_ends, loaded, tmp_path):
    here, there = two_ends
    with closing(opened(here)) as bus, closing(opened(there)) as other:
        for sent in (CanFrame(0x17FFFFFF, b"out", is_extended=True), CanFrame(0x5FF, b"on")):
            bus.write(sent)
            assert other.read(PATIENCE) == sent
    with served(loaded, tmp_path, here) as cell, closing(CanPeer(there, period=0.002, timeout=PATIENCE)) as peer:
        peer.connect()
        runs = [peer.run(CODE, serial=f"SN {n:029}", timeout=PATIENCE).run for n in range(1, 11)]
        assert [cell.record(run).serial for run in runs] == [f"SN {n:029}" for n in range(1, 11)]


def test_a_socketcand_server_may_go_and_come_back(loaded, tmp_path):
    hub = SocketcandHub()
    config = CanConfig(interface="socketcand", channel=f"127.0.0.1:{hub.port}/can0", **PATIENT)
    with served(loaded, tmp_path, config) as cell:
        hub.close()
        hub = SocketcandHub(hub.port)
        with closing(hub), closing(CanPeer(config, period=0.002, timeout=PATIENCE)) as peer:
            peer.connect()
            assert peer.run(CODE, timeout=PATIENCE).result == Result.SUCCESS
        assert cell.bridge.diagnostics.dropped >= 1


def test_noise_on_a_serial_adapter_is_no_lost_bus():
    with closing(SlcanHub()) as hub:
        here, there = (CanConfig(interface="slcan", channel=end, bitrate=250_000) for end in hub.ends)
        with closing(opened(here)) as bus, closing(opened(there)) as other:
            hub.say(0, b"t1234zz\r")
            other.write(CanFrame(0x123, b"good"))
            got = [frame for frame in (bus.read(PATIENCE) for _ in range(2)) if frame]
            assert (got, bus.bad_frames) == ([CanFrame(0x123, b"good")], 1)


def test_an_adapter_that_is_pulled_is_a_lost_bus():
    hub = SlcanHub()
    bus = opened(CanConfig(interface="slcan", channel=hub.ends[0], bitrate=250_000))
    hub.close()
    for _ in range(MOST_ERRORS - 1):
        bus.read(0.0)
    with closing(bus), pytest.raises(CanLostError):
        bus.read(0.0)
