"""The answers that links read about their commands: the report, composed only here, and the discrete inputs; pure."""

from dataclasses import dataclass, replace

from plc_bridge.protocol.links import Link, Order
from plc_bridge.protocol.messages import Command, Control, Refusal, Report, Result
from plc_bridge.protocol.orders import Orders
from plc_bridge.protocol.registers import VERSION

IDLE, COMPLETE = 4, 17
"""States of PackML in which a start is accepted."""
_NO_ORDER = Order(Command(0, Control.NONE))
_OF_A_RUN = ("stage", "reason", "progress", "run", "stage_times", "total_time", "peak_force", "hole")
"""Fields of the report that belong to a run; the others belong to the cell or to the link."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """The discrete inputs of one link, by name; done, error and command_aborted are held until acknowledged."""

    busy: bool
    done: bool
    error: bool
    command_aborted: bool
    ready: bool
    """True if a start of this link would be accepted now; the one input that needs no acknowledgement."""


def answer_for(link: Link, orders: Orders, life: int = 0) -> Report:
    """Return the report that `link` reads; before a link's first command this is the run of any link."""
    shown, answered = link.in_view, link.answered
    if not link.has_spoken:
        shown, answered = orders.run or orders.seen, orders.latest
    shown, answered = shown or _NO_ORDER, answered or _NO_ORDER
    return replace(
        orders.report,
        **{name: getattr(shown.report, name) for name in _OF_A_RUN},
        life=life,
        life_tail=life,
        version=VERSION,
        lease=orders.lease.state_for(link),
        holder=orders.lease.name,
        sequence=shown.sequence,
        result=shown.told_to(link),
        code=shown.command.code,
        answered=answered.sequence,
        answered_result=answered.result,
        refusal=answered.refusal,
        refusal_detail=answered.detail,
    )


def inputs_for(link: Link, orders: Orders) -> Inputs:
    """Return the discrete inputs of `link`, for the last request of its coils, or for its last number."""
    order = link.executed or link.in_view
    if order is None or not _shows(order):
        order = link.resetting or _NO_ORDER
    result = order.told_to(link)
    is_waiting = orders.report.state in (IDLE, COMPLETE) and orders.report.obstacle is Refusal.NONE
    return Inputs(
        busy=order.is_under_way,
        done=order.is_program and result is Result.SUCCESS,
        error=result in (Result.FAILURE, Result.FAULT, Result.REFUSED),
        command_aborted=result is Result.ABORTED,
        ready=is_waiting and orders.run is None and not orders.stops_held and orders.lease.is_open_to(link),
    )


def _shows(order: Order) -> bool:
    """Return True if the inputs show an order; they do not show a control that has been carried out."""
    is_obeyed = order.shown_result is Result.SUCCESS and not order.is_program
    return order.is_under_way or (order.shown_result is not Result.NONE and not is_obeyed)
