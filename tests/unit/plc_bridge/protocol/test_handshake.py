"""Answers of the handshake to its links; what holds in every sequence of steps is in test_rough_line."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import (
    AFTER_A_LOSS,
    REMEDIES,
    SERIAL_NUMBER,
    UNNUMBERED,
    Command,
    Control,
    LeaseState,
    Refusal,
    Report,
    Result,
)
from plc_bridge.protocol.orders import MOST_WAITING
from plc_bridge.protocol.registers import Lease, Parameter

INSERT, GRASP = 100, 101
AGAIN = "plc again"
"""The second connection of the PLC."""
SPEED = Parameter("search.speed", "m/s", 1e-4, 0.001, 0.1, "how fast the search moves")


class Line:
    """A handshake, the time, and the last command block of each client."""

    def __init__(self, *sources: str) -> None:
        self.handshake = Handshake({INSERT: "insert_peg", GRASP: "grasp"}, (SPEED,), 1.0, 5.0, now=lambda: self.now)
        self.now = 0.0
        self.images: dict[str, CommandImage] = {}
        for source in sources or ("plc",):
            self.connect(source)

    def connect(self, source, host=None):
        self.handshake.opened(source, host or source)
        self.images[source] = CommandImage()

    def reconnect(self):
        """Close the connection of the PLC and open its second."""
        self.handshake.closed("plc")
        self.connect(AGAIN, host="plc")

    def write(self, source="plc", is_numbered=True, **changes):
        self.images[source] = replace(self.images[source], **changes)
        self.handshake.wrote(source, self.images[source], is_numbered)
        return self.answer(source)

    def coils(self, source="plc", **coils):
        self.handshake.switched(source, coils)
        return self.answer(source)

    def answer(self, source="plc"):
        """Return the report that a client reads, and whether it is busy."""
        image, inputs = self.handshake.report_for(source), self.handshake.inputs(source)
        return SimpleNamespace(**asdict(image), is_busy=inputs.busy)

    def poll(self):
        """Take the next command and accept it."""
        command = self.handshake.poll()
        if command is not None:
            self.handshake.accept(command)
        return command

    def refuse(self, refusal):
        """Take the next command and refuse it."""
        self.handshake.refuse(self.handshake.poll(), refusal)

    def ask(self, sequence=2, source="plc", code=INSERT, **changes):
        """Write an empty number, and a command under the next."""
        self.write(source, sequence=sequence - 1, code=0)
        return self.write(source, sequence=sequence, **{"code": code, **changes})

    def run(self, sequence=2, source="plc", **changes):
        """Bring a command to the scan thread."""
        self.ask(sequence, source, **changes)
        assert self.poll() is not None
        self.handshake.publish(Report(sequence=sequence, state=6))

    def end(self, sequence=2, result=Result.SUCCESS, **facts):
        self.handshake.publish(Report(sequence=sequence, state=17, result=result, **facts))

    def ended(self, source="plc", recipe=0, life=0, **facts):
        """Let a run succeed, and return the line."""
        self.run(source=source, recipe=recipe, life=life)
        self.end(**facts)
        return self


@pytest.fixture
def line():
    return Line()


def test_next_sequence_number_runs_once_and_is_busy_until_its_result(line):
    assert line.ask(recipe=3, serial="A-17", parameters=((0, 250),)).is_busy
    assert line.poll() == Command(2, INSERT, 3, "A-17", (("search.speed", pytest.approx(0.025)),), "plc")
    assert (line.write().refusal, line.poll(), line.answer().is_busy) == (Refusal.NONE, None, True)
    line.end()
    assert not line.answer().is_busy


def test_result_is_held_until_its_own_number_is_acknowledged():
    line = Line().ended()
    assert line.write(life=5).result is Result.SUCCESS
    assert line.write(acknowledge=1).result is Result.SUCCESS
    assert line.write(acknowledge=2).result is Result.NONE
    assert line.poll() == Command(2, Control.ACKNOWLEDGE, source="plc")


def test_result_and_its_details_give_way_to_the_next_command():
    line = Line().ended(run=41, stage=5, stage_times=(1.0,))
    answer = line.write(sequence=3)
    assert (answer.sequence, answer.result, answer.is_busy) == (3, Result.NONE, True)
    assert (answer.run, answer.stage, answer.stage_times, answer.state) == (0, 0, (), 17)


def test_a_late_report_does_not_end_the_next_run():
    line = Line("a", "b").ended(source="a")
    line.write("a", lease=Lease.RELEASE)
    line.ask(source="b")
    line.end()
    assert line.answer("b").is_busy


@pytest.mark.parametrize(
    ("changes", "refusal", "detail"),
    [
        ({"code": Control.START}, Refusal.UNKNOWN_CODE, 0),
        ({"code": 6}, Refusal.UNKNOWN_CODE, 0),
        ({"code": 10}, Refusal.UNKNOWN_CODE, 0),
        ({"code": 99}, Refusal.UNKNOWN_CODE, 0),
        ({"code": 150}, Refusal.UNKNOWN_CODE, 0),
        ({"version": 0x0200}, Refusal.NONE, 0),
        ({"version": 0x02FF}, Refusal.NONE, 0),
        ({"version": 0x0103}, Refusal.VERSION, 0),
        ({"version": 0x0300}, Refusal.VERSION, 0),
        ({"parameters": ((0, 9),)}, Refusal.PARAMETER, 1),
        ({"parameters": ((0, 10),)}, Refusal.NONE, 0),
        ({"parameters": ((0, 1000),)}, Refusal.NONE, 0),
        ({"parameters": ((0, 1001),)}, Refusal.PARAMETER, 1),
        ({"parameters": ((1, 0),)}, Refusal.PARAMETER, 2),
        ({"serial": "\x07"}, Refusal.PARAMETER, SERIAL_NUMBER),
    ],
)
def test_commands_beyond_their_limits_are_refused_with_the_detail(line, changes, refusal, detail):
    answer = line.ask(**changes)
    assert (answer.sequence, answer.refusal, answer.refusal_detail) == (2, refusal, detail)
    assert (answer.result is Result.REFUSED, line.poll() is None) == (refusal is not Refusal.NONE,) * 2
    assert line.handshake.diagnostics.refusals == (refusal is not Refusal.NONE)


def test_a_torn_block_counts_once_whole_until_the_timeout():
    for now, tail_gives, refusal in ((1.0, True, Refusal.NONE), (1.01, False, Refusal.TORN)):
        line = Line()
        line.write(sequence=1, life=1, life_tail=1)
        line.write(sequence=2, code=INSERT, life=2)
        line.now = 0.9
        line.write(life=3)
        line.now = now
        assert line.poll() is None
        assert line.answer().refusal is refusal
        assert line.write(life_tail=3).is_busy is tail_gives


def test_a_known_number_in_a_block_that_stays_torn_changes_nothing(line):
    line.run(life=1, life_tail=1)
    line.end()
    before = line.write()
    line.write(life=2)
    line.now = 1.1
    assert line.poll() is None
    assert line.answer() == before


def test_a_block_in_halves_acknowledges(line):
    line.run(life=1, life_tail=1)
    line.end()
    line.write(life=2, acknowledge=2)
    assert line.write(life_tail=2).result is Result.NONE


def test_a_torn_stop_under_the_number_of_the_run_stops_once(line):
    line.run(life=1, life_tail=1)
    for life in (2, 3):
        line.write(life=life, code=Control.STOP)
    assert [command.code for command in iter(line.poll, None)] == [Control.STOP]


@pytest.mark.parametrize(
    ("recipe", "result", "refusal"), [(1, Result.SUCCESS, Refusal.NONE), (2, Result.REFUSED, Refusal.ADOPTED)]
)
def test_reconnected_plc_finds_the_result_of_the_same_command_only(recipe, result, refusal):
    line = Line().ended(recipe=1)
    line.reconnect()
    answer = line.write(AGAIN, sequence=2, code=INSERT, recipe=recipe)
    assert (answer.sequence, answer.result, answer.refusal, answer.refusal_detail) == (2, result, refusal, 0)
    assert line.poll() is None


# The lease, and links side by side.


def test_a_link_reads_any_run_until_its_first_write():
    line = Line("a", "b", "screen")
    line.run(source="a")
    assert (line.answer("screen").sequence, line.answer("screen").answered) == (2, 2)
    line.end()
    line.write("a", lease=Lease.RELEASE)
    line.run(9, "b")
    line.end(9, Result.FAILURE)
    assert (line.answer("a").sequence, line.answer("a").result) == (2, Result.SUCCESS)


@pytest.mark.parametrize(
    ("host", "holder_closes", "is_taken"),
    [("a", "first", True), ("a", "never", False), ("a", "last", False), ("b", "first", False)],
)
def test_only_a_link_opened_after_its_host_closed_the_holder_takes_over(host, holder_closes, is_taken):
    line = Line()
    line.connect("old", host)
    line.write("old", lease=Lease.TAKE)
    if holder_closes == "first":
        line.handshake.closed("old")
    line.connect("new", "a")
    if holder_closes == "last":
        line.handshake.closed("old")
    assert (line.write("new", lease=Lease.TAKE).lease is LeaseState.YOURS) is is_taken


def test_ready_is_true_if_a_start_of_this_link_would_be_taken():
    line = Line("a", "b")
    ready = lambda: tuple(line.handshake.inputs(source).ready for source in "ab")  # noqa: E731
    line.handshake.publish(Report(state=4, obstacle=Refusal.PART_UNRESOLVED))
    assert ready() == (False, False)
    line.handshake.publish(Report(state=4))
    assert ready() == (True, True)
    line.write("a", lease=Lease.TAKE)
    assert ready() == (True, False)
    line.coils("b", stop=True)
    assert ready() == (False, False)
    line.coils("b", stop=False)
    line.run(source="a")
    assert ready() == (False, False)


# A user of the page, whose orders have no numbers of their own.


def test_a_user_reads_any_run_until_the_first_order():
    line = Line("plc", "page")
    line.run(7)
    assert line.answer("page").sequence == 7
    assert line.handshake.submit("page", CommandImage(code=GRASP)) is Refusal.NOT_HOLDER
    assert (line.answer("page").sequence, line.answer("page").refusal) == (1, Refusal.NOT_HOLDER)
    line.now = 2.0
    line.handshake.submit("page", CommandImage(code=INSERT))
    assert line.handshake.diagnostics.lost == 1
    line.poll()
    line.end(7, Result.FAULT)
    assert line.handshake.submit("page", CommandImage(code=INSERT)) is Refusal.NONE
    assert line.poll() == Command(3, INSERT, source="page")


# Stops and other controls.


@pytest.mark.parametrize("code", [Control.STOP, Control.ABORT])
@pytest.mark.parametrize("source", ["a", "b"])
def test_anybody_may_stop_once_under_a_first_and_under_a_known_number(code, source):
    line = Line("a", "b")
    line.run(source="a")
    line.write(source, sequence=77 if source == "b" else 2, code=code)
    line.write(source)
    commands = [line.poll(), line.poll()]
    assert (commands[0].code, commands[0].source, commands[1]) == (code, source, None)


def test_first_come_first_served_and_what_follows_a_stop_waits_for_it(line):
    line.write(sequence=1, code=Control.STOP)
    line.write(sequence=2, code=INSERT)
    line.write(sequence=3, code=Control.HOLD)
    assert [command.code for command in iter(line.poll, None)] == [Control.STOP, INSERT, Control.HOLD]


def test_two_stops_of_the_same_kind_are_decided_together():
    line = Line("a", "b")
    for source in "ab":
        line.write(source, sequence=5, code=Control.STOP)
    assert [command.code for command in iter(line.poll, None)] == [Control.STOP]
    assert [line.answer(source).answered_result for source in "ab"] == [Result.SUCCESS] * 2


def test_a_stop_goes_first_and_what_waited_never_runs():
    line = Line("a", "b")
    line.ask(source="a")
    line.coils("b", stop=True)
    assert [line.poll(), line.poll()] == [Command(UNNUMBERED, Control.STOP, source="b"), None]
    assert line.answer("a").result is Result.ABORTED


def test_abort_comes_before_stop():
    line = Line("a", "b")
    line.coils("a", stop=True)
    line.write("b", sequence=1, code=Control.ABORT)
    assert [line.poll().code, line.poll().code] == [Control.ABORT, Control.STOP]


@pytest.mark.parametrize("code", [Control.HOLD, Control.STOP])
def test_a_control_in_a_run_has_its_own_result_and_leaves_the_number(line, code):
    line.run()
    answer = line.write(sequence=3, code=code)
    assert (answer.answered, answer.refusal, answer.sequence) == (2, Refusal.NONE, 2)
    assert line.poll().code == code
    answer = line.write()
    assert (answer.answered, answer.answered_result, answer.sequence) == (3, Result.SUCCESS, 2)


def test_controls_that_wait_are_limited(line):
    line.run()
    for number in range(MOST_WAITING):
        assert line.write(sequence=3 + number, code=Control.HOLD).refusal is Refusal.NONE
    assert line.write(sequence=99, code=Control.HOLD).refusal is Refusal.BUSY


@pytest.mark.parametrize("is_over", [False, True])
def test_refusal_of_a_control_leaves_the_run_and_its_result_alone(line, is_over):
    line.run()
    if is_over:
        line.end()
    line.write(sequence=3, code=Control.HOLD)
    line.refuse(Refusal.NOT_READY)
    answer = line.answer()
    assert (answer.answered, answer.refusal, answer.sequence) == (3, Refusal.NOT_READY, 2)
    assert answer.is_busy is not is_over
    line.end()
    assert line.answer().result is Result.SUCCESS


def test_a_refused_control_does_not_answer_the_next_command():
    line = Line().ended()
    line.write(sequence=3, code=Control.UNHOLD)
    control = line.handshake.poll()
    line.write(sequence=4, code=INSERT)
    line.handshake.refuse(control, Refusal.NOT_READY)
    assert line.answer().answered == 3
    line.poll()
    assert line.answer().answered == 4
    assert line.handshake.diagnostics.refusals == 1


# Signs of life.


@pytest.mark.parametrize(("silence", "is_lost"), [(1.0, False), (1.01, True)])
def test_a_life_counter_that_stands_still_loses_run_and_lease(line, silence, is_lost):
    line.run(life=1)
    line.now = silence
    line.write()
    assert [line.poll(), line.poll()] == [Command(2, Control.LOST, source="plc") if is_lost else None, None]
    assert line.handshake.holder == ("" if is_lost else "plc")


def test_a_number_after_a_loss_is_adopted_with_the_remedy(line, caplog):
    line.run(life=1)
    line.now = 1.5
    assert line.poll().code == Control.LOST
    line.end(result=Result.ABORTED)
    answer = line.write(sequence=3, code=Control.RESET, life=9)
    assert (answer.answered, answer.refusal, answer.refusal_detail) == (3, Refusal.ADOPTED, AFTER_A_LOSS)
    assert "send the same command under the next number" in caplog.text
    line.write(sequence=4)
    assert line.poll() == Command(4, Control.RESET, source="plc")


@pytest.mark.parametrize("refusal", [each for each in Refusal if each is not Refusal.NONE])
def test_every_refusal_has_a_remedy(refusal):
    assert REMEDIES[refusal]


def test_a_client_without_a_life_counter_lives_by_its_own_requests():
    line = Line().ended(life=1)  # by another client of the same host, which had a counter
    line.handshake.closed("plc")
    line.connect("another", host="plc")
    line.run(4, "another")
    for _ in range(4):
        line.now += 0.9
        line.handshake.heard("another")
        assert line.poll() is None
    line.now += 1.1
    assert line.poll().code == Control.LOST


def test_idle_cell_does_not_mind_a_silent_plc():
    line = Line().ended(life=1)
    line.now = 100.0
    assert line.poll() is None


def test_reconnected_plc_keeps_its_run_alive(line):
    line.run(life=1)
    line.now = 0.8
    line.reconnect()
    line.write(AGAIN, sequence=2, code=INSERT, life=2)
    line.now = 1.6
    assert line.poll() is None
    assert line.handshake.holder == AGAIN


def test_sight_of_a_plc_is_that_of_the_time_of_the_question(line):
    assert line.handshake.sight("plc") is None
    line.write(life=1, version=2)
    line.now = 0.5
    line.write(life=2)
    line.now = 0.75
    seen = line.handshake.sight("plc")
    assert (seen.source, seen.version, seen.silence) == ("plc", 2, pytest.approx(0.25))
    assert line.handshake.sight("another") is None


# Coils.


@pytest.mark.parametrize(("coil", "code"), [("execute", INSERT), ("reset", Control.RESET)])
def test_a_coil_acts_on_its_rising_edge_alone(coil, code):
    for levels, commands in (((False, True, True), [code]), ((True, True), [])):
        line = Line()
        line.write(code=INSERT)
        for level in levels:
            line.coils(**{coil: level})
        assert [command.code for command in iter(line.poll, None)] == commands


def test_execute_coil_acknowledges_only_a_result_that_was_read(line):
    line.write(code=INSERT, is_numbered=False)
    line.coils(execute=False)
    assert line.coils(execute=True).is_busy
    line.poll()
    assert line.coils(execute=False).is_busy
    line.end(1)
    assert line.coils(execute=False).result is Result.SUCCESS
    assert line.handshake.inputs("plc").done
    assert line.coils(execute=False).result is Result.NONE
    assert not line.handshake.inputs("plc").done


def test_a_coil_of_a_link_takes_no_number_of_its_block(line):
    line.write(sequence=0xFFFF, code=0)
    line.coils(reset=False)
    line.coils(reset=True)
    assert (line.poll().code, line.answer().sequence == 0) == (Control.RESET, False)
    answer = line.write(sequence=0, code=INSERT)
    assert (answer.sequence, answer.result, answer.is_busy) == (0, Result.NONE, True)
    assert line.poll() == Command(0, INSERT, source="plc")


def test_a_refused_reset_beside_a_served_execute_is_an_error(line):
    line.write(sequence=1, code=Control.STOP)
    line.poll()
    line.write(sequence=2, code=0)
    line.write(code=Control.CLEARED, is_numbered=False)
    line.coils(execute=False)
    line.coils(execute=True)
    line.poll()
    line.coils(reset=True)
    inputs = line.handshake.inputs("plc")
    assert (inputs.busy, inputs.done, inputs.error) == (False, False, True)


# A new connection of the same host.


@pytest.mark.parametrize(
    "later", [[(3, Control.HOLD)], [(3, Control.HOLD), (4, Control.UNHOLD)], [(3, INSERT)], [(3, Control.NONE)]]
)
@pytest.mark.parametrize("again", [False, True])
def test_a_run_is_found_by_the_last_number_of_its_connection(line, later, again):
    line.run()
    for sequence, code in later:
        line.write(sequence=sequence, code=code)
        line.poll()
    line.reconnect()
    sequence, code = later[-1]
    answer = line.write(AGAIN, sequence=sequence, code=code if again else Control.NONE)
    assert (answer.sequence, answer.is_busy, answer.lease) == (2, True, LeaseState.YOURS)
    assert line.poll() is None
    line.end()
    answer = line.answer(AGAIN)
    assert (answer.sequence, answer.result) == (2, Result.SUCCESS)
    line.write(AGAIN, acknowledge=2)
    assert line.poll().code == Control.ACKNOWLEDGE
    assert line.write(AGAIN, sequence=sequence + 1, code=INSERT).is_busy


@pytest.mark.parametrize("changed", [{"sequence": 4}, {"code": GRASP}, {"recipe": 1}])
def test_another_number_or_command_does_not_find_the_run(line, changed):
    line.run()
    line.write(sequence=3, code=Control.HOLD)
    line.poll()
    line.reconnect()
    answer = line.write(AGAIN, **{"sequence": 3, "code": Control.HOLD, **changed})
    assert (answer.refusal, answer.sequence) == (Refusal.ADOPTED, changed.get("sequence", 3))


def test_a_stop_in_the_block_of_a_new_connection_stops_again(line):
    line.run()
    line.write(sequence=3, code=Control.STOP)
    line.poll()
    line.reconnect()
    answer = line.write(AGAIN, sequence=3, code=Control.STOP)
    assert (line.poll().code, answer.sequence) == (Control.STOP, 2)
    line.end(result=Result.ABORTED)
    assert line.answer(AGAIN).result is Result.ABORTED


@pytest.mark.parametrize(("code", "result"), [(INSERT, Result.SUCCESS), (Control.NONE, Result.NONE)])
def test_an_acknowledged_result_is_read_again_only_by_the_whole_command(code, result):
    line = Line().ended()
    line.write(acknowledge=2)
    line.reconnect()
    answer = line.write(AGAIN, sequence=2, code=code)
    assert (answer.sequence, answer.refusal, answer.result) == (2, Refusal.NONE, result)
    assert line.write(AGAIN, acknowledge=2).result is Result.NONE


@pytest.mark.parametrize("last", [70, 71])
def test_a_command_under_a_number_that_came_empty_is_refused(line, last):
    for number in range(70, last + 1):
        assert line.write(sequence=number, code=0).refusal is Refusal.NONE
    answer = line.write(code=INSERT)
    assert (answer.answered, answer.refusal, answer.result) == (last, Refusal.ADOPTED, Result.REFUSED)
    assert line.poll() is None
    assert line.write(sequence=last + 1).is_busy


def test_the_number_of_the_run_that_comes_late_changes_nothing(line):
    line.run()
    line.write(sequence=3, code=Control.HOLD)
    line.poll()
    before = line.answer()
    assert line.write(sequence=2, code=INSERT) == before
    assert line.write(sequence=3, code=Control.HOLD) == before
    line.end()
    assert line.answer().result is Result.SUCCESS
