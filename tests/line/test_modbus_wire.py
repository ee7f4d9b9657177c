"""The Modbus TCP server on real sockets: framing, order, limits, hostile clients."""

import asyncio
import contextlib
import logging
import socket
import struct
import time

import pytest
from pymodbus.client import ModbusTcpClient

from drivers.errors import DeviceNotOpenedError
from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.modbus.server import ModbusServer
from plc_bridge.peer import CellSilentError, Peer
from plc_bridge.protocol.images import REPORT
from plc_bridge.protocol.messages import FIRST_PROGRAM, Control, LeaseState, Refusal, Report, Result
from plc_bridge.protocol.peer_log import LINES
from plc_bridge.protocol.registers import MIRROR, Lease
from tests.scan_thread import take
from tests.sockets import receive

HEADER = struct.Struct(">HHHB")
READ_REPORT = bytes.fromhex("04 0000 000A")
PATIENCE = 10.0


def start(**settings):
    bridge = Bridge(PlcConfig(modbus=ModbusConfig(port=0, **settings)), {FIRST_PROGRAM: "insert_peg"})
    bridge.start()
    return bridge


@pytest.fixture
def bridge():
    bridge = start()
    yield bridge
    bridge.close()


def connect(bridge):
    return socket.create_connection(bridge.address, timeout=PATIENCE)


def frame(pdu, transaction=1, protocol=0, length=None, unit=1):
    return HEADER.pack(transaction, protocol, len(pdu) + 1 if length is None else length, unit) + pdu


def answer(client):
    transaction, protocol, length, unit = HEADER.unpack(receive(client, HEADER.size))
    assert protocol == 0
    return transaction, unit, receive(client, length - 1)


def ask(client, pdu, transaction=1):
    client.sendall(frame(pdu, transaction))
    return answer(client)[2]


def is_closed(client):
    try:
        return client.recv(1) == b""
    except ConnectionResetError:
        return True


def wait_for(is_met):
    deadline = time.monotonic() + PATIENCE
    while not is_met():
        assert time.monotonic() < deadline


class FakeSupervisor:
    """Ends every program in the scan after it began, with the result that is set."""

    def __init__(self, bridge):
        self.bridge, self.result, self.report, self.commands = bridge, Result.SUCCESS, Report(state=4), []

    def scan(self, period=0.0):
        if self.report.state == 6 and self.result is not Result.NONE:
            self.report = Report(sequence=self.report.sequence, state=17, result=self.result, run=1)
        command = take(self.bridge)
        if command is not None:
            self.commands.append(command)
            if command.code >= FIRST_PROGRAM and command.code < Control.LOST:
                self.report = Report(sequence=command.sequence, state=6)
            elif self.report.state == 6 and command.code in (Control.STOP, Control.ABORT):
                self.report = Report(sequence=self.report.sequence, state=2, result=Result.ABORTED)
            elif command.code == Control.RESET:
                self.report = Report(sequence=command.sequence, state=4, result=Result.SUCCESS)
        self.bridge.publish(self.report)


@pytest.fixture
def supervisor(bridge):
    return FakeSupervisor(bridge)


@pytest.fixture
def peer(bridge, supervisor):
    peer = Peer(*bridge.address, wait=supervisor.scan)
    peer.connect()
    yield peer
    peer.close()


def test_pipelined_requests_are_all_answered_in_order_with_their_own_numbers(bridge):
    with connect(bridge) as client:
        client.sendall(b"".join(frame(READ_REPORT, n) for n in range(300)))
        assert [answer(client)[0] for _ in range(300)] == list(range(300))


def test_client_that_sends_much_before_it_reads_gets_every_answer(bridge):
    count = 5000
    with connect(bridge) as client:
        client.sendall(b"".join(frame(bytes.fromhex("03 0000 0029"), n) for n in range(count)))
        assert [answer(client)[0] for _ in range(count)] == list(range(count))


def test_frame_may_come_byte_by_byte(bridge):
    with connect(bridge) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in frame(READ_REPORT, 7):
            client.sendall(bytes([byte]))
        assert answer(client)[0] == 7


def test_unit_is_echoed(bridge):
    with connect(bridge) as client:
        client.sendall(frame(READ_REPORT, unit=255))
        assert answer(client)[1] == 255


@pytest.mark.parametrize(
    ("request_", "response"),
    [
        ("03 0000 0000", "83 03"),
        ("04 0000 007E", "84 03"),
        ("2B 0D 01 00", "AB 01"),
        ("16 0005 0000 0004", "96 03"),
        ("05 0000 1234", "85 03"),
        ("03 0029 0001", "83 02"),
        ("04 004B 0001", "84 02"),
        ("04 007E 0001", "84 02"),
        ("01 0003 0001", "81 02"),
        ("02 0005 0001", "82 02"),
        ("06 0005 0004", "86 03"),
        ("10 0004 0002 04 0000 FFFF", "90 03"),
    ],
)
def test_illegal_request_gets_its_exception_and_the_connection_stays(bridge, request_, response):
    with connect(bridge) as client:
        assert ask(client, bytes.fromhex(request_)) == bytes.fromhex(response)
        assert ask(client, READ_REPORT)[0] == 4


def test_exception_is_counted_each_time_and_logged_once_with_who_and_why(bridge, caplog):
    caplog.set_level(logging.WARNING)
    with connect(bridge) as client:
        for _ in range(3):
            ask(client, struct.pack(">BHH", 6, 41, 1))
        who = f"127.0.0.1:{client.getsockname()[1]}"
    told = [record.getMessage() for record in caplog.records if "refused" in record.getMessage()]
    assert told == [f"{who}: refused: function 6: exception 02"]
    assert bridge.diagnostics.exceptions == 3


def test_a_client_that_is_not_ours_reads_who_the_cell_is(bridge, supervisor):
    supervisor.scan()
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


def test_a_cell_that_is_not_scanned_does_not_say_that_it_runs(bridge):
    with connect(bridge) as client:
        assert ask(client, b"\x11")[-1] == 0


@pytest.mark.parametrize("address", [41, 100, MIRROR, MIRROR + 5, 0xFFFF])
def test_writes_outside_the_command_block_are_refused(bridge, address):
    with connect(bridge) as client:
        assert ask(client, struct.pack(">BHH", 6, address, 1)) == b"\x86\x02"


def test_write_that_begins_in_the_command_block_and_ends_outside_changes_nothing(bridge):
    with connect(bridge) as client:
        assert ask(client, bytes.fromhex("10 0027 0003 06 0001 0002 0003")) == b"\x90\x02"
        assert ask(client, bytes.fromhex("03 0027 0002")) == bytes.fromhex("03 04 0000 0000")


@pytest.mark.parametrize(("protocol", "length"), [(1, None), (0xFFFF, None), (0, 0), (0, 1), (0, 255), (0, 60000)])
def test_malformed_header_closes_the_connection_and_is_counted(bridge, protocol, length):
    with connect(bridge) as client:
        client.sendall(frame(READ_REPORT, protocol=protocol, length=length))
        assert is_closed(client)
    assert bridge.diagnostics.malformed == 1


def test_requests_before_a_malformed_one_are_answered(bridge):
    with connect(bridge) as client:
        client.sendall(frame(READ_REPORT, 1) + frame(READ_REPORT, 2))
        assert [answer(client)[0], answer(client)[0]] == [1, 2]
        client.sendall(frame(READ_REPORT, 3, protocol=9))
        assert is_closed(client)


def test_report_can_be_read_as_holding_registers(bridge, supervisor):
    supervisor.scan()
    with connect(bridge) as client:
        as_input = ask(client, struct.pack(">BHH", 4, 0, REPORT.words))
        as_holding = ask(client, struct.pack(">BHH", 3, MIRROR, REPORT.words))
    assert as_input[1:] == as_holding[1:]


def test_every_connection_has_its_own_command_block(bridge):
    with connect(bridge) as one, connect(bridge) as other:
        ask(one, bytes.fromhex("06 0003 0007"))
        assert ask(other, bytes.fromhex("03 0003 0001")) == bytes.fromhex("03 02 0000")


def test_connections_of_a_host_that_asks_for_it_share_one_command_block(bridge):
    with connect(bridge) as one:
        ask(one, bytes.fromhex("10 0001 0005 0A 0001 0000 0000 0000 0002"))
    with connect(bridge) as other:
        ask(other, struct.pack(">BHHBHH", 16, 1, 2, 4, 2, FIRST_PROGRAM))
    command = bridge.poll()
    assert (command.code, command.source, bridge.holder) == (FIRST_PROGRAM, "127.0.0.1", "127.0.0.1")


def test_host_that_released_its_lease_shares_no_more(bridge):
    with connect(bridge) as one:
        ask(one, bytes.fromhex("10 0001 0005 0A 0001 0000 0007 0000 0002"))
        ask(one, bytes.fromhex("06 0005 0003"))
    with connect(bridge) as other:
        assert ask(other, bytes.fromhex("03 0003 0001")) == bytes.fromhex("03 02 0000")


SHARE, STOP_ON = struct.pack(">BHH", 6, 5, Lease.TAKE_FOR_HOST), bytes.fromhex("05 0001 FF00")


def test_a_connection_that_comes_to_share_the_block_changes_no_more_of_it_than_it_writes(bridge, supervisor):
    with connect(bridge) as late, connect(bridge) as one:
        ask(late, READ_REPORT)
        ask(one, bytes.fromhex("10 0001 0005 0A 03E7 0000 0000 0000 0002"))
        order = struct.pack(">BHHBHH", 16, 1, 2, 4, 1000, FIRST_PROGRAM)
        ask(one, order)
        while not supervisor.commands or supervisor.report.result is Result.NONE:
            supervisor.scan()
        ask(late, SHARE)
        assert ask(late, bytes.fromhex("03 0001 0002")) == struct.pack(">BBHH", 3, 4, 1000, FIRST_PROGRAM)
        ask(one, order)
        supervisor.scan()
        assert [command.code for command in supervisor.commands] == [FIRST_PROGRAM]


def test_a_stop_goes_with_its_connection_into_the_shared_block_and_falls_with_it(bridge):
    with connect(bridge) as one, connect(bridge) as other:
        ask(one, STOP_ON)
        ask(one, SHARE)
        ask(other, SHARE)
        assert ask(one, bytes.fromhex("01 0001 0001")) == bytes.fromhex("01 01 01")
        assert ask(other, bytes.fromhex("01 0001 0001")) == bytes.fromhex("01 01 00")
        assert bridge.diagnostics.stops_held == 1
    wait_for(lambda: not bridge.diagnostics.stops_held)
    assert (bridge.holder, bridge.diagnostics.connections) == ("127.0.0.1", 0)


def test_a_connection_that_holds_a_stop_is_not_asked_to_leave_while_there_are_others():
    bridge = start(connections=2)
    with connect(bridge) as stopping, contextlib.ExitStack() as crowd:
        ask(stopping, STOP_ON)
        for _ in range(5):
            ask(crowd.enter_context(connect_from("127.0.0.2", bridge.address)), READ_REPORT)
            assert bridge.diagnostics.stops_held == 1
    bridge.close()


def test_newcomer_gets_the_place_of_the_one_that_was_idle_longest():
    bridge = start(connections=2)
    with connect(bridge) as idle, connect(bridge) as busy:
        ask(idle, READ_REPORT)
        ask(busy, READ_REPORT)
        with connect(bridge) as newcomer:
            assert ask(newcomer, READ_REPORT)[0] == 4
            assert is_closed(idle)
            assert ask(busy, READ_REPORT)[0] == 4
    bridge.close()
    assert bridge.diagnostics.dropped == 1


def connect_from(address, to):
    return socket.create_connection(to, timeout=PATIENCE, source_address=(address, 0))


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2"])
def test_many_silent_connections_do_not_take_the_place_of_one_that_spoke(address):
    bridge = start(connections=8)
    with connect(bridge) as old, contextlib.ExitStack() as crowd:
        ask(old, READ_REPORT)
        for _ in range(66):
            crowd.enter_context(connect_from(address, bridge.address))
        assert ask(old, READ_REPORT)[0] == 4
        with connect_from("127.0.0.3", bridge.address) as newcomer:
            assert ask(newcomer, READ_REPORT)[0] == 4
    bridge.close()


@pytest.mark.parametrize("says", [b"", READ_REPORT])
@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2"])
def test_an_old_connection_answers_beside_300_idle_ones(says, address):
    bridge = start()
    with connect(bridge) as old, contextlib.ExitStack() as crowd:
        assert ask(old, READ_REPORT)[0] == 4
        for n in range(300):
            if says and n % 20 == 0:  # of those who speak the one that is idle longest leaves
                assert ask(old, READ_REPORT)[0] == 4
            idle = crowd.enter_context(connect_from(address, bridge.address))
            if says:
                ask(idle, says)
        assert ask(old, READ_REPORT)[0] == 4
    bridge.close()


def test_the_holder_of_the_lease_is_not_evicted_even_when_it_was_idle_longest():
    bridge = start(connections=2)
    with connect(bridge) as holder, contextlib.ExitStack() as crowd:
        ask(holder, struct.pack(">BHH", 6, 5, Lease.TAKE))
        for _ in range(5):
            other = crowd.enter_context(connect_from("127.0.0.2", bridge.address))
            ask(other, READ_REPORT)
        assert ask(holder, READ_REPORT)[0] == 4
    bridge.close()


def test_a_newcomer_is_turned_away_when_only_the_holder_could_leave():
    bridge = start(connections=1)
    with connect(bridge) as holder:
        ask(holder, struct.pack(">BHH", 6, 5, Lease.TAKE))
        with connect(bridge) as newcomer:
            assert is_closed(newcomer)
        assert ask(holder, READ_REPORT)[0] == 4
    bridge.close()


def test_a_host_beyond_its_places_takes_none_of_another():
    bridge = start(connections=8, connections_per_host=2)
    with connect(bridge) as other, contextlib.ExitStack() as crowd:
        ask(other, READ_REPORT)
        mine = [crowd.enter_context(connect_from("127.0.0.2", bridge.address)) for _ in range(3)]
        ask(mine[2], READ_REPORT)
        assert is_closed(mine[0])
        assert bridge.diagnostics.connections == 3
        assert ask(other, READ_REPORT)[0] == 4
    bridge.close()


def test_lines_in_the_log_about_one_host_are_bounded(bridge, caplog):
    caplog.set_level(logging.INFO)
    for _ in range(100):
        with connect_from("127.0.0.2", bridge.address) as client:
            client.sendall(frame(READ_REPORT, protocol=9))
            assert is_closed(client)
    assert len([record for record in caplog.records if "127.0.0.2" in record.getMessage()]) == LINES + 1


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
    bridge = start(idle_timeout=0.05)
    with connect(bridge) as client:
        client.sendall(frame(READ_REPORT)[:5])
        assert is_closed(client)
    bridge.close()


def test_address_that_is_not_allowed_is_turned_away():
    bridge = start(allow=["10.0.0.0/8", "192.168.1.5"])
    with connect(bridge) as client:
        assert is_closed(client)
    bridge.close()
    assert (bridge.diagnostics.forbidden, bridge.diagnostics.accepted) == (1, 0)


def test_allowed_address_is_served():
    bridge = start(allow=["127.0.0.0/8"])
    with connect(bridge) as client:
        assert ask(client, READ_REPORT)[0] == 4
    bridge.close()


def test_port_in_use_is_said_in_one_line(bridge):
    second = Bridge(PlcConfig(modbus=ModbusConfig(port=bridge.address[1])), {})
    with pytest.raises(DeviceNotOpenedError, match=rf"^[^\n]*127.0.0.1 port {bridge.address[1]} is in use[^\n]*$"):
        second.start()
    second.close()


def test_address_of_another_computer_is_said_in_one_line():
    with pytest.raises(DeviceNotOpenedError, match=r"192\.0\.2\.1 port 0 is .*plc\.modbus\.host"):
        Bridge(PlcConfig(modbus=ModbusConfig(host="192.0.2.1", port=0)), {}).start()


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


def test_twenty_clients_at_once_lose_nothing(bridge):
    async def one(number):
        reader, writer = await asyncio.open_connection(*bridge.address)
        for n in range(100):
            writer.write(frame(struct.pack(">BHHBHH", 16, 8, 2, 4, number, n), n))
            writer.write(frame(struct.pack(">BHH", 3, 8, 2), 1000 + n))
            written = await reader.readexactly(12)
            read = await reader.readexactly(13)
            assert HEADER.unpack_from(written)[0] == n
            assert HEADER.unpack_from(read)[0] == 1000 + n
            assert struct.unpack(">HH", read[9:]) == (number, n)
        writer.close()
        await writer.wait_closed()

    async def everybody():
        await asyncio.wait_for(asyncio.gather(*(one(number) for number in range(20))), PATIENCE)

    asyncio.run(everybody())
    assert bridge.diagnostics.requests == 20 * 100 * 2


def test_peer_drives_a_command_to_its_result(peer, supervisor):
    report = peer.run(FIRST_PROGRAM, 3, "PEG-1", timeout=PATIENCE)
    assert (report.result, report.run, report.refusal) == (Result.SUCCESS, 1, Refusal.NONE)
    command = supervisor.commands[0]
    assert (command.code, command.recipe, command.serial) == (FIRST_PROGRAM, 3, "PEG-1")
    assert peer.read_report().result == Result.NONE


def test_fifty_triggers_are_fifty_runs(peer, supervisor):
    results = [peer.run(FIRST_PROGRAM, timeout=PATIENCE).result for _ in range(50)]
    assert results == [Result.SUCCESS] * 50
    assert sum(command.code == FIRST_PROGRAM for command in supervisor.commands) == 50


def test_peer_waits_for_the_end_of_a_control_that_it_sent_in_the_middle_of_a_run(peer, supervisor):
    supervisor.result = Result.NONE
    run = peer.trigger(FIRST_PROGRAM)
    report = peer.run(Control.RESET, timeout=PATIENCE)
    assert (report.sequence, report.result) == (run.sequence + 1, Result.SUCCESS)
    assert peer.read_report().sequence == run.sequence


def test_peer_reads_why_it_is_refused(peer, bridge, supervisor):
    bridge.take("terminal")
    report = peer.run(FIRST_PROGRAM, timeout=PATIENCE)
    assert (report.result, report.refusal, report.holder) == (Result.REFUSED, Refusal.NOT_HOLDER, "terminal")


def test_peer_takes_and_releases_the_lease(peer, bridge):
    assert peer.take()
    assert peer.read_report().lease == LeaseState.YOURS
    peer.release()
    assert bridge.holder == ""


def test_another_client_stops_the_run_of_the_holder(peer, bridge, supervisor):
    supervisor.result = Result.NONE
    peer.trigger(FIRST_PROGRAM)
    supervisor.scan()
    other = Peer(*bridge.address)
    other.connect()
    other.stop()
    other.close()
    assert peer.wait_for_result(PATIENCE).result == Result.ABORTED


def test_reset_is_answered(peer):
    assert peer.reset(PATIENCE).result == Result.SUCCESS


def test_first_number_is_adopted_also_when_the_block_is_written_word_by_word(bridge, supervisor):
    with connect(bridge) as client:
        for address, value in ((0, 1), (2, FIRST_PROGRAM), (1, 5)):
            ask(client, struct.pack(">BHH", 6, address, value))
        assert bridge.poll() is None
        ask(client, struct.pack(">BHH", 6, 1, 6))
    assert bridge.poll().sequence == 6


def test_plain_ladder_runs_a_command_by_coils(bridge, supervisor):
    def bits():
        return ask(client, bytes.fromhex("02 0000 0004"))[2]

    with connect(bridge) as client:
        ask(client, struct.pack(">BHH", 6, 2, FIRST_PROGRAM))
        ask(client, bytes.fromhex("05 0000 0000"))
        ask(client, bytes.fromhex("05 0000 FF00"))
        assert bits() == 0b0001
        supervisor.scan()
        supervisor.scan()
        assert bits() == 0b0010
        ask(client, bytes.fromhex("05 0000 0000"))
        assert bits() == 0


def test_peer_says_where_nothing_answers():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(CellSilentError, match=f"127.0.0.1:{port}"):
        Peer("127.0.0.1", port).connect()


def test_peer_notices_a_closed_cell(peer, bridge):
    bridge.close()
    with pytest.raises(CellSilentError):
        peer.cycle()
    with pytest.raises(CellSilentError, match="connection is lost"):
        peer.cycle()


def test_peer_gives_up_after_its_time(bridge):
    times = iter(range(100))
    peer = Peer(*bridge.address, wait=lambda period: None, now=lambda: float(next(times)))
    peer.connect()
    peer.trigger(FIRST_PROGRAM)
    with pytest.raises(CellSilentError, match="no result of command"):
        peer.wait_for_result(timeout=5.0)
    peer.close()
