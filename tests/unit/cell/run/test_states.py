"""The state model is that of PackML."""

import pytest

from cell.run.line import CONTROLS, TerminalLine
from cell.run.states import ASKED, TRANSITIONS, Event, State, after, is_permitted, is_reached
from plc_bridge.protocol.messages import FIRST_PROGRAM, PACKML, Command, Report


@pytest.mark.parametrize("state", sorted(set(State) - {State.ABORTED, State.ABORTING}))
def test_abort_leads_to_aborted_and_stop_to_stopped(state):
    assert after(after(state, Event.ABORT), Event.FINISHED) is State.ABORTED
    if is_permitted(state, Event.STOP):
        assert after(after(state, Event.STOP), Event.FINISHED) is State.STOPPED


def test_only_idle_starts_and_what_is_not_permitted_changes_nothing():
    assert [state for state in State if is_permitted(state, Event.START)] == [State.IDLE]
    assert after(State.IDLE, Event.HOLD) is State.IDLE
    assert (State.IDLE, State.EXECUTE, State.ABORTED, State.HELD, State.COMPLETE) == (4, 6, 9, 11, 17)


def test_an_aborted_cell_must_be_cleared_before_it_is_reset():
    assert not is_permitted(State.ABORTED, Event.RESET)
    state = State.ABORTED
    for event in (Event.CLEAR, Event.FINISHED, Event.RESET, Event.FINISHED):
        state = after(state, event)
    assert state is State.IDLE


def test_waiting_states_do_not_end_by_themselves():
    waiting = {State.STOPPED, State.IDLE, State.SUSPENDED, State.ABORTED, State.HELD, State.COMPLETE}
    assert {state for state, event in TRANSITIONS if event is Event.FINISHED}.isdisjoint(waiting)


def test_line_and_terminal_name_the_controls_as_the_states_do():
    names = [*(event.name for event in ASKED), "CLEARED", "REFILLED"]
    assert [(word.upper(), control.name) for word, control in CONTROLS.items()] == [(name, name) for name in names]
    assert {control.name for control in PACKML} == {event.name for event in Event} - {"FINISHED"}


@pytest.mark.parametrize(
    ("event", "states"),
    [
        (Event.STOP, [State.CLEARING, State.STOPPED, State.STOPPING, State.ABORTING, State.ABORTED]),
        (Event.ABORT, [State.ABORTING, State.ABORTED]),
        (Event.RESET, []),
        (Event.HOLD, []),
    ],
)
def test_a_stopped_cell_has_reached_a_stop(event, states):
    assert [state for state in State if is_reached(state, event)] == states


def test_a_terminal_gives_its_command_once_the_cell_has_scanned():
    asked = Command(1, FIRST_PROGRAM)
    line = TerminalLine(asked, lambda report: None)
    given = [line.poll()]
    line.publish(Report())
    assert [*given, line.poll(), line.poll()] == [None, asked, None]
