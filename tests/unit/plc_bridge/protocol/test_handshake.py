from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import REMEDIES, UNNUMBERED, Command, Control, LeaseState, Refusal, Report, Result
from plc_bridge.protocol.orders import MOST_WAITING
from plc_bridge.protocol.registers import AFTER_A_LOSS, SERIAL_NUMBER, Lease, Parameter

INSERT, GRASP = 100, 101
SPEED = Parameter("search.speed", "m/s", 1e-4, 0.001, 0.1, "how fast the search moves")


class Line:
    """A handshake, the time, and the last command block of each client."""

    def __init__(self, *sources: str) -> None:
        self.handshake = Handshake(
            {INSERT: "insert_peg", GRASP: "grasp"}, (SPEED,), life_timeout=1.0, lease_timeout=5.0
        )
        self.now = 0.0
        self.images: dict[str, CommandImage] = {}
        for source in sources or ("plc",):
            self.connect(source)

    def connect(self, source, host=None):
        self.handshake.opened(source, host or source, self.now)
        self.images[source] = CommandImage()

    def write(self, source="plc", **changes):
        self.images[source] = replace(self.images[source], **changes)
        self.handshake.wrote(source, self.images[source], self.now)
        return self.answer(source)

    def coils(self, source="plc", **coils):
        self.handshake.switched(source, coils, self.now)
        return self.answer(source)

    def answer(self, source="plc"):
        """Return the report that a client reads, and whether it is busy."""
        image, inputs = self.handshake.answer(source), self.handshake.inputs(source)
        return SimpleNamespace(**asdict(image), is_busy=inputs.busy)

    def poll(self):
        """Take the next command and accept it."""
        command = self.handshake.poll(self.now)
        if command is not None:
            self.handshake.orders.accept(command)
        return command

    def refuse(self, refusal):
        """Take the next command and refuse it."""
        command = self.handshake.poll(self.now)
        self.handshake.orders.refuse(command, refusal)
        return command

    def run(self, sequence=2, source="plc", code=INSERT, **changes):
        """Bring a command to the scan thread."""
        self.write(source, sequence=sequence - 1, code=0)
        self.write(source, sequence=sequence, code=code, **changes)
        command = self.poll()
        assert command is not None
        self.handshake.orders.publish(Report(sequence=sequence, state=6))
        return command

    def end(self, sequence=2, result=Result.SUCCESS, **facts):
        self.handshake.orders.publish(Report(sequence=sequence, state=17, result=result, **facts))


def test_first_sequence_number_is_adopted_and_never_run():
    line = Line()
    answer = line.write(sequence=7, code=INSERT)
    assert line.poll() is None
    assert (answer.answered, answer.refusal, answer.result) == (7, Refusal.ADOPTED, Result.REFUSED)


def test_next_sequence_number_runs_once():
    line = Line()
    assert line.run(recipe=3, serial="A-17") == Command(2, INSERT, 3, "A-17", (), "plc")
    assert line.write().refusal is Refusal.NONE
    assert line.poll() is None


def test_busy_from_acceptance_to_result():
    line = Line()
    line.write(sequence=1)
    assert line.write(sequence=2, code=INSERT).is_busy
    line.poll()
    line.end()
    assert not line.answer("plc").is_busy


def test_result_is_held_until_acknowledged():
    line = Line()
    line.run()
    line.end()
    assert line.write(life=5).result is Result.SUCCESS
    assert line.write(acknowledge=2).result is Result.NONE
    assert line.poll() == Command(2, Control.ACKNOWLEDGE, source="plc")


def test_acknowledging_another_number_leaves_the_result():
    line = Line()
    line.run()
    line.end()
    assert line.write(acknowledge=1).result is Result.SUCCESS


def test_result_gives_way_to_the_next_command():
    line = Line()
    line.run()
    line.end()
    answer = line.write(sequence=3)
    assert (answer.sequence, answer.result, answer.is_busy) == (3, Result.NONE, True)


def test_details_of_the_run_before_are_not_shown_beside_the_next_number():
    line = Line()
    line.run()
    line.end(run=41, stage=5, stage_times=(1.0,))
    report = line.write(sequence=3)
    assert (report.run, report.stage, report.stage_times, report.state) == (0, 0, (), 17)


def test_report_of_the_run_before_does_not_end_the_next_of_the_same_number():
    line = Line("a", "b")
    line.run(2, "a")
    line.end(2)
    line.handshake.release("a")
    line.write("b", sequence=1)
    line.write("b", sequence=2, code=INSERT)
    line.end(2)
    assert line.answer("b").is_busy


def test_another_command_while_busy_is_refused_and_the_run_keeps_its_number():
    line = Line()
    line.run(2)
    answer = line.write(sequence=3, code=GRASP)
    assert (answer.answered, answer.refusal, answer.sequence, answer.result) == (3, Refusal.BUSY, 2, Result.NONE)
    line.end(2)
    assert line.answer("plc").result is Result.SUCCESS


def test_unknown_code_is_refused():
    line = Line()
    line.write(sequence=1)
    answer = line.write(sequence=2, code=150)
    assert (answer.sequence, answer.result, answer.refusal) == (2, Result.REFUSED, Refusal.UNKNOWN_CODE)


@pytest.mark.parametrize("code", [Control.START, 6, 7, 10, 99])
def test_codes_between_the_controls_and_the_programs_are_unknown(code):
    line = Line()
    line.write(sequence=1)
    assert line.write(sequence=2, code=code).refusal is Refusal.UNKNOWN_CODE


@pytest.mark.parametrize(
    ("version", "refusal"),
    [
        (0, Refusal.NONE),
        (0x0200, Refusal.NONE),
        (0x02FF, Refusal.NONE),
        (0x0103, Refusal.VERSION),
        (0x0300, Refusal.VERSION),
    ],
)
def test_only_another_major_version_is_refused(version, refusal):
    line = Line()
    line.write(sequence=1)
    assert line.write(sequence=2, code=INSERT, version=version).refusal is refusal


@pytest.mark.parametrize(
    ("count", "refusal"), [(9, Refusal.PARAMETER), (10, Refusal.NONE), (1000, Refusal.NONE), (1001, Refusal.PARAMETER)]
)
def test_parameters_are_limited(count, refusal):
    line = Line()
    line.write(sequence=1)
    assert line.write(sequence=2, code=INSERT, parameters=((0, count),)).refusal is refusal


def test_parameters_reach_the_command_in_their_unit():
    assert Line().run(parameters=((0, 250),)).parameters == (("search.speed", pytest.approx(0.025)),)


def test_parameter_that_nobody_defined_is_refused():
    line = Line()
    line.write(sequence=1)
    assert line.write(sequence=2, code=INSERT, parameters=((1, 0),)).refusal is Refusal.PARAMETER


def test_serial_number_that_cannot_be_printed_is_refused():
    line = Line()
    line.write(sequence=1)
    assert line.write(sequence=2, code=INSERT, serial="\x07").refusal is Refusal.PARAMETER


def test_torn_block_does_not_count_until_it_is_whole():
    line = Line()
    line.write(sequence=1, life=1, life_tail=1)
    line.write(sequence=2, code=INSERT, life=2)
    assert line.poll() is None
    assert line.write(life_tail=2).is_busy


def test_block_that_stays_torn_is_refused():
    line = Line()
    line.write(sequence=1, life=1, life_tail=1)
    line.write(sequence=2, code=INSERT, life=2)
    line.now = 1.1
    line.poll()
    assert line.answer("plc").refusal is Refusal.TORN
    line.write(life_tail=2)
    assert line.poll() is None


@pytest.mark.parametrize(
    ("behind", "refusal"), [(1, Refusal.LATE), (0x7FFF, Refusal.LATE), (0x8000, Refusal.NONE), (0xFFFF, Refusal.NONE)]
)
def test_a_command_behind_by_up_to_half_of_all_numbers_is_late(behind, refusal):
    line = Line()
    line.write(sequence=100)
    assert line.write(sequence=(100 - behind) % 0x10000, code=INSERT).refusal is refusal


def test_numbers_wrap():
    line = Line()
    line.write(sequence=0xFFFF)
    assert line.write(sequence=0, code=INSERT).is_busy


def test_reconnected_plc_finds_its_result():
    line = Line()
    line.run()
    line.handshake.closed("plc")
    line.end()
    line.connect("plc again", host="plc")
    answer = line.write("plc again", sequence=2, code=INSERT)
    assert (answer.sequence, answer.result, answer.refusal) == (2, Result.SUCCESS, Refusal.NONE)
    assert line.poll() is None


def test_reconnected_plc_does_not_find_the_result_of_another_command_under_its_number():
    line = Line()
    line.run(recipe=1)
    line.end()
    line.handshake.closed("plc")
    line.connect("plc again", host="plc")
    answer = line.write("plc again", sequence=2, code=INSERT, recipe=2)
    assert (answer.result, answer.refusal) == (Result.REFUSED, Refusal.ADOPTED)


def test_simple_plc_gets_the_free_lease_by_starting():
    line = Line()
    line.run()
    assert line.handshake.holder == "plc"


def test_only_the_holder_may_start():
    line = Line("a", "b")
    line.write("a", lease=Lease.TAKE)
    line.write("b", sequence=1)
    answer = line.write("b", sequence=2, code=INSERT)
    assert (answer.refusal, answer.lease, line.poll()) == (Refusal.NOT_HOLDER, LeaseState.TAKEN, None)


def test_refused_client_does_not_disturb_what_the_holder_reads():
    line = Line("a", "b")
    line.run(2, "a")
    line.end(2)
    line.write("b", sequence=1)
    line.write("b", sequence=2, code=INSERT)
    assert line.answer("a").result is Result.SUCCESS
    assert line.answer("b").result is Result.REFUSED


def test_client_that_never_writes_sees_the_run():
    line = Line("a", "screen")
    line.run(2, "a")
    assert (line.answer("screen").sequence, line.answer("screen").answered) == (2, 2)


def test_own_result_stays_when_another_runs():
    line = Line("a", "b")
    line.run(2, "a")
    line.end(2)
    line.write("a", lease=Lease.RELEASE)
    line.run(9, "b")
    line.end(9, Result.FAILURE)
    assert (line.answer("a").sequence, line.answer("a").result) == (2, Result.SUCCESS)


@pytest.mark.parametrize(("silence", "holder"), [(5.0, "plc"), (5.1, "")])
def test_silence_frees_the_lease(silence, holder):
    line = Line()
    line.write(lease=Lease.TAKE)
    line.now = silence
    line.poll()
    assert line.handshake.holder == holder


def test_reading_keeps_the_lease():
    line = Line()
    line.write(lease=Lease.TAKE)
    line.now = 4.0
    line.handshake.heard("plc", line.now)
    line.now = 8.0
    line.poll()
    assert line.handshake.holder == "plc"


def test_local_user_is_never_silent():
    line = Line()
    line.handshake.opened("terminal", "terminal", 0.0, is_local=True)
    line.handshake.take("terminal")
    assert line.handshake.submit("terminal", CommandImage(code=INSERT), 0.0) is Refusal.NONE
    line.now = 1000.0
    assert line.poll() == Command(1, INSERT, source="terminal")
    assert line.handshake.holder == "terminal"


def test_a_link_that_takes_the_lease_and_never_asks_for_anything_loses_it():
    line = Line()
    line.now = 3.0
    line.connect("panel")
    assert line.handshake.take("panel")
    assert not line.handshake.take("plc")
    for now, holder in ((8.0, "panel"), (8.1, "")):
        line.now = now
        line.poll()
        assert line.handshake.holder == holder


def test_a_local_user_reads_the_answer_to_an_order_and_no_more_to_that_of_others():
    line = Line()
    line.run(7)
    line.handshake.opened("terminal", "terminal", 0.0, is_local=True)
    assert line.answer("terminal").sequence == 7
    assert line.handshake.submit("terminal", CommandImage(code=GRASP), 0.5) is Refusal.NOT_HOLDER
    answer = line.answer("terminal")
    assert (answer.sequence, answer.refusal) == (1, Refusal.NOT_HOLDER)


def test_a_local_user_was_heard_last_with_the_newest_order():
    line = Line()
    line.handshake.opened("terminal", "terminal", 0.0, is_local=True)
    line.handshake.submit("terminal", CommandImage(code=INSERT), 0.5)
    assert line.handshake.sight("terminal", 0.75).silence == 0.25


def test_a_run_that_is_lost_is_so_for_the_order_of_a_local_user():
    line = Line()
    line.run()
    line.handshake.opened("terminal", "terminal", 0.0, is_local=True)
    line.handshake.submit("terminal", CommandImage(code=INSERT), 2.0)
    assert line.handshake.counts.lost == 1


@pytest.mark.parametrize("code", [Control.STOP, Control.ABORT])
def test_anybody_may_stop_even_with_a_first_number(code):
    line = Line("a", "b")
    line.run(2, "a")
    line.write("b", sequence=77, code=code)
    assert line.poll() == Command(77, code, source="b")


def test_stop_coil_stops_for_anybody():
    line = Line("a", "b")
    line.run(2, "a")
    line.coils("b", stop=True)
    assert line.poll() == Command(UNNUMBERED, Control.STOP, source="b")


def test_command_that_was_stopped_before_the_scan_never_runs():
    line = Line()
    line.write(sequence=1)
    line.write(sequence=2, code=INSERT)
    line.coils(stop=True)
    assert [line.poll().code, line.poll()] == [Control.STOP, None]
    assert line.answer("plc").result is Result.ABORTED


def test_abort_comes_before_stop():
    line = Line("a", "b")
    line.coils("a", stop=True)
    line.write("b", sequence=1, code=Control.ABORT)
    assert [line.poll().code, line.poll().code] == [Control.ABORT, Control.STOP]


def test_hold_of_the_holder_reaches_a_run_and_leaves_its_number():
    line = Line()
    line.run(2)
    answer = line.write(sequence=3, code=Control.HOLD)
    assert (answer.answered, answer.refusal, answer.sequence) == (2, Refusal.NONE, 2)
    assert line.poll().code == Control.HOLD
    answer = line.write()
    assert (answer.answered, answer.refusal, answer.sequence) == (3, Refusal.NONE, 2)


def test_controls_that_wait_are_limited():
    line = Line()
    line.run(2)
    for number in range(MOST_WAITING):
        assert line.write(sequence=3 + number, code=Control.HOLD).refusal is Refusal.NONE
    assert line.write(sequence=99, code=Control.HOLD).refusal is Refusal.BUSY


def test_reset_just_before_a_start_is_not_lost():
    line = Line()
    line.write(sequence=1)
    line.write(sequence=2, code=Control.RESET)
    line.write(sequence=3, code=INSERT)
    assert [line.poll().code, line.poll().code] == [Control.RESET, INSERT]


def test_refusal_of_the_supervisor_reaches_the_plc():
    line = Line()
    line.write(sequence=1)
    line.write(sequence=2, code=INSERT)
    line.refuse(Refusal.UNKNOWN_RECIPE)
    answer = line.answer("plc")
    assert (answer.result, answer.refusal, answer.is_busy) == (Result.REFUSED, Refusal.UNKNOWN_RECIPE, False)
    assert line.handshake.counts.refusals == 1


def test_refusal_of_a_control_leaves_the_run_and_its_result_alone():
    line = Line()
    line.run()
    line.write(sequence=3, code=Control.UNHOLD)
    line.refuse(Refusal.NOT_READY)
    answer = line.answer("plc")
    assert (answer.answered, answer.refusal, answer.sequence, answer.is_busy) == (3, Refusal.NOT_READY, 2, True)
    line.end()
    assert line.answer("plc").result is Result.SUCCESS


def test_refusal_of_a_control_of_somebody_who_runs_nothing_is_its_result():
    line = Line()
    line.run()
    line.end()
    line.write(sequence=3, code=Control.UNHOLD)
    control = line.handshake.poll(line.now)
    line.write(sequence=4, code=INSERT)
    line.handshake.orders.refuse(control, Refusal.NOT_READY)
    assert line.answer("plc").answered == 3
    line.poll()
    assert line.answer("plc").answered == 4
    assert line.handshake.counts.refusals == 1


@pytest.mark.parametrize(("silence", "is_lost"), [(1.0, False), (1.01, True)])
def test_run_is_lost_when_the_life_counter_stands_still(silence, is_lost):
    line = Line()
    line.run(life=1)
    line.now = silence
    line.write()
    command = line.poll()
    assert (command == Command(2, Control.LOST, source="plc")) is is_lost


def test_lost_is_said_once_and_takes_the_lease():
    line = Line()
    line.run(life=1)
    line.now = 2.0
    assert [line.poll().code, line.poll()] == [Control.LOST, None]
    assert line.handshake.holder == ""


def test_the_first_reset_after_a_loss_is_refused_with_what_to_do_and_the_next_is_obeyed(caplog):
    line = Line()
    line.run()
    line.now = 1.5
    assert line.poll().code == Control.LOST
    line.handshake.orders.publish(Report(sequence=2, state=2, result=Result.ABORTED))
    answer = line.write(sequence=3, code=Control.RESET)
    assert (answer.answered, answer.refusal, answer.refusal_detail) == (3, Refusal.ADOPTED, AFTER_A_LOSS)
    assert "send the same command under the next number" in caplog.text
    line.write(sequence=4)
    assert line.poll() == Command(4, Control.RESET, source="plc")


def test_a_first_number_without_a_loss_has_no_detail():
    answer = Line().write(sequence=3, code=Control.RESET)
    assert (answer.refusal, answer.refusal_detail) == (Refusal.ADOPTED, 0)


@pytest.mark.parametrize("refusal", [each for each in Refusal if each is not Refusal.NONE])
def test_every_refusal_says_what_to_do(refusal):
    assert REMEDIES[refusal]


def test_lost_plc_has_to_begin_with_a_number_that_is_adopted():
    line = Line()
    line.run(life=1)
    line.now = 2.0
    line.poll()
    line.end(result=Result.FAULT, fault=1006)
    assert line.write(life=9, sequence=3).refusal is Refusal.ADOPTED


def test_client_without_a_life_counter_is_not_judged_by_one_that_closed_before():
    line = Line()
    line.run(life=1)
    line.end()
    line.handshake.closed("plc")
    line.connect("another", host="plc")
    line.run(4, "another")
    for _ in range(4):
        line.now += 0.9
        line.handshake.heard("another", line.now)
        assert line.poll() is None


def test_client_without_a_life_counter_lives_by_its_requests():
    line = Line()
    line.run()
    line.now = 0.9
    line.handshake.heard("plc", line.now)
    line.now = 1.8
    assert line.poll() is None
    line.now = 2.0
    assert line.poll().code == Control.LOST


def test_idle_cell_does_not_mind_a_silent_plc():
    line = Line()
    line.run(life=1)
    line.end()
    line.now = 100.0
    assert line.poll() is None


def test_reconnected_plc_keeps_its_run_alive():
    line = Line()
    line.run(life=1)
    line.handshake.closed("plc")
    line.now = 0.8
    line.connect("plc again", host="plc")
    line.write("plc again", sequence=2, code=INSERT, life=2)
    line.now = 1.6
    assert line.poll() is None
    assert line.handshake.holder == "plc again"


def test_execute_coil_runs_on_its_rising_edge():
    line = Line()
    line.write(code=INSERT)
    line.coils(execute=False)
    assert line.coils(execute=True).is_busy
    line.coils(execute=True)
    assert [line.poll().code, line.poll()] == [INSERT, None]


def test_execute_coil_that_is_on_from_the_first_write_does_not_run():
    line = Line()
    line.write(code=INSERT)
    line.coils(execute=True)
    assert line.poll() is None


def test_execute_coil_acknowledges_when_it_falls_but_not_before_the_end():
    line = Line()
    line.write(code=INSERT)
    line.coils(execute=False)
    line.coils(execute=True)
    line.poll()
    line.coils(execute=False)
    line.end(1)
    assert line.answer("plc").result is Result.SUCCESS
    assert line.coils(execute=False).result is Result.NONE


def test_reset_coil_resets_on_its_rising_edge():
    line = Line()
    line.coils(reset=False)
    line.coils(reset=True)
    assert line.poll() == Command(1, Control.RESET, source="plc")


def test_every_refusal_is_counted():
    line = Line()
    line.write(sequence=5, code=INSERT)
    line.write(sequence=6, code=999)
    assert line.handshake.counts.refusals == 2


@pytest.mark.parametrize(
    ("what", "detail"),
    [({"parameters": ((0, 9),)}, 1), ({"parameters": ((1, 0),)}, 2), ({"serial": "\x07"}, SERIAL_NUMBER)],
)
def test_a_parameter_that_is_refused_is_named(what, detail):
    line = Line()
    line.write(sequence=1)
    answer = line.write(sequence=2, code=INSERT, **what)
    assert (answer.refusal, answer.refusal_detail) == (Refusal.PARAMETER, detail)


@pytest.mark.parametrize("code", [Control.STOP, Control.HOLD])
def test_a_control_in_the_middle_of_a_run_has_its_own_result(code):
    line = Line()
    line.run(2)
    line.write(sequence=3, code=code)
    line.poll()
    answer = line.write()
    assert (answer.answered, answer.answered_result, answer.sequence) == (3, Result.SUCCESS, 2)


def test_ready_says_whether_a_start_of_this_link_would_be_taken():
    line = Line("a", "b")
    line.handshake.orders.publish(Report(state=4))
    ready = lambda source: line.handshake.inputs(source).ready  # noqa: E731
    assert (ready("a"), ready("b")) == (True, True)
    line.write("a", lease=Lease.TAKE)
    assert (ready("a"), ready("b")) == (True, False)
    line.coils("b", stop=True)
    assert not ready("a")
    line.coils("b", stop=False)
    line.run(2, "a")
    assert not ready("a")


@pytest.mark.parametrize(
    "later", [[(3, Control.HOLD)], [(3, Control.HOLD), (4, Control.UNHOLD)], [(3, INSERT)], [(3, Control.NONE)]]
)
@pytest.mark.parametrize("again", [False, True])
def test_a_run_is_found_by_the_number_that_its_connection_had_come_to(later, again):
    line = Line()
    line.run()
    for sequence, code in later:
        line.write(sequence=sequence, code=code)
        line.poll()
    line.handshake.closed("plc")
    line.connect("plc again", host="plc")
    sequence, code = later[-1]
    answer = line.write("plc again", sequence=sequence, code=code if again else Control.NONE)
    assert (answer.sequence, answer.is_busy, answer.lease) == (2, True, LeaseState.YOURS)
    assert line.poll() is None
    line.end()
    answer = line.answer("plc again")
    assert (answer.sequence, answer.result) == (2, Result.SUCCESS)
    line.write("plc again", acknowledge=2)
    assert line.poll().code == Control.ACKNOWLEDGE
    assert line.write("plc again", sequence=sequence + 1, code=INSERT).is_busy


def test_a_stop_that_stands_in_the_block_of_a_new_connection_stops_again():
    line = Line()
    line.run()
    line.write(sequence=3, code=Control.STOP)
    line.poll()
    line.handshake.closed("plc")
    line.connect("plc again", host="plc")
    answer = line.write("plc again", sequence=3, code=Control.STOP)
    assert line.poll().code == Control.STOP
    assert answer.sequence == 2
    line.end(result=Result.ABORTED)
    assert line.answer("plc again").result is Result.ABORTED


@pytest.mark.parametrize("changed", [{"sequence": 4}, {"code": GRASP}, {"recipe": 1}])
def test_another_number_or_command_does_not_find_the_run(changed):
    line = Line()
    line.run()
    line.write(sequence=3, code=Control.HOLD)
    line.poll()
    line.handshake.closed("plc")
    line.connect("plc again", host="plc")
    answer = line.write("plc again", **{"sequence": 3, "code": Control.HOLD, **changed})
    assert (answer.refusal, answer.sequence) == (Refusal.ADOPTED, changed.get("sequence", 3))


def test_a_plc_that_asks_once_more_is_told_its_result_once_more():
    line = Line()
    line.run()
    line.end()
    line.write(acknowledge=2)
    line.handshake.closed("plc")
    line.connect("plc again", host="plc")
    assert line.write("plc again", sequence=2, code=INSERT, acknowledge=0).result is Result.SUCCESS
    assert line.write("plc again", acknowledge=2).result is Result.NONE


def test_a_plc_that_comes_back_with_the_number_alone_of_a_result_that_it_has_read_is_not_told_again():
    line = Line()
    line.run()
    line.end()
    line.write(acknowledge=2)
    line.handshake.closed("plc")
    line.connect("plc again", host="plc")
    answer = line.write("plc again", sequence=2, code=Control.NONE)
    assert (answer.sequence, answer.refusal, answer.result) == (2, Refusal.NONE, Result.NONE)


@pytest.mark.parametrize("is_first", [True, False])
def test_a_command_under_a_number_that_came_empty_is_refused_and_not_left_without_an_answer(is_first):
    line = Line()
    sequence = 70 if is_first else 71
    for number in range(70, sequence + 1):
        assert line.write(sequence=number, code=0).refusal is Refusal.NONE
    answer = line.write(code=INSERT)
    assert (answer.answered, answer.refusal, answer.result) == (sequence, Refusal.ADOPTED, Result.REFUSED)
    assert line.poll() is None
    assert line.write(sequence=sequence + 1).is_busy


@pytest.mark.parametrize("code", [Control.STOP, Control.ABORT])
def test_a_stop_under_a_number_that_is_known_stops(code):
    line = Line()
    line.run()
    line.write(code=code)
    assert line.poll().code == code
    line.write()
    assert line.poll() is None


def test_the_number_of_the_run_that_comes_late_changes_nothing():
    line = Line()
    line.run()
    line.write(sequence=3, code=Control.HOLD)
    line.poll()
    before = line.answer("plc")
    assert line.write(sequence=2, code=INSERT) == before
    assert line.write(sequence=3, code=Control.HOLD) == before
    line.end()
    assert line.answer("plc").result is Result.SUCCESS


def test_a_hold_that_crosses_the_end_of_the_run_does_not_hide_its_result():
    line = Line()
    line.run()
    line.end()
    line.write(sequence=3, code=Control.HOLD)
    line.refuse(Refusal.NOT_READY)
    answer = line.answer("plc")
    assert (answer.sequence, answer.result) == (2, Result.SUCCESS)
    assert (answer.answered, answer.refusal) == (3, Refusal.NOT_READY)


def test_inputs_are_ready_only_where_a_start_would_be_taken():
    line = Line()
    line.handshake.orders.publish(Report(state=4))
    assert line.handshake.inputs("plc").ready
    line.handshake.orders.publish(Report(state=4, obstacle=Refusal.PART_UNRESOLVED))
    assert not line.handshake.inputs("plc").ready


def test_a_refused_reset_is_an_error_also_beside_a_control_that_execute_gave():
    line = Line()
    line.write(sequence=1, code=Control.STOP)
    line.poll()
    line.write(sequence=2, code=0)
    line.images["plc"] = replace(line.images["plc"], code=Control.CLEARED)
    line.handshake.wrote("plc", line.images["plc"], line.now, is_numbered=False)
    line.coils(execute=False)
    line.coils(execute=True)
    line.poll()
    line.coils(reset=True)
    inputs = line.handshake.inputs("plc")
    assert (inputs.busy, inputs.done, inputs.error) == (False, False, True)


def test_what_is_seen_of_a_plc_is_told_at_the_time_of_the_question():
    line = Line()
    assert line.handshake.sight("plc", 0.0) is None
    line.write(life=1, version=2)
    line.now = 0.5
    line.write(life=2)
    seen = line.handshake.sight("plc", 0.75)
    assert (seen.source, seen.version, seen.silence) == ("plc", 2, pytest.approx(0.25))
    assert line.handshake.sight("another", 0.75) is None
