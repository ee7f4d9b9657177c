"""What a PLC reads is true when it reads it: words and bits on a wire, against the real bridge and supervisor."""

import socket
import struct
import time

import pytest

from cell.states import State
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.images import REPORT, report_image
from plc_bridge.messages import Control, Refusal, Result
from plc_bridge.registers import COILS, DISCRETE_INPUTS
from tests.quick_cell import CODE, quick_cell

PATIENCE = 10.0  # s
HEADER = struct.Struct(">HHHB")
AT = {register.name.removeprefix("report_"): register.address for register in REPORT.registers}
CALM = PlcConfig(life_timeout=60.0, lease_timeout=60.0, modbus=ModbusConfig(port=0))


class Wire:
    """A Modbus TCP connection that says what a test wants it to, several requests in one segment too."""

    def __init__(self, address):
        self.socket = socket.create_connection(address, timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self):
        self.socket.close()

    def ask(self, *pdus):
        """Send requests in one segment and return the answers."""
        self.socket.sendall(b"".join(HEADER.pack(n, 0, len(pdu) + 1, 1) + pdu for n, pdu in enumerate(pdus)))
        return [self._receive(HEADER.unpack(self._receive(HEADER.size))[2] - 1) for _ in pdus]

    def _receive(self, size):
        data = b""
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            assert more, "closed"
            data += more
        return data

    def order(self, *commands):
        """Send (sequence, code) pairs, each in a request of its own, in one segment."""
        return self.ask(*(struct.pack(">BHHBHH", 16, 1, 2, 4, *command) for command in commands))

    def coil(self, name, value):
        self.ask(coil(name, value))

    def report(self):
        (answer,) = self.ask(struct.pack(">BHH", 4, REPORT.start, REPORT.words))
        return report_image(struct.unpack(f">{REPORT.words}H", answer[2:]))

    def bits(self):
        """Return the names of the discrete inputs that are 1."""
        (answer,) = self.ask(struct.pack(">BHH", 2, 0, len(DISCRETE_INPUTS)))
        return {name for name, place in DISCRETE_INPUTS.items() if answer[2] >> place & 1}

    def until(self, is_met):
        """Return the first report for which `is_met` holds."""
        deadline = time.monotonic() + PATIENCE
        while not is_met(report := self.report()):
            assert time.monotonic() < deadline, report
        return report

    def answer(self, sequence):
        """Return the report that first answers a number."""
        return self.until(lambda report: report.answered == sequence)


def coil(name, value):
    return struct.pack(">BHH", 5, COILS[name], 0xFF00 if value else 0)


@pytest.fixture
def served(loaded, tmp_path):
    with quick_cell(loaded, CALM, tmp_path) as served:
        yield served


@pytest.fixture
def connect(served):
    opened = []

    def connect():
        opened.append(Wire(served.bridge.address))
        return opened[-1]

    yield connect
    for wire in opened:
        wire.close()


@pytest.fixture
def plc(connect):
    return connect()


def stopped(plc):
    plc.order((1, Control.NONE), (2, Control.STOP))
    return plc.until(lambda report: report.state == State.STOPPED)


# One order from the wire to the scan.


def test_a_start_before_a_reset_in_one_segment_is_refused(plc, served):
    stopped(plc)
    plc.order((3, CODE), (4, Control.RESET))
    plc.until(lambda report: report.state == State.IDLE)
    assert served.program.runs == []


def test_a_hold_behind_a_start_in_one_segment_holds_the_run(plc, served):
    served.program.may_end.clear()
    plc.order((1, Control.NONE), (2, CODE), (3, Control.HOLD))
    plc.until(lambda report: report.state == State.HELD)


def test_a_stop_overtakes_the_start_before_it(plc, served):
    plc.order((1, Control.NONE), (2, CODE), (3, Control.STOP))
    plc.until(lambda report: report.state == State.STOPPED)
    assert served.program.runs == []


# Answers are true at once.


@pytest.mark.parametrize("sequence", range(3, 13))
def test_the_first_answer_to_a_start_that_cannot_be_is_its_refusal(plc, sequence):
    stopped(plc)
    plc.order((sequence, CODE))
    report = plc.answer(sequence)
    assert (report.refusal, report.sequence, report.result) == (Refusal.NOT_READY, sequence, Result.REFUSED)


def test_a_control_that_cannot_be_is_refused_by_its_first_answer_and_the_run_goes_on(plc, served):
    served.program.may_end.clear()
    plc.order((1, Control.NONE), (2, CODE))
    plc.until(lambda report: report.state == State.EXECUTE)
    plc.order((3, Control.UNHOLD))
    report = plc.answer(3)
    assert (report.refusal, report.sequence, report.result) == (Refusal.NOT_READY, 2, Result.NONE)


def test_what_belongs_to_another_run_never_stands_beside_the_own_result(plc, connect, served):
    plc.order((1, Control.NONE), (2, CODE))
    own = plc.until(lambda report: report.result == Result.SUCCESS)
    plc.ask(struct.pack(">BHH", 6, 5, 3))
    other = connect()
    other.order((1, Control.NONE), (9, CODE))
    assert other.until(lambda report: report.result == Result.SUCCESS).run == own.run + 1
    again = plc.report()
    assert (again.sequence, again.result, again.run, again.stage_times) == (2, Result.SUCCESS, own.run, own.stage_times)
