"""The function block, run line by line against the handshake that it is written for."""

from dataclasses import replace

import pytest

from plc_bridge.bridge import Bridge
from plc_bridge.config import PlcConfig
from plc_bridge.exports.function_block import FAILURE_BASE, NAME, NO_CELL, RUN_GONE, STOP_PENDING, WRONG_VERSION
from plc_bridge.exports.plc_names import plc_names
from plc_bridge.exports.scl import as_scl
from plc_bridge.exports.structured_text import as_structured_text
from plc_bridge.protocol.images import COMMAND, REPORT, Block, command_image
from plc_bridge.protocol.messages import Control, Refusal, Report, Result
from plc_bridge.protocol.registers import VERSION_MAJOR, Parameter, table
from tests.page_user import take_lease
from tests.scan_thread import take
from tests.structured_text import Instance, Members, Time, units_of

INSERT = 100
SPEED = Parameter("search.speed", "m/s", 1e-4, -1.0, 0.5, "peak speed *) of the tip")
REGISTERS = table({INSERT: "insert_peg"}, [SPEED])
WORDS = {"report_state": {6: "EXECUTE"}}
NAMES = plc_names({INSERT: "insert_peg"}, WORDS)
TEXT, SCL = as_structured_text(REGISTERS, NAMES), as_scl(REGISTERS, NAMES)
SHOWN = ("Busy", "Done", "Error", "CommandAborted")
CYCLE = 0.001  # s


class Plc:
    """The block in a PLC, whose Modbus client writes and reads between two cycles."""

    text = TEXT

    def __init__(self):
        self.now = 0.0
        self.bridge = Bridge(PlcConfig(), {INSERT: "insert_peg"}, [SPEED], now=lambda: self.now)
        self.connections, self.is_connected, self.report = 0, False, Report()
        self.restart()
        self.connect()

    def restart(self):
        units = units_of(self.text)
        self.block = Instance(units[NAME], units, Time(CYCLE))
        self.v = self.block.v

    def command(self):
        return command_image(self.v["Command"])

    def take_report(self):
        self.v["Report"] = self.bridge.report_words(self.source)

    def spoil(self, name, value):
        self.v["Report"][next(r.address for r in REPORT.registers if r.name == f"report_{name}")] = value

    def connect(self):
        self.connections += 1
        self.source, self.is_connected = f"plc:{self.connections}", True
        self.bridge.opened(self.source, "plc")

    def disconnect(self):
        self.bridge.closed(self.source)
        self.is_connected = False

    def cycle(self, count=1, **inputs):
        self.v.update(inputs)
        for _ in range(count):
            self.block()
            assert sum(self.v[name] for name in SHOWN) <= 1
            if self.is_connected:
                self.bridge.wrote(self.source, self.command())
                self.take_report()
                self.publish(self.report)
        return self

    def publish(self, report):
        self.report = report
        self.bridge.publish(report)

    def end(self, result, **facts):
        command = take(self.bridge)
        self.publish(Report(sequence=command.sequence, state=17, result=result, **facts))
        return command

    def runs(self, cycles=2):
        """Let a command run, and return it."""
        self.cycle(cycles, Execute=True)
        run = take(self.bridge)
        self.publish(Report(sequence=run.sequence, state=6))
        self.cycle(2)
        return run

    def reconnect(self):
        self.disconnect()
        self.cycle()
        self.connect()
        assert self.cycle(3).shown == ["Busy"]

    def ended(self, run, result):
        """Return the outputs after the cell has ended a run."""
        state = 17 if result is Result.SUCCESS else 2
        self.publish(Report(sequence=run.sequence, state=state, result=result))
        return self.cycle(2).shown

    @property
    def shown(self):
        return [name for name in SHOWN if self.v[name]]


class SiemensPlc(Plc):
    """The same in SCL, where the blocks have members instead of words."""

    text = SCL

    def restart(self):
        super().restart()
        names = [r.name.removeprefix("command_") for r in COMMAND.registers]
        self.v["Command"] = Members(**dict.fromkeys(names, 0), parameter=[0] * 9)
        self.v["Command"].serial = [0] * 32
        self.v["Report"] = Members(**vars_of(REPORT.unpack([0] * REPORT.words)))

    def command(self):
        held = self.v["Command"]
        values = {r.name: getattr(held, r.name.removeprefix("command_")) for r in COMMAND.registers}
        values["command_serial"] = bytes(held.serial).rstrip(b"\0").decode()
        for number in range(1, 9):
            values[f"command_parameter_{number}"] = held.parameter[number] * (SPEED.scale if number == 1 else 1)
        return command_image(COMMAND_WITH_LIMITS.pack(values))

    def take_report(self):
        self.v["Report"] = Members(**vars_of(RAW_REPORT.unpack(self.bridge.report_words(self.source))))

    def spoil(self, name, value):
        setattr(self.v["Report"], name, value)


def vars_of(values):
    """Return the members of the user data type for the report."""
    found = {name.removeprefix("report_"): value for name, value in values.items()}
    return {**found, "stage_time": [0, *(found[f"stage_time_{n}"] for n in range(1, 13))]}


COMMAND_WITH_LIMITS = Block([r for r in REGISTERS if r.table == "holding"])
RAW_REPORT = Block([replace(r, scale=1.0) for r in REPORT.registers])


@pytest.fixture(params=[Plc, SiemensPlc])
def kind(request):
    return request.param


@pytest.fixture
def plc(kind):
    return kind().cycle(3, Code=INSERT)


def test_rising_edge_of_execute_runs_once_and_outputs_fall_with_it(plc):
    assert plc.cycle(3, Execute=True).shown == ["Busy"]
    assert plc.end(Result.SUCCESS).code == INSERT
    assert plc.cycle(20).shown == ["Done"]
    assert plc.bridge.poll().code == Control.ACKNOWLEDGE
    assert plc.bridge.poll() is None
    assert plc.cycle(Execute=False).shown == []


def test_output_is_shown_for_one_cycle_when_execute_fell_before(plc):
    plc.cycle(3, Execute=True).cycle(Execute=False).end(Result.SUCCESS)
    assert [tuple(plc.cycle().shown) for _ in range(4)] == [("Busy",), ("Done",), (), ()]


def test_another_edge_while_busy_does_nothing(plc):
    plc.cycle(2, Execute=True).cycle(Execute=False).cycle(Execute=True, Recipe=9)
    command = plc.end(Result.SUCCESS)
    assert (command.sequence, command.recipe, plc.cycle(2).shown) == (1, 0, ["Done"])


def test_inputs_reach_the_command(plc):
    serial = list(b"PEG-0042".ljust(32, b"\0"))
    plc.cycle(Execute=True, Recipe=7, SerialNumber=serial, Parameters=[0, -70, *[0] * 7], ParameterMask=1)
    command = take(plc.bridge)
    assert (command.recipe, command.serial, command.parameters) == (
        7,
        "PEG-0042",
        (("search.speed", pytest.approx(-0.007)),),
    )


@pytest.mark.parametrize(
    ("result", "facts", "shown", "error"),
    [
        (Result.SUCCESS, {}, "Done", 0),
        (Result.ABORTED, {}, "CommandAborted", 0),
        (Result.FAILURE, {"reason": 3}, "Error", FAILURE_BASE + 3),
        (Result.FAULT, {"fault": 2001}, "Error", 2001),
    ],
)
def test_every_ending_has_its_output_and_error(plc, result, facts, shown, error):
    plc.cycle(2, Execute=True).end(result, **facts)
    assert (plc.cycle(2).shown, plc.v["ErrorID"]) == ([shown], error)


@pytest.mark.parametrize("refusal", [Refusal.NOT_HOLDER, Refusal.UNKNOWN_RECIPE])
def test_refusal_by_bridge_or_cell_is_an_error(plc, refusal):
    if refusal is Refusal.NOT_HOLDER:
        take_lease(plc.bridge)
    plc.cycle(2, Execute=True)
    if refusal is Refusal.UNKNOWN_RECIPE:
        plc.bridge.refuse(plc.bridge.poll(), refusal)
    assert (plc.cycle(2).shown, plc.v["ErrorID"]) == (["Error"], refusal)


@pytest.mark.parametrize("reconnects", [False, True])
def test_stop_aborts_what_runs(plc, reconnects):
    run = plc.runs()
    plc.cycle(3, Stop=True)
    assert take(plc.bridge).code == Control.STOP
    if reconnects:
        plc.reconnect()
    assert plc.ended(run, Result.ABORTED) == ["CommandAborted"]


@pytest.mark.parametrize("before", [0, 65534])
def test_run_waits_while_hold_is_true(kind, before):
    plc = kind()
    plc.v["Sequence"] = before
    plc.cycle(2, Code=INSERT).cycle(3, Execute=True)
    run = take(plc.bridge)
    plc.publish(Report(sequence=run.sequence, state=3))
    plc.cycle(3, Hold=True)
    assert plc.bridge.poll() is None
    for state, hold, code in ((6, True, Control.HOLD), (11, False, Control.UNHOLD), (6, True, Control.HOLD)):
        plc.publish(Report(sequence=run.sequence, state=state))
        assert plc.cycle(5, Hold=hold).shown == ["Busy"]
        assert [take(plc.bridge).code, take(plc.bridge)] == [code, None]
    plc.publish(Report(sequence=run.sequence, state=11))
    plc.cycle(3, Stop=True)
    assert take(plc.bridge).code == Control.STOP
    assert plc.ended(run, Result.ABORTED) == ["CommandAborted"]


def test_hold_without_a_run_requests_nothing(plc):
    plc.publish(Report(state=4))
    plc.cycle(5, Hold=True)
    assert plc.bridge.poll() is None
    plc.cycle(3, Execute=True).end(Result.SUCCESS)
    plc.cycle(3)
    assert plc.cycle(5, Hold=False).shown == ["Done"]
    assert [plc.bridge.poll().code, plc.bridge.poll()] == [Control.ACKNOWLEDGE, None]


def test_a_refused_hold_is_not_requested_again(plc):
    run = plc.runs(3)
    plc.cycle(3, Hold=True)
    plc.bridge.refuse(plc.bridge.poll(), Refusal.NOT_READY)
    assert plc.cycle(5).shown == ["Busy"]
    assert plc.bridge.poll() is None
    assert plc.ended(run, Result.SUCCESS) == ["Done"]


def test_stop_that_overtakes_its_command_aborts_it(plc):
    assert plc.cycle(3, Execute=True, Stop=True).shown == ["CommandAborted"]
    assert [take(plc.bridge).code, take(plc.bridge)] == [Control.STOP, None]


def test_stop_is_not_repeated_by_a_new_connection(plc):
    plc.cycle(3, Stop=True)
    assert take(plc.bridge).code == Control.STOP
    plc.cycle(2).disconnect()
    plc.connect()
    plc.cycle(3)
    assert plc.bridge.poll() is None


def test_command_does_not_overwrite_a_stop_on_its_way(plc):
    plc.disconnect()
    plc.cycle(Stop=True)
    assert (plc.cycle(Execute=True).shown, plc.v["ErrorID"]) == (["Error"], STOP_PENDING)
    plc.connect()
    plc.cycle()
    assert take(plc.bridge).code == Control.STOP


def test_no_cell_is_an_error_and_the_command_never_runs_later(plc):
    plc.disconnect()
    plc.cycle(3, Execute=True, SilentTime=0.05)
    assert (plc.cycle(50).shown, plc.v["ErrorID"]) == (["Error"], NO_CELL)
    plc.connect()
    plc.cycle(5)
    assert plc.bridge.poll() is None


def test_execute_before_the_first_report_is_an_error(kind):
    plc = kind()
    assert (plc.cycle(Execute=True).shown, plc.v["ErrorID"]) == (["Error"], NO_CELL)


def test_cell_with_another_map_is_an_error(plc):
    plc.disconnect()
    plc.spoil("version", (VERSION_MAJOR + 1) * 256)
    assert (plc.cycle(Execute=True).shown, plc.v["ErrorID"]) == (["Error"], WRONG_VERSION)


def test_torn_report_is_not_believed(plc):
    plc.cycle(2, Execute=True).end(Result.SUCCESS)
    plc.cycle().disconnect()
    plc.spoil("life", 12345)
    assert plc.cycle().shown == ["Busy"]


@pytest.mark.parametrize("holds", [(), (True,), (True, False)])
def test_run_goes_on_over_a_new_connection_also_after_a_hold(plc, holds):
    run = plc.runs()
    for hold, state in zip(holds, (6, 11), strict=False):
        plc.publish(Report(sequence=run.sequence, state=state))
        plc.cycle(5, Hold=hold)
        assert take(plc.bridge).code in (Control.HOLD, Control.UNHOLD)
    plc.cycle(2).reconnect()
    assert plc.ended(run, Result.SUCCESS) == ["Done"]


@pytest.mark.parametrize("is_held", [False, True])
def test_run_that_a_restarted_cell_does_not_know_is_gone(plc, is_held):
    plc.runs()
    if is_held:
        plc.cycle(5, Hold=True)
        take(plc.bridge)
        plc.cycle(2)
    plc.disconnect()
    plc.bridge = Bridge(PlcConfig(), {INSERT: "insert_peg"}, [SPEED], now=lambda: plc.now)
    plc.report = Report(state=4)
    plc.connect()
    assert (plc.cycle(5).shown, plc.v["ErrorID"]) == (["Error"], RUN_GONE)
    assert plc.bridge.poll() is None


@pytest.mark.parametrize(("seconds", "is_reset_by_another"), [(1.4, False), (3.0, True)])
def test_a_plc_that_was_frozen_in_a_run_reads_the_fault_of_its_run(plc, seconds, is_reset_by_another):
    run = plc.runs()
    plc.now += seconds
    assert plc.bridge.poll().code == Control.LOST
    plc.publish(Report(sequence=run.sequence, state=9, result=Result.FAULT, fault=1006))
    if is_reset_by_another:
        plc.publish(Report(sequence=9, state=4, result=Result.SUCCESS))
    assert (plc.cycle(3).shown, plc.v["ErrorID"]) == (["Error"], 1006)
    plc.cycle(3, Execute=False, Code=Control.RESET).cycle(3, Execute=True)
    assert [plc.bridge.poll().code, plc.bridge.poll().code] == [Control.ACKNOWLEDGE, Control.RESET]


def test_a_reset_coil_beside_the_block_hides_no_result(plc):
    run = plc.runs()
    plc.publish(Report(sequence=run.sequence, state=9, result=Result.FAULT, fault=2001))
    for level in (False, True):
        plc.bridge.switched(plc.source, {"reset": level})
    plc.bridge.accept(plc.bridge.poll())
    assert (plc.cycle(3).shown, plc.v["ErrorID"]) == (["Error"], 2001)


def test_plc_that_restarts_behind_a_line_that_stayed_counts_anew(plc):
    for _ in range(20):
        plc.cycle(2, Execute=True).end(Result.SUCCESS)
        plc.cycle(2).cycle(Execute=False)
        plc.bridge.poll()
    plc.restart()
    assert plc.cycle(3, Code=INSERT).cycle(2, Execute=True).shown == ["Busy"]
    assert plc.end(Result.FAILURE).sequence == 1
    assert plc.cycle(2).shown == ["Error"]


def test_sequence_wraps_past_0(kind):
    plc = kind()
    plc.v["Sequence"] = 65535
    plc.cycle(2, Code=INSERT).cycle(2, Execute=True)
    assert plc.end(Result.SUCCESS).sequence == 1
    assert plc.cycle(2).shown == ["Done"]


def test_wide_values_are_put_together(plc):
    plc.cycle(2, Execute=True).end(Result.SUCCESS, run=70_000, total_time=100.5, stage_times=(1.5, 2.25))
    plc.cycle(2)
    assert (plc.v["Run"], plc.v["TotalTime"]) == (70_000, 100.5)
    assert plc.v["StageTime"][1:4] == [1.5, 2.25, 0.0]


def test_comments_are_closed():
    assert TEXT.isascii()
    assert TEXT.count("(*") == TEXT.count("*)")
