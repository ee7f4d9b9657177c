"""The Modbus TCP server on real sockets: framing, order, limits, hostile clients; and the peer that talks to it.

Answers to single requests are those of `tests/line/test_hostile_frames.py`.
"""

import contextlib
import logging
import socket
import struct

import pytest
from pymodbus.client import ModbusTcpClient

from drivers.errors import DeviceNotOpenedError
from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.modbus.server import ModbusServer
from plc_bridge.peer import CellSilentError, Peer
from plc_bridge.protocol.messages import FIRST_PROGRAM, Report
from plc_bridge.protocol.registers import Lease
from tests.sockets import PATIENCE, answer, ask, frame, is_closed

READ_REPORT = bytes.fromhex("04 0000 000A")
READ_RECIPE = bytes.fromhex("03 0003 0001")
TAKE, SHARE, RELEASE = (struct.pack(">BHH", 6, 5, wish) for wish in (Lease.TAKE, Lease.TAKE_FOR_HOST, Lease.RELEASE))
STOP_ON = bytes.fromhex("05 0001 FF00")


def start(life_timeout=1.0, **settings):
    config = PlcConfig(life_timeout=life_timeout, modbus=ModbusConfig(port=0, **settings))
    bridge = Bridge(config, {FIRST_PROGRAM: "insert_peg"})
    bridge.start()
    return bridge


@pytest.fixture
def bridge():
    with contextlib.closing(start()) as bridge:
        yield bridge


def connect(bridge, address="127.0.0.1"):
    return socket.create_connection(bridge.address, timeout=PATIENCE, source_address=(address, 0))


def test_every_queued_request_is_answered_with_its_number_and_unit(bridge):
    count = 5000
    with connect(bridge) as client:
        client.sendall(b"".join(frame(bytes.fromhex("03 0000 0029"), n, unit=255) for n in range(count)))
        assert [answer(client)[:2] for _ in range(count)] == [(n, 255) for n in range(count)]


@pytest.mark.parametrize(("protocol", "length"), [(1, None), (0xFFFF, None), (0, 0), (0, 1), (0, 255), (0, 60000)])
def test_malformed_header_closes_the_connection_and_is_counted(bridge, protocol, length):
    with connect(bridge) as client:
        assert ask(client, READ_REPORT)[0] == 4
        client.sendall(frame(READ_REPORT, protocol=protocol, length=length))
        assert is_closed(client)
    assert bridge.diagnostics.malformed == 1


def test_an_exception_is_counted_always_and_logged_once(bridge, caplog):
    caplog.set_level(logging.WARNING)
    with connect(bridge) as client:
        ask(client, *3 * [struct.pack(">BHH", 6, 41, 1)])
        who = f"127.0.0.1:{client.getsockname()[1]}"
    told = [record.getMessage() for record in caplog.records if "refused" in record.getMessage()]
    assert told == [f"{who}: refused: function 6: exception 02"]
    assert bridge.diagnostics.exceptions == 3


def test_a_client_that_is_not_ours_reads_who_the_cell_is(bridge):
    bridge.publish(Report())
    host, port = bridge.address
    with ModbusTcpClient(host, port=port, timeout=PATIENCE) as client:
        told = client.read_device_information(read_code=2, object_id=0).information
        assert (told[0], told[4]) == (b"tactile-insertion-cell", b"tactile insertion cell")
        name = client.report_device_id()
        assert (name.identifier, name.status) == (b"tactile-insertion-cell", True)
        assert client.diag_query_data(b"\xa5\x37").message == b"\xa5\x37"
        client.write_register(3, 0x12)
        client.mask_write_register(address=3, and_mask=0xF2, or_mask=0x25)
        assert client.read_holding_registers(3, count=1).registers == [0x17]


@pytest.mark.parametrize(
    ("wishes", "recipe", "holder"), [([], 0, ""), ([SHARE], 7, "127.0.0.1"), ([SHARE, RELEASE], 0, "")]
)
def test_connections_of_a_host_share_a_command_block_on_request(bridge, wishes, recipe, holder):
    with connect(bridge) as one:
        ask(one, bytes.fromhex("06 0003 0007"), *wishes)
    with connect(bridge) as other:
        assert ask(other, READ_RECIPE) == struct.pack(">BBH", 3, 2, recipe)
        assert bridge.holder == holder


def test_a_connection_that_comes_to_share_the_block_changes_nothing_of_it(bridge):
    with connect(bridge) as late, connect(bridge) as one:
        ask(late, READ_REPORT)
        ask(one, bytes.fromhex("06 0003 0007"), SHARE)
        ask(late, SHARE)
        assert ask(late, READ_RECIPE) == bytes.fromhex("03 02 0007")


# Places.


@pytest.mark.parametrize(("claim", "says"), [(READ_REPORT, b""), (TAKE, READ_REPORT), (STOP_ON, READ_REPORT)])
@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2"])
def test_a_crowd_takes_no_place_of_an_active_client(claim, says, address):
    with contextlib.closing(start(connections=8)) as bridge, contextlib.ExitStack() as crowd:
        old = crowd.enter_context(connect(bridge))
        ask(old, claim)
        for _ in range(66):
            one = crowd.enter_context(connect(bridge, address))
            if says:
                ask(one, says)
        assert ask(old, READ_REPORT)[0] == 4
        assert ask(crowd.enter_context(connect(bridge, "127.0.0.3")), READ_REPORT)[0] == 4


def test_a_newcomer_is_turned_away_when_only_the_holder_could_leave():
    with contextlib.closing(start(connections=1)) as bridge, connect(bridge) as holder:
        ask(holder, TAKE)
        with connect(bridge) as newcomer:
            assert is_closed(newcomer)
        assert ask(holder, READ_REPORT)[0] == 4


def test_client_that_does_not_read_costs_no_more_than_its_buffers(bridge):
    with connect(bridge) as deaf, connect(bridge) as other:
        deaf.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            for n in range(200_000):
                deaf.sendall(frame(bytes.fromhex("03 0000 0029"), n % 0x10000))
        answered = -1
        while bridge.diagnostics.requests > answered + 1:  # until only the other's are answered
            answered = bridge.diagnostics.requests
            assert ask(other, READ_REPORT)[0] == 4
        assert answered < 20_000


def test_idle_connection_is_closed():
    with contextlib.closing(start(idle_timeout=0.05)) as bridge, connect(bridge) as client:
        client.sendall(frame(READ_REPORT)[:5])
        assert is_closed(client)


@pytest.mark.parametrize(("allowed", "accepted"), [("127.0.0.0/8", 1), ("10.0.0.0/8", 0)])
def test_only_addresses_that_are_allowed_are_served(allowed, accepted):
    bridge = start(allow=[allowed, "192.168.1.5"])
    with connect(bridge) as client, contextlib.suppress(OSError):
        ask(client, READ_REPORT)
    bridge.close()
    assert (bridge.diagnostics.accepted, bridge.diagnostics.forbidden) == (accepted, 1 - accepted)


# Start and end.


def test_a_port_that_cannot_be_opened_is_reported_in_one_line(bridge):
    port = bridge.address[1]
    for config, said in (
        (ModbusConfig(port=port), rf"^[^\n]*127.0.0.1 port {port} is in use[^\n]*$"),
        (ModbusConfig(host="192.0.2.1", port=0), r"^[^\n]*192\.0\.2\.1 port 0 is [^\n]*plc\.modbus\.host[^\n]*$"),
    ):
        with pytest.raises(DeviceNotOpenedError, match=said):
            Bridge(PlcConfig(modbus=config), {}).start()


def test_bridge_opens_again_after_it_was_closed(bridge):
    bridge.close()
    bridge.close()
    bridge.start()
    with connect(bridge) as client:
        assert ask(client, READ_REPORT)[0] == 4


def test_clients_that_come_while_the_server_closes_leave_no_error_behind(caplog):
    server = ModbusServer(ModbusConfig(port=0, connections=500), Bridge(PlcConfig(), {}))
    server.start()
    clients = []

    def arrive():
        """One client in every turn of the loop, so that one falls into each moment of the end."""
        with contextlib.suppress(OSError):
            clients.append(socket.create_connection(server.address, timeout=PATIENCE))
            server.loop.call_soon(arrive)

    server.loop.call_soon_threadsafe(arrive)
    server.close()
    for client in clients:
        client.close()
    assert [record.getMessage() for record in caplog.records if record.name == "asyncio"] == []


# The peer; `tests/line/test_plc_acceptance.py` runs commands with it.


def test_peer_names_the_address_that_does_not_answer():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(CellSilentError, match=f"127.0.0.1:{port}"):
        Peer("127.0.0.1", port).connect()


def test_peer_notices_a_closed_cell(bridge):
    with contextlib.closing(Peer(*bridge.address)) as peer:
        peer.connect()
        bridge.close()
        with pytest.raises(CellSilentError):
            peer.cycle()
        with pytest.raises(CellSilentError, match="connection is lost"):
            peer.wait_for_result(PATIENCE)


def test_peer_gives_up_after_its_time():
    times = iter(range(100))
    with (
        contextlib.closing(start(life_timeout=60.0)) as bridge,
        contextlib.closing(Peer(*bridge.address, wait=lambda period: None, now=lambda: float(next(times)))) as peer,
    ):
        peer.connect()
        peer.trigger(FIRST_PROGRAM)
        with pytest.raises(CellSilentError, match="no result of command"):
            peer.wait_for_result(timeout=5.0)
