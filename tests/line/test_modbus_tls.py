"""The Modbus/TCP Security server on real sockets: certificates, roles and handshakes; `test_hostile_frames.py` has its frames."""

import contextlib
import datetime
import socket
import ssl
import struct

import pytest

from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.protocol.messages import FIRST_PROGRAM, Control
from plc_bridge.protocol.registers import COILS, Lease
from tests.certificates import Authority, utf8
from tests.scan_thread import take
from tests.sockets import PATIENCE, ask, is_closed

READ = bytes.fromhex("04 0001 0001")
WRITE = bytes.fromhex("06 0003 0007")
STOP = struct.pack(">BHH", 5, COILS["stop"], 0xFF00)
EXCHANGE = bytes.fromhex("17 0000 0001 0003 0001 02 0007")
START = [struct.pack(">BHHBHH", 16, 1, 2, 4, *command) for command in ((1, 0), (2, FIRST_PROGRAM))]
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
    tls = authority.cell(**{"roles": ROLES, **settings})
    bridge = Bridge(PlcConfig(modbus=ModbusConfig(port=0), tls=tls), {FIRST_PROGRAM: "insert_peg"})
    bridge.start()
    return bridge


@pytest.fixture
def bridge(authority):
    with contextlib.closing(start(authority)) as bridge:
        yield bridge


def knock(bridge):
    """Return a connection before its handshake."""
    return socket.create_connection(bridge.secure_address, timeout=PATIENCE)


def connect(bridge, context):
    plain = knock(bridge)
    plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    try:
        return context.wrap_socket(plain, server_hostname="127.0.0.1")
    except OSError:
        plain.close()
        raise


def is_refused(bridge, context):
    """Return True if the server refuses this client; in TLS 1.3 a client detects it only when it reads."""
    try:
        with connect(bridge, context) as client:
            ask(client, READ)
    except OSError:
        return True
    return False


# Who gets in.


def operator(authority, version=ssl.TLSVersion.TLSv1_3, **validity):
    """Return the context of an operator that speaks one version of TLS."""
    context = authority.client(*authority.sign("client", utf8("Operator"), **validity))
    context.minimum_version = context.maximum_version = version
    context.set_ciphers("ALL:@SECLEVEL=0")
    return context


@pytest.mark.parametrize("version", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
def test_client_with_a_certificate_is_served(bridge, authority, version):
    with connect(bridge, operator(authority, version)) as client:
        assert client.version() == version.name.replace("_", ".")
        assert ask(client, READ)[0] == 4


STRANGERS = {
    "no certificate": lambda authority, folder: authority.client(),
    "another authority": lambda authority, folder: operator(Authority(folder, "other")),
    "run out": lambda authority, folder: operator(authority, lifetime=datetime.timedelta(days=-1)),
    "two roles in one": lambda authority, folder: authority.client(*authority.sign("odd", utf8("Operator") * 2)),
    "older TLS": lambda authority, folder: operator(authority, ssl.TLSVersion.TLSv1_1),
}


@pytest.mark.filterwarnings("ignore:ssl.TLSVersion.TLSv1_1 is deprecated")
@pytest.mark.parametrize("stranger", STRANGERS)
def test_client_without_a_valid_certificate_is_refused_and_counted(bridge, authority, tmp_path, stranger):
    assert is_refused(bridge, STRANGERS[stranger](authority, tmp_path))
    bridge.close()  # the client may notice before the server counts it
    assert (bridge.diagnostics.forbidden, bridge.diagnostics.accepted) == (1, 0)


def test_a_revoked_certificate_is_refused_and_another_one_served(authority):
    taken = authority.sign("taken", utf8("Operator"))
    with contextlib.closing(start(authority, revoked=authority.revoke(taken[0]))) as bridge:
        assert is_refused(bridge, authority.client(*taken))
        assert not is_refused(bridge, authority.client(*authority.sign("kept", utf8("Operator"))))


def test_address_that_is_not_allowed_never_gets_to_a_handshake(authority, contexts):
    bridge = start(authority, allow=["10.0.0.0/8"])
    assert is_refused(bridge, contexts["Operator"])
    bridge.close()
    assert bridge.diagnostics.forbidden == 1


# Who may do what.


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


def test_command_carries_role_and_address_and_a_guard_stops_it(bridge, contexts):
    with connect(bridge, contexts["Operator"]) as operator, connect(bridge, contexts["Guard"]) as guard:
        ask(operator, *START)
        command = take(bridge)
        assert (command.code, command.source) == (FIRST_PROGRAM, f"Operator@127.0.0.1:{operator.getsockname()[1]}")
        assert bridge.holder == command.source
        ask(guard, STOP)
        command = take(bridge)
    assert (command.code, command.source.partition(":")[0]) == (Control.STOP, "Guard@127.0.0.1")


def test_plain_client_of_the_same_address_inherits_nothing(bridge, contexts):
    with connect(bridge, contexts["Operator"]) as client:
        ask(client, struct.pack(">BHH", 6, 5, Lease.TAKE_FOR_HOST))
    assert bridge.holder == "Operator@127.0.0.1"
    with socket.create_connection(bridge.address, timeout=PATIENCE) as plain:
        ask(plain, *START)
    assert bridge.poll() is None


# Handshakes that never end.


@pytest.mark.parametrize(("idle_timeout", "said"), [(0.05, b""), (60.0, b"\x16\x03\x01")])
def test_an_endless_handshake_ends_by_time_or_with_the_cell(authority, idle_timeout, said):
    bridge = start(authority, idle_timeout=idle_timeout)
    with knock(bridge) as silent:
        silent.sendall(said)
        if said:
            bridge.close()
        assert is_closed(silent)
    bridge.close()


def test_handshakes_that_never_end_take_no_place_of_one_that_spoke(authority, contexts):
    with (
        contextlib.closing(start(authority, connections=4)) as bridge,
        connect(bridge, contexts["Operator"]) as plc,
        contextlib.ExitStack() as crowd,
    ):
        ask(plc, READ)
        for _ in range(30):
            crowd.enter_context(knock(bridge)).sendall(b"\x16\x03\x01\x00\x05\x01\x00")
        assert ask(plc, READ)[0] == 4
        crowd.close()
        assert not is_refused(bridge, contexts["Operator"])
