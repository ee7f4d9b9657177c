"""The guide for PLC programmers: its recipes work as they stand, and its tables are those of the program."""

import re
import shutil
import socket
import ssl
import subprocess
import time
import tomllib

import pytest
from pymodbus.client import ModbusTcpClient

from cell.config.parameters import PARAMETERS
from cell.run.line import PROGRAMS, WORDS
from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.exports.plc_names import plc_names
from plc_bridge.exports.structured_text import as_structured_text
from plc_bridge.protocol.images import COMMAND, REPORT
from plc_bridge.protocol.messages import REMEDIES, Refusal
from plc_bridge.protocol.registers import table
from tests.hostile import PATIENCE, exchange
from tests.pages import ROOT, blocks
from tests.structured_text import Instance, Time, units_of

PAGE = ROOT / "docs" / "plc.md"
TEXT = PAGE.read_text(encoding="utf-8")


def piece(kind, word):
    (found,) = [b.text for b in blocks() if b.page == PAGE and b.info == kind and word in b.text]
    return found


def test_the_first_program_of_the_guide_inserts_a_peg(served):
    exported = as_structured_text(table(PROGRAMS, PARAMETERS, WORDS), plc_names(PROGRAMS, WORDS))
    units = units_of(exported + piece("st", "PROGRAM FirstPeg"))
    plc = Instance(units["FirstPeg"], units, Time(0.001))
    host, port = served.bridge.address
    deadline = time.monotonic() + PATIENCE
    with ModbusTcpClient(host, port=port) as client:
        while not plc.HasEnded and time.monotonic() < deadline:
            plc()
            client.write_registers(COMMAND.start, plc.Command)
            plc.v["Report"] = client.read_input_registers(REPORT.start, count=REPORT.words).registers
    assert (plc.HasEnded, plc.Good, plc.Why, len(served.program.runs)) == (True, True, 0, 1)


@pytest.mark.skipif(not shutil.which("openssl"), reason="openssl is not installed; .ci/run installs it")
def test_certificates_by_the_recipe_let_the_plc_in_with_its_role(tmp_path):
    subprocess.run(
        ["sh", "-e"], input=piece("console", "openssl"), cwd=tmp_path, text=True, check=True, capture_output=True
    )
    section = tomllib.loads(piece("toml", "[plc.tls]"))["plc"]["tls"]
    files = {name: tmp_path / section[name] for name in ("certificate", "key", "authority")}
    bridge = Bridge(PlcConfig(modbus=ModbusConfig(port=0), tls={**section, **files, "port": 0}), {100: "insert_peg"})
    bridge.start()
    context = ssl.create_default_context(cafile=str(files["authority"]))
    context.load_cert_chain(tmp_path / "tls" / "plc.pem", tmp_path / "tls" / "plc.key")
    try:
        with (
            socket.create_connection(bridge.secure_address, timeout=PATIENCE) as plain,
            context.wrap_socket(plain, server_hostname="127.0.0.1") as plc,
        ):
            take = bytes.fromhex("06 0005 0001")
            assert exchange(plc, [take]) == [take]
            holder = bridge.holder
        assert holder.startswith("Operator@127.0.0.1:")
    finally:
        bridge.close()


def test_every_refusal_is_listed_with_its_remedy():
    section = TEXT.partition("## Refusals")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (\d+) ([A-Z_]+) \| (.*) \|$", section, re.M)
    assert rows == [(str(each.value), each.name, REMEDIES[each]) for each in Refusal if each is not Refusal.NONE]


def test_lengths_for_gateways_are_those_of_the_blocks():
    assert f"0 to {COMMAND.words - 1}, {2 * COMMAND.words} bytes" in TEXT
    assert f"0 to {REPORT.words - 1}, {2 * REPORT.words} bytes" in TEXT
