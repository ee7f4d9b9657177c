"""The example of docs/examples/line: 20 pegs by the exported block, with a lost link and an HMI's stop on the way.

The program runs in Structured Text as it is, once interpreted and, where MATIEC is, compiled; bridge and supervisor are
real, a quick program stands in for physics.
"""

import re
import subprocess
import sys
import threading
import time

import pytest
from pymodbus.client import ModbusTcpClient

from cell.config.load import load
from cell.config.parameters import PARAMETERS
from cell.records.journal import Journal
from cell.run.line import PROGRAMS, WORDS
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.exports.plc_names import plc_names
from plc_bridge.exports.structured_text import as_structured_text
from plc_bridge.protocol.images import COMMAND, REPORT
from plc_bridge.protocol.registers import table
from tests.foreign import EXAMPLE, has_matiec, soft_plc
from tests.quick_cell import quick_cell
from tests.structured_text import Instance, Time, units_of

STOPPED_RUN, CUT_RUN, WANTED = 5, 10, 20
LONGEST = 60.0  # s
CALM = PlcConfig(life_timeout=20.0, lease_timeout=20.0, modbus=ModbusConfig(port=0))


class Gate:
    """Lets every run end at once except those to be interrupted."""

    def __init__(self, program):
        self._program, self.held = program, {STOPPED_RUN, CUT_RUN}

    def is_set(self):
        return len(self._program.runs) not in self.held


class SoftPlc:
    """The program interpreted, a Modbus client beside it that connects again whenever it is cut off."""

    def __init__(self, address):
        text = as_structured_text(table(PROGRAMS, PARAMETERS, WORDS), plc_names(PROGRAMS, WORDS))
        units = units_of(text + (EXAMPLE / "line.st").read_text(encoding="utf-8"))
        self.line = Instance(units["Line"], units, Time(0.001))
        self._address, self.is_over = address, threading.Event()

    def run(self):
        client = ModbusTcpClient(self._address[0], port=self._address[1], retries=0)
        while not self.line.IsOver and not self.is_over.is_set():
            self.line()
            try:
                if client.connected or client.connect():
                    client.write_registers(COMMAND.start, self.line.Command)
                    self.line.v["Report"] = client.read_input_registers(REPORT.start, count=REPORT.words).registers
            except Exception:  # the link is cut: the next cycle connects anew
                client.close()
        client.close()

    @property
    def told(self):
        return "fed {Fed} good {Good} bad {Bad} recovered {Recovered}".format(**self.line.v)


@pytest.fixture
def served(tmp_path):
    with quick_cell(load(EXAMPLE / "cell.toml", sets=['sim.pace="max"']), CALM, tmp_path) as served:
        served.program.may_end = Gate(served.program)
        yield served


@pytest.fixture
def hmi(served):
    host, port = served.bridge.address
    command = [sys.executable, EXAMPLE / "hmi.py", host, str(port), "--stop-at", str(STOPPED_RUN)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as hmi:
        assert hmi.stdout.readline()
        yield hmi
        hmi.kill()


def cut_the_link(served):
    """Cut every connection while a run is under way, then let that run end."""
    deadline = time.monotonic() + LONGEST
    while len(served.program.runs) < CUT_RUN:
        assert time.monotonic() < deadline, "the line does not get on"
    server = served.bridge._server
    server.loop.call_soon_threadsafe(server.abort_all)
    served.program.may_end.held.discard(CUT_RUN)


def interrupted(folder):
    """Return how the runs ended that did not insert their peg."""
    with Journal(folder, is_read_only=True) as journal:
        return [(row.outcome, row.reason, row.message) for row in journal.runs(100) if row.outcome != "success"]


def inserted(folder):
    """Return the serial numbers of the pegs that were inserted, in order, once the last of them is on record."""
    deadline = time.monotonic() + LONGEST
    while True:
        with Journal(folder, is_read_only=True) as journal:
            rows = sorted(journal.runs(100), key=lambda row: row.run)
        serials = [row.serial for row in rows if row.outcome == "success"]
        if len(serials) >= WANTED or time.monotonic() > deadline:
            return serials


def assert_all_good(told, folder):
    """Every peg is good, and only the stopped run is to be repeated; a refused start may be repeated too."""
    assert re.fullmatch(f"fed {WANTED} good {WANTED} bad 0 recovered [1-4]", told), told
    assert inserted(folder) == [f"P-{n:03d}" for n in range(1, WANTED + 1)]
    assert interrupted(folder) == [("aborted", "stopped", "")]


def test_twenty_pegs_by_the_program_as_it_stands(served, hmi, tmp_path):
    plc = SoftPlc(served.bridge.address)
    thread = threading.Thread(target=plc.run)
    thread.start()
    try:
        cut_the_link(served)
        thread.join(LONGEST)
    finally:
        plc.is_over.set()
        thread.join()
    assert_all_good(plc.told, tmp_path)
    assert len(served.program.runs) == WANTED + 1


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    if not has_matiec():
        pytest.skip("MATIEC is not built in build/matiec, or there is no C compiler; .ci/run builds it where it can")
    return soft_plc(tmp_path_factory.mktemp("line"))


def test_twenty_pegs_by_a_compiled_soft_plc(served, hmi, compiled, tmp_path):
    host, port = served.bridge.address
    with subprocess.Popen([compiled, host, str(port), str(WANTED), "60"], stdout=subprocess.PIPE, text=True) as plc:
        cut_the_link(served)
        told = plc.communicate(timeout=60)[0].strip()
    assert_all_good(told, tmp_path)
