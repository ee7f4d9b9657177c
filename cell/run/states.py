"""Cell states, with the names and numbers of PackML, and the table of permitted transitions; pure.

Source: [packml], the state model of TR88. Acting states (`-ing`) end by themselves; wait states end by a command.
"""

from enum import Enum, IntEnum


class State(IntEnum):
    """Cell state; the PLC reads its number."""

    CLEARING = 1
    STOPPED = 2
    STARTING = 3
    IDLE = 4
    SUSPENDED = 5
    EXECUTE = 6
    STOPPING = 7
    ABORTING = 8
    ABORTED = 9
    HOLDING = 10
    HELD = 11
    UNHOLDING = 12
    SUSPENDING = 13
    UNSUSPENDING = 14
    RESETTING = 15
    COMPLETING = 16
    COMPLETE = 17


class Event(Enum):
    """An event that changes the state."""

    RESET = "reset"
    START = "start"
    STOP = "stop"
    HOLD = "hold"
    UNHOLD = "unhold"
    ABORT = "abort"
    CLEAR = "clear"
    FINISHED = "finished"
    """The acting state has done its work."""


ASKED = (Event.RESET, Event.STOP, Event.HOLD, Event.UNHOLD, Event.ABORT, Event.CLEAR)
"""Controls that a PLC or a technician requests by name; START is requested with the name of a program.

The names in line, terminal and records are derived from these.
"""

BEFORE_RESET = (State.ABORTING, State.ABORTED, State.CLEARING, State.STOPPING, State.STOPPED)
"""States in which the cell must be reset before it can start; a requested RESET includes CLEAR in Aborted."""
_STOPPABLE = tuple(state for state in State if state not in BEFORE_RESET)

TRANSITIONS: dict[tuple[State, Event], State] = {
    (State.IDLE, Event.START): State.STARTING,
    (State.STARTING, Event.FINISHED): State.EXECUTE,
    (State.EXECUTE, Event.FINISHED): State.COMPLETING,
    (State.COMPLETING, Event.FINISHED): State.COMPLETE,
    (State.COMPLETE, Event.RESET): State.RESETTING,
    (State.STOPPED, Event.RESET): State.RESETTING,
    (State.RESETTING, Event.FINISHED): State.IDLE,
    (State.EXECUTE, Event.HOLD): State.HOLDING,
    (State.HOLDING, Event.FINISHED): State.HELD,
    (State.HELD, Event.UNHOLD): State.UNHOLDING,
    (State.UNHOLDING, Event.FINISHED): State.EXECUTE,
    (State.UNHOLDING, Event.HOLD): State.HOLDING,
    (State.STOPPING, Event.FINISHED): State.STOPPED,
    (State.ABORTING, Event.FINISHED): State.ABORTED,
    (State.ABORTED, Event.CLEAR): State.CLEARING,
    (State.CLEARING, Event.FINISHED): State.STOPPED,
    **{(state, Event.STOP): State.STOPPING for state in _STOPPABLE},
    **{(state, Event.ABORT): State.ABORTING for state in (*_STOPPABLE, State.STOPPED, State.STOPPING, State.CLEARING)},
}
"""All permitted transitions; those into Suspending and Unsuspending are left out, because no event suspends this cell."""


def is_permitted(state: State, event: Event) -> bool:
    """Return True if `event` causes a transition in `state`."""
    return (state, event) in TRANSITIONS


_REACHED = {Event.STOP: BEFORE_RESET, Event.ABORT: (State.ABORTING, State.ABORTED)}


def is_reached(state: State, event: Event) -> bool:
    """Return True if the stop or abort requested by `event` is already done or under way."""
    return state in _REACHED.get(event, ())


def after(state: State, event: Event) -> State:
    """Return the state after an event; the same state if the event is not permitted."""
    return TRANSITIONS.get((state, event), state)
