"""PLC-side programs that are not ours run fifty commands each, over real sockets; a quick program stands in for physics."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cell.line import PARAMETERS, PROGRAMS, WORDS
from plc_bridge.c_header import as_c_header
from plc_bridge.config import ModbusConfig, PlcConfig, RtuConfig, TlsConfig
from plc_bridge.plc_names import plc_names
from plc_bridge.registers import table
from tests.cable import Cable
from tests.certificates import Authority, utf8
from tests.quick_cell import quick_cell

CLIENTS = Path(__file__).parents[1] / "clients"
AWLSIM = Path(__file__).parents[2] / "build" / "awlsim"
"""Where `.ci/run` puts it."""
COUNT = 50
PATIENT = {"life_timeout": 60.0, "lease_timeout": 60.0, "modbus": ModbusConfig(port=0)}
ALL_DONE = f"triggered {COUNT} done {COUNT}"


def call(*command, folder=None, **environment):
    """Return what a program printed, and fail with that where it failed."""
    done = subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=60,
        check=False,
        cwd=folder,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stdout
    return done.stdout.strip()


def has_library(name):
    tools = shutil.which("cc") and shutil.which("pkg-config")
    return bool(tools) and subprocess.run(["pkg-config", "--exists", name], check=False).returncode == 0


def has_modules(folder):
    """Tell whether Go and what the module there needs is on this computer."""
    offline = {**os.environ, "GOPROXY": "off"}
    return bool(shutil.which("go")) and not subprocess.call(
        ["go", "mod", "download"], cwd=folder, env=offline, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


@pytest.fixture
def served(loaded, tmp_path):
    with quick_cell(loaded, PlcConfig(**PATIENT), tmp_path) as served:
        yield served


@pytest.fixture(scope="module")
def libmodbus_client(tmp_path_factory):
    if not has_library("libmodbus"):
        pytest.skip("libmodbus or a C compiler is not installed (Debian: gcc pkg-config libmodbus-dev)")
    program = tmp_path_factory.mktemp("libmodbus") / "client"
    header = as_c_header(table(PROGRAMS, PARAMETERS, WORDS), plc_names(PROGRAMS, WORDS))
    (program.parent / "cell_map.h").write_text(header, encoding="utf-8")
    flags = call("pkg-config", "--cflags", "--libs", "libmodbus").split()
    call(
        "cc",
        "-std=c11",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-I",
        program.parent,
        "-o",
        program,
        CLIENTS / "libmodbus_client.c",
        *flags,
    )
    return program


@pytest.fixture(scope="module")
def go_client(tmp_path_factory):
    folder = CLIENTS / "go"
    if not has_modules(folder):
        pytest.skip("Go is not installed, or `go mod download` was not run in tests/clients/go")
    program = tmp_path_factory.mktemp("go") / "client"
    call("go", "build", "-o", program, ".", folder=folder)
    return program


def is_all_done(served, said):
    return (said, len(served.program.runs)) == (ALL_DONE, COUNT)


def test_libmodbus_over_tcp(served, libmodbus_client):
    assert is_all_done(served, call(libmodbus_client, "tcp", *served.bridge.address, COUNT))


def test_libmodbus_over_a_serial_line(loaded, tmp_path, libmodbus_client):
    with Cable() as cable:
        rtu = RtuConfig(port=cable.ends[0], unit=17, baud_rate=115200, parity="none")
        with quick_cell(loaded, PlcConfig(**PATIENT, rtu=rtu), tmp_path) as served:
            assert is_all_done(served, call(libmodbus_client, "rtu", cable.ends[1], rtu.unit, COUNT))


def test_go_over_tcp(served, go_client):
    host, port = served.bridge.address
    assert is_all_done(served, call(go_client, f"tcp://{host}:{port}", COUNT))


def test_go_over_tls(loaded, tmp_path, go_client):
    authority = Authority(tmp_path / "certificates")
    certificate, key = authority.sign("cell")
    files = {"certificate": certificate, "key": key, "authority": authority.certificate}
    tls = TlsConfig(port=0, roles={"Operator": ("read", "command")}, **files)
    with quick_cell(loaded, PlcConfig(**PATIENT, tls=tls), tmp_path / "journal") as served:
        host, port = served.bridge.secure_address
        client = authority.sign("plc", utf8("Operator"))
        said = call(go_client, f"tcp+tls://{host}:{port}", COUNT, *client, authority.certificate)
        assert is_all_done(served, said)
        assert served.record(COUNT).source.startswith("Operator@127.0.0.1:")


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
