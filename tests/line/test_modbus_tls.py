"""The Modbus/TCP Security server on real sockets: who gets in, who may do what, frames cut anywhere."""

import contextlib
import datetime
import socket
import ssl
import struct

import pytest
from pymodbus.client import ModbusTlsClient

from drivers.errors import DeviceNotOpenedError
from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig, TlsConfig
from plc_bridge.protocol.messages import FIRST_PROGRAM, Control
from plc_bridge.protocol.registers import COILS, VERSION
from tests.certificates import Authority, utf8
from tests.scan_thread import take
from tests.sockets import receive

HEADER = struct.Struct(">HHHB")
READ = bytes.fromhex("04 0001 0001")
WRITE = bytes.fromhex("06 0003 0007")
STOP = struct.pack(">BHH", 5, COILS["stop"], 0xFF00)
EXCHANGE = bytes.fromhex("17 0000 0001 0003 0001 02 0007")
PATIENCE = 10.0
ROLES = {"Operator": ["read", "command"], "Watcher": ["read"], "Guard": ["stop"]}


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("certificates"))


@pytest.fixture(scope="module")
def contexts(authority):
    """Return the client context of each role; "" is that of a certificate without one."""
    made = {role: authority.client(*authority.sign(role, utf8(role))) for role in (*ROLES, "Stranger")}
    return {**made, "": authority.client(*authority.sign("nobody"))}


def start(authority, **settings):
    certificate, key = authority.sign("cell")
    files = {"certificate": certificate, "key": key, "authority": authority.certificate}
    tls = TlsConfig(**{"port": 0, "roles": ROLES, **files, **settings})
    bridge = Bridge(PlcConfig(modbus=ModbusConfig(port=0), tls=tls), {FIRST_PROGRAM: "insert_peg"})
    bridge.start()
    return bridge


@pytest.fixture
def bridge(authority):
    bridge = start(authority)
    yield bridge
    bridge.close()


def connect(bridge, context):
    plain = socket.create_connection(bridge.secure_address, timeout=PATIENCE)
    plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    try:
        return context.wrap_socket(plain, server_hostname="127.0.0.1")
    except OSError:
        plain.close()
        raise


def frame(pdu, transaction=1, protocol=0):
    return HEADER.pack(transaction, protocol, len(pdu) + 1, 1) + pdu


def answer(client):
    transaction, _, length, _ = HEADER.unpack(receive(client, HEADER.size))
    return transaction, receive(client, length - 1)


def ask(client, pdu):
    client.sendall(frame(pdu))
    return answer(client)[1]


def is_refused(bridge, context):
    """Return whether the server refuses this client; in TLS 1.3 a client notices it only when it reads."""
    try:
        with connect(bridge, context) as client:
            ask(client, READ)
    except OSError:
        return True
    return False


@pytest.mark.parametrize("version", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
def test_client_with_a_certificate_is_served(bridge, authority, version):
    context = authority.client(*authority.sign("client", utf8("Operator")))
    context.maximum_version = version
    with connect(bridge, context) as client:
        assert client.version() == version.name.replace("_", ".")
        assert ask(client, READ)[0] == 4


def test_client_without_a_certificate_is_refused_and_counted(bridge, authority):
    assert is_refused(bridge, authority.client())
    bridge.close()  # the client may notice before the server counts it
    assert (bridge.diagnostics.forbidden, bridge.diagnostics.accepted) == (1, 0)


def test_certificate_of_another_authority_is_refused(bridge, authority, tmp_path):
    context = authority.client(*Authority(tmp_path, "other").sign("client", utf8("Operator")))
    assert is_refused(bridge, context)


def test_a_revoked_certificate_is_refused_and_another_one_served(authority):
    taken = authority.sign("taken", utf8("Operator"))
    bridge = start(authority, revoked=authority.revoke(taken[0]))
    try:
        with pytest.raises((ssl.SSLError, ConnectionError)):  # noqa: SIM117
            with connect(bridge, authority.client(*taken)) as client:
                ask(client, READ)
        with connect(bridge, authority.client(*authority.sign("kept", utf8("Operator")))) as client:
            assert ask(client, READ)[0] == READ[0]
    finally:
        bridge.close()


def test_certificate_that_has_run_out_is_refused(bridge, authority):
    files = authority.sign("late", utf8("Operator"), lifetime=datetime.timedelta(days=-1))
    assert is_refused(bridge, authority.client(*files))


@pytest.mark.parametrize("value", [utf8("Operator") * 2, b"\x13\x02AB"])
def test_certificate_whose_role_is_not_one_string_is_refused_and_counted(bridge, authority, value):
    assert is_refused(bridge, authority.client(*authority.sign("odd", value)))
    bridge.close()
    assert bridge.diagnostics.forbidden == 1


@pytest.mark.filterwarnings("ignore:ssl.TLSVersion.TLSv1_1 is deprecated")
def test_older_tls_is_refused(bridge, authority, contexts):
    context = authority.client(*authority.sign("old", utf8("Operator")))
    context.minimum_version = context.maximum_version = ssl.TLSVersion.TLSv1_1
    context.set_ciphers("ALL:@SECLEVEL=0")
    assert is_refused(bridge, context)


@pytest.mark.parametrize(
    ("role", "read", "write", "stop", "exchange"),
    [
        ("Operator", True, True, True, True),
        ("Watcher", True, False, False, False),
        ("Guard", False, False, True, False),
        ("Stranger", False, False, False, False),
        ("", False, False, False, False),
    ],
)
def test_role_decides_and_refusal_is_exception_01(bridge, contexts, role, read, write, stop, exchange):
    with connect(bridge, contexts[role]) as client:
        allowed = []
        for request in (READ, WRITE, STOP, EXCHANGE):
            response = ask(client, request)
            allowed.append(response[0] == request[0])
            assert allowed[-1] or response == bytes([request[0] | 0x80, 1])
    assert allowed == [read, write, stop, exchange]
    assert bridge.diagnostics.unauthorised == allowed.count(False)


def test_stop_right_does_not_reach_the_other_coils(bridge, contexts):
    with connect(bridge, contexts["Guard"]) as client:
        assert ask(client, struct.pack(">BHH", 5, COILS["reset"], 0xFF00)) == b"\x85\x01"
        assert ask(client, bytes.fromhex("0F 0000 0003 01 07")) == b"\x8f\x01"
    assert bridge.poll() is None


def test_certificate_without_a_role_has_what_the_table_gives_it(authority, contexts):
    bridge = start(authority, without_role=["read"])
    with connect(bridge, contexts[""]) as client:
        assert (ask(client, READ)[0], ask(client, WRITE)) == (4, b"\x86\x01")
    bridge.close()


def test_command_carries_role_and_address(bridge, contexts):
    with connect(bridge, contexts["Operator"]) as client:
        port = client.getsockname()[1]
        ask(client, struct.pack(">BHHBHH", 16, 1, 2, 4, 1, 0))
        ask(client, struct.pack(">BHHBHH", 16, 1, 2, 4, 2, FIRST_PROGRAM))
        command = take(bridge)
        assert (command.code, command.source) == (FIRST_PROGRAM, f"Operator@127.0.0.1:{port}")
        assert bridge.holder == command.source


def test_plain_client_of_the_same_address_inherits_nothing(bridge, contexts):
    with connect(bridge, contexts["Operator"]) as client:
        ask(client, struct.pack(">BHHBHHHHH", 16, 1, 5, 10, 1, 0, 0, 0, 2))
    assert bridge.holder == "Operator@127.0.0.1"
    with socket.create_connection(bridge.address, timeout=PATIENCE) as plain:
        ask(plain, struct.pack(">BHHBHH", 16, 1, 2, 4, 1, 0))
        ask(plain, struct.pack(">BHHBHH", 16, 1, 2, 4, 2, FIRST_PROGRAM))
    assert bridge.poll() is None


def test_guard_stops_what_the_operator_runs(bridge, contexts):
    with connect(bridge, contexts["Operator"]) as operator, connect(bridge, contexts["Guard"]) as guard:
        ask(operator, struct.pack(">BHHBHH", 16, 1, 2, 4, 1, 0))
        ask(operator, struct.pack(">BHHBHH", 16, 1, 2, 4, 2, FIRST_PROGRAM))
        ask(guard, STOP)
        command = take(bridge)
    assert (command.code, command.source.partition(":")[0]) == (Control.STOP, "Guard@127.0.0.1")


def test_frame_may_be_cut_into_records_anywhere(bridge, contexts):
    data = frame(READ, 1) + frame(READ, 2)
    with connect(bridge, contexts["Operator"]) as client:
        for cut in range(1, len(data)):
            client.sendall(data[:cut])
            client.sendall(data[cut:])
            assert [answer(client)[0], answer(client)[0]] == [1, 2]


def test_pipelined_requests_are_all_answered_in_order(bridge, contexts):
    count = 3000
    with connect(bridge, contexts["Operator"]) as client:
        client.sendall(b"".join(frame(READ, n) for n in range(count)))
        assert [answer(client)[0] for _ in range(count)] == list(range(count))


def test_malformed_header_closes_the_connection(bridge, contexts):
    with connect(bridge, contexts["Operator"]) as client:
        client.sendall(frame(READ, protocol=3))
        with pytest.raises(OSError, match=r"."):
            answer(client)
    assert bridge.diagnostics.malformed == 1


def test_plain_modbus_on_the_tls_port_is_refused_and_others_are_served(bridge, contexts):
    with socket.create_connection(bridge.secure_address, timeout=PATIENCE) as plain:
        plain.sendall(frame(READ))
        with pytest.raises(OSError, match=r"."):
            receive(plain, 64)
    with connect(bridge, contexts["Operator"]) as client:
        assert ask(client, READ)[0] == 4
    bridge.close()
    assert bridge.diagnostics.forbidden == 1


def test_handshake_that_never_ends_is_cut_off(authority):
    bridge = start(authority, idle_timeout=0.05)
    with (
        socket.create_connection(bridge.secure_address, timeout=PATIENCE) as silent,
        pytest.raises(OSError, match="closed"),
    ):
        receive(silent, 1)
    bridge.close()


def test_handshakes_that_never_end_leave_room_for_others(authority, contexts):
    bridge = start(authority, connections=1)
    with socket.create_connection(bridge.secure_address, timeout=PATIENCE) as silent:
        with connect(bridge, contexts["Operator"]) as client:
            assert ask(client, READ)[0] == 4
        with pytest.raises(OSError, match="closed"):
            receive(silent, 1)
    bridge.close()
    assert bridge.diagnostics.dropped == 1


def test_cell_closes_while_a_handshake_is_under_way(authority):
    bridge = start(authority)
    with socket.create_connection(bridge.secure_address, timeout=PATIENCE) as silent:
        silent.sendall(b"\x16\x03\x01")
        bridge.close()
        with pytest.raises(OSError, match=r"."):
            receive(silent, 1)


def test_address_that_is_not_allowed_never_gets_to_a_handshake(authority, contexts):
    bridge = start(authority, allow=["10.0.0.0/8"])
    assert is_refused(bridge, contexts["Operator"])
    bridge.close()
    assert bridge.diagnostics.forbidden == 1


def test_newcomer_gets_the_place_of_the_one_that_was_idle_longest(authority, contexts):
    bridge = start(authority, connections=1)
    with connect(bridge, contexts["Operator"]) as idle, connect(bridge, contexts["Operator"]) as newcomer:
        assert ask(newcomer, READ)[0] == 4
        with pytest.raises(OSError, match=r"."):
            ask(idle, READ)
    bridge.close()


def test_unusable_certificate_is_said_and_leaves_nothing_open(authority, tmp_path):
    with pytest.raises(DeviceNotOpenedError, match=r"plc\.tls\.key"):
        start(authority, key=tmp_path / "none.key")


def test_client_that_is_not_ours_reads_writes_and_is_refused(bridge, authority):
    for role, is_allowed in (("Operator", True), ("Watcher", False)):
        context = authority.client(*authority.sign(f"foreign {role}", utf8(role)))
        context.check_hostname = False  # this client does not check the name of the server
        client = ModbusTlsClient("127.0.0.1", port=bridge.secure_address[1], sslctx=context, retries=0)
        assert client.connect()
        assert client.read_input_registers(1, count=10).registers[0] == VERSION
        assert client.write_register(3, 7).isError() is not is_allowed
        client.close()


def test_handshakes_that_never_end_take_no_place_of_one_that_spoke(authority, contexts):
    bridge = start(authority, connections=4)
    with connect(bridge, contexts["Operator"]) as plc, contextlib.ExitStack() as crowd:
        ask(plc, READ)
        for _ in range(30):
            half = crowd.enter_context(socket.create_connection(bridge.secure_address, timeout=PATIENCE))
            half.sendall(b"\x16\x03\x01\x00\x05\x01\x00")
        assert ask(plc, READ)[0] == 4
        crowd.close()
        with connect(bridge, contexts["Operator"]) as newcomer:
            assert ask(newcomer, READ)[0] == 4
    bridge.close()
