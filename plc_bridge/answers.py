"""The answers that links read about their commands: the report's answer and result, and the discrete inputs; pure."""

from dataclasses import dataclass, replace

from plc_bridge.dispatch import Dispatch
from plc_bridge.images import ReportImage
from plc_bridge.lease import CellLease
from plc_bridge.links import Link, Order
from plc_bridge.messages import Command, Control, LeaseState, Refusal, Report, Result

IDLE, COMPLETE = 4, 17
"""States of PackML in which a start is taken."""
_ERRORS = (Result.FAILURE, Result.FAULT, Result.REFUSED)


@dataclass(frozen=True, slots=True)
class Answer:
    """Part of the report that tells one link about its own command."""

    sequence: int
    result: Result
    answered: int
    refusal: Refusal
    refusal_detail: int
    answered_result: Result
    code: int
    is_busy: bool
    lease: LeaseState
    report: Report
    """State of the cell as published last, with the details of the run that `sequence` belongs to."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """The discrete inputs of one link, by name; done, error and command_aborted are held until acknowledged."""

    busy: bool
    done: bool
    error: bool
    command_aborted: bool
    ready: bool
    """Whether a start of this link would be taken now; the one input that needs no acknowledgement."""


def answer_for(link: Link, dispatch: Dispatch, lease: CellLease) -> Answer:
    """Return the answer that `link` reads; a link that never sent a command sees the run of any link."""
    if link.has_spoken:
        shown, answered, is_busy = link.shown, link.answered, link.shown is not None and link.shown.is_under_way
    else:
        shown, answered, is_busy = dispatch.run or dispatch.seen, dispatch.latest, dispatch.run is not None
    command = shown.command if shown is not None else Command(0, Control.NONE)
    return Answer(
        sequence=command.sequence,
        result=shown.told_to(link) if shown is not None else Result.NONE,
        answered=answered.sequence if answered is not None else 0,
        refusal=answered.refusal if answered is not None else Refusal.NONE,
        refusal_detail=answered.detail if answered is not None else 0,
        answered_result=answered.result if answered is not None else Result.NONE,
        code=command.code,
        is_busy=is_busy,
        lease=lease.state_for(link),
        report=_report_of(shown, dispatch.report, lease),
    )


def inputs_for(link: Link, dispatch: Dispatch, lease: CellLease, stops_held: int) -> Inputs:
    """Return the discrete inputs of `link`: they tell of what its coils asked for, or of its last number.

    Args:
        link: The link that reads.
        dispatch: Orders that are and were under way in the cell.
        lease: The lease of the cell.
        stops_held: Number of links that hold their stop coil at 1.
    """
    order = link.executed or link.shown
    if order is None or not _shows(order):
        order = link.resetting
    result = order.told_to(link) if order is not None else Result.NONE
    is_waiting = dispatch.report.state in (IDLE, COMPLETE) and dispatch.report.obstacle is Refusal.NONE
    return Inputs(
        busy=order is not None and order.is_under_way,
        done=order is not None and order.is_program and result is Result.SUCCESS,
        error=result in _ERRORS,
        command_aborted=result is Result.ABORTED,
        ready=is_waiting and dispatch.run is None and not stops_held and lease.is_open_to(link),
    )


def _shows(order: Order) -> bool:
    """Tell whether an order is seen in the inputs; a control that was obeyed is not."""
    is_obeyed = order.shown_result is Result.SUCCESS and not order.is_program
    return order.is_under_way or (order.shown_result is not Result.NONE and not is_obeyed)


def report_image_of(answer: Answer, life: int) -> ReportImage:
    """Return the report block that a link reads, with the life counter of the cell at both ends."""
    report = answer.report
    return ReportImage(
        life=life,
        sequence=answer.sequence,
        answered=answer.answered,
        refusal=answer.refusal,
        result=answer.result,
        state=report.state,
        fault=report.fault,
        stage=report.stage,
        reason=report.reason,
        progress=report.progress,
        code=answer.code,
        run=report.run,
        lease=answer.lease,
        holder=report.holder,
        stage_times=report.stage_times,
        total_time=report.total_time,
        answered_result=answer.answered_result,
        refusal_detail=answer.refusal_detail,
        transition=report.transition or 0,
        part=report.part,
        part_depth=report.part_depth,
        hole_x=report.hole[0],
        hole_y=report.hole[1],
        warnings=report.warnings,
        overruns=report.overruns,
        peak_force=report.peak_force,
        life_tail=life,
        part_evidence=report.part_evidence,
        part_width=report.part_width,
    )


def _report_of(order: Order | None, cell: Report, lease: CellLease) -> Report:
    """Return the state of the cell with the details of the run `order`; those of another run are left out."""
    told = order.report if order is not None else Report()
    return replace(
        cell,
        holder=lease.holder.source if lease.holder is not None else "",
        stage=told.stage,
        reason=told.reason,
        progress=told.progress,
        run=told.run,
        stage_times=told.stage_times,
        total_time=told.total_time,
        hole=told.hole,
        peak_force=told.peak_force,
    )
