"""Requests over RTU are answered by the serial-line specification; noise is in `test_hostile_frames` and `test_bytes_outside`."""

import threading

import pytest

from drivers.transport.wires import LineLostError
from plc_bridge.bridge import Bridge
from plc_bridge.config import PlcConfig, RtuConfig
from plc_bridge.modbus.rtu import PATIENCE, RtuServer
from plc_bridge.modbus.rtu_frames import is_intact, with_check_sum
from plc_bridge.protocol.messages import Command
from plc_bridge.protocol.registers import VERSION
from tests.plc_bytes import SerialWire

PROGRAM = 100
SILENCE = b""


class Rtu:
    """A server on a line of bytes, the bridge behind it, and the time."""

    def __init__(self, **settings):
        self.now = 0.0
        self.bridge = Bridge(PlcConfig(), {PROGRAM: "insert_peg"}, now=lambda: self.now)
        self.line = SerialWire()
        self.server = RtuServer(RtuConfig(port="-", **settings), self.line, self.bridge, now=lambda: self.now)

    def hear(self, *pieces):
        """Send the pieces, with SILENCE between them if given; return the answers."""
        self.line.pieces += pieces
        self.line.sent.clear()
        while self.line.pieces:
            self.server.turn()
        assert all(map(is_intact, self.line.sent))
        return [answer[:-2] for answer in self.line.sent]

    def ask(self, request):
        return self.hear(with_check_sum(bytes.fromhex(request)))


@pytest.fixture
def rtu():
    return Rtu()


def test_request_is_answered_with_its_unit_and_check_sum():
    for unit in (1, 17):
        answer = bytes([unit, 4, 2]) + VERSION.to_bytes(2)
        assert Rtu(unit=unit).ask(f"{unit:02X} 04 0001 0001") == [answer]


@pytest.mark.parametrize(
    ("unit", "value"), [("02", "0000"), ("F7", "0000"), ("F8", "0000"), ("FF", "0000"), ("00", "0007")]
)
def test_a_broadcast_is_obeyed_unanswered_and_other_units_are_ignored(rtu, unit, value):
    assert rtu.ask(f"{unit} 06 0003 0007") == []
    assert rtu.ask("01 03 0003 0001") == [bytes.fromhex("01 03 02" + value)]


def test_broadcast_stop_stops(rtu):
    rtu.ask("00 05 0001 FF00")
    assert rtu.bridge.poll().source == "rtu:ttyPLC0"


@pytest.mark.parametrize("request_", ["00 03 0000 0001", "00 17 0000 0001 0003 0001 02 0007", "00 2B 0E 01 00"])
def test_broadcast_of_anything_else_is_ignored(rtu, request_):
    assert rtu.ask(request_) == []
    assert rtu.server.counts.requests == 0


def test_bad_check_sum_is_counted_and_ignored(rtu):
    assert rtu.hear(with_check_sum(bytes.fromhex("01 06 0003 0007"))[:-1] + b"\x00", SILENCE, SILENCE) == []
    assert rtu.bridge.diagnostics.bad_frames == 0
    assert rtu.server.counts.bad_frames == 1
    assert rtu.ask("01 03 0003 0001") == [bytes.fromhex("01 03 02 0000")]


def test_illegal_request_gets_its_exception(rtu):
    assert rtu.ask("01 2B 0D 01 00") == [bytes.fromhex("01 AB 01")]
    assert rtu.server.counts.exceptions == 1


def test_request_is_put_together_over_one_pause_and_given_up_after_two(rtu):
    frame = with_check_sum(bytes.fromhex("01 04 0001 0001"))
    assert len(rtu.hear(frame[:3], SILENCE, frame[3:])) == 1
    assert PATIENCE in rtu.line.waits
    assert rtu.hear(frame[:3], SILENCE, SILENCE, frame[3:], SILENCE, SILENCE) == []
    assert len(rtu.hear(frame)) == 1
    assert rtu.line.waits[-1] == pytest.approx(3.5 * 11 / 9600)  # a frame ends after three and a half characters


@pytest.mark.parametrize(("unit", "answers"), [("01", ["01 03 02 0007"]), ("02", [])])
def test_a_late_reader_serves_both_and_answers_its_last(rtu, unit, answers):
    late = bytes.fromhex("01 06 0003 0007"), bytes.fromhex(f"{unit} 03 0003 0001")
    assert rtu.hear(b"".join(map(with_check_sum, late))) == [bytes.fromhex(each) for each in answers]


@pytest.mark.parametrize(("silence", "is_run"), [(0.0, True), (60.0, True), (60.1, False)])
def test_command_runs_unless_a_long_silence_came_before(rtu, silence, is_run):
    rtu.ask("01 10 0001 0002 04 0001 0000")
    rtu.now = silence
    rtu.ask("01 10 0001 0002 04 0002 0064")
    assert rtu.bridge.poll() == (Command(2, PROGRAM, source="rtu:ttyPLC0") if is_run else None)


@pytest.mark.parametrize("error", [LineLostError("serial port: gone"), ZeroDivisionError("what nobody foresaw")])
def test_a_broken_line_is_opened_again_and_its_thread_lives(caplog, error):
    opened, is_served = [], threading.Event()

    class BreakingLine(SerialWire):
        def open(self):
            opened.append(True)

        def read(self, timeout):
            if len(opened) < 3:
                raise error
            is_served.set()
            return SILENCE

    server = RtuServer(RtuConfig(port="-"), BreakingLine(), Bridge(PlcConfig(), {PROGRAM: "insert_peg"}), pause=0.0)
    server.start()
    assert is_served.wait(10.0)
    server.close()
    warnings = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert warnings == [f"Modbus RTU: {error}"]
