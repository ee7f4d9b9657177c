"""PLC-side programs that are not ours run fifty commands each, over real sockets; a quick program stands in for physics.

They know of the cell what `cell map` prints; `python -m tests.foreign` lets them insert real pegs.
"""

import os
import sys
from pathlib import Path

import pytest

from plc_bridge.config import CanConfig, RtuConfig
from tests.certificates import Authority, utf8
from tests.foreign import by_canopen, by_node, call, go_client, has_go, has_libmodbus, has_node, libmodbus_client
from tests.hubs import Cable, SocketcandHub
from tests.plc_lines import patient
from tests.quick_cell import quick_cell

CLIENTS = Path(__file__).parents[1] / "clients"
AWLSIM = Path(__file__).parents[2] / "build" / "awlsim"
"""Where `.ci/run` puts it."""
COUNT = 50
"""Number of commands, as many as the program in AWL gives."""
PEGS = 20
"""Number of commands over OPC UA."""


@pytest.fixture(scope="module")
def libmodbus(tmp_path_factory):
    if not has_libmodbus():
        pytest.skip("libmodbus or a C compiler is not installed (Debian: gcc pkg-config libmodbus-dev)")
    return libmodbus_client(tmp_path_factory.mktemp("libmodbus"))


@pytest.fixture(scope="module")
def go(tmp_path_factory):
    if not has_go():
        pytest.skip("Go is not installed, or `go mod download` was not run in tests/clients/go")
    return go_client(tmp_path_factory.mktemp("go"))


def is_all_done(served, said, count=COUNT):
    return (said, len(served.program.runs)) == (f"triggered {count} done {count}", count)


def test_libmodbus_over_tcp(served, libmodbus):
    assert is_all_done(served, call(libmodbus, "tcp", *served.bridge.address, COUNT))


def test_libmodbus_over_a_serial_line(loaded, tmp_path, libmodbus):
    with Cable() as cable:
        rtu = RtuConfig(port=cable.ends[0], unit=17, baud_rate=115200, parity="none")
        with quick_cell(loaded, patient(rtu=rtu), tmp_path) as served:
            assert is_all_done(served, call(libmodbus, "rtu", cable.ends[1], rtu.unit, COUNT))


def test_go_over_tls(loaded, tmp_path, go):
    authority = Authority(tmp_path / "certificates")
    tls = authority.cell(roles={"Operator": ("read", "command")})
    with quick_cell(loaded, patient(tls=tls), tmp_path / "journal") as served:
        host, port = served.bridge.secure_address
        client = authority.sign("plc", utf8("Operator"))
        said = call(go, f"tcp+tls://{host}:{port}", COUNT, go.parent / "cell_map.h", *client, authority.certificate)
        assert is_all_done(served, said)
        assert served.record(COUNT).source.startswith("Operator@127.0.0.1:")


@pytest.mark.skipif(not has_node(), reason="Node is not installed, or `npm ci` was not run in tests/clients/node")
def test_node_over_opcua_loses_its_session_and_finds_its_result(loaded, tmp_path):
    pytest.importorskip("asyncua", reason="the extra opcua is not installed")
    authority = Authority(tmp_path / "certificates")
    tls = authority.cell("urn:test:cell", host="127.0.0.1", roles={"Operator": ("read", "command")})
    plc, opcua = patient(tls=tls), ("127.0.0.1", 0)
    authority.sign("plc", utf8("Operator"), uri="urn:test:plc")
    with quick_cell(loaded, plc, tmp_path / "journal", opcua=opcua) as served:
        assert is_all_done(
            served, by_node(authority.certificate.parent, served.bridge.opcua_address, opcua, PEGS), PEGS
        )


def test_canopen_by_its_eds(loaded, tmp_path):
    hub = SocketcandHub()
    try:
        can = CanConfig(interface="socketcand", channel=f"127.0.0.1:{hub.port}/can0", plc_timeout=0.0)
        with quick_cell(loaded, patient(can=can), tmp_path) as served:
            said = by_canopen(tmp_path, served.bridge.address, ("127.0.0.1", hub.port), COUNT)
            assert is_all_done(served, said)
    finally:
        hub.close()


@pytest.mark.skipif(not AWLSIM.is_dir(), reason="awlsim is not in build/awlsim; .ci/run puts it there")
def test_soft_plc_over_tcp(served):
    host, port = served.bridge.address
    said = call(
        sys.executable,
        AWLSIM / "bin" / "awlsim-test",
        *("-D", "-L", "1", "-m", "en", "-H", f"cell:host={host}:tcpPort={port}", CLIENTS / "fifty.awl"),
        PYTHONPATH=os.pathsep.join(map(str, (AWLSIM, CLIENTS))),
    )
    assert is_all_done(served, said)
