"""The state of the cell in words for the page: activity, fault, next step; pure."""

from collections.abc import Sequence
from dataclasses import asdict

from cell.peg.ending import explained
from cell.peg.part_state import REMEDIES, Action, ActionWords, PartState
from cell.peg.part_state import told as told_peg
from cell.records.schema import RunRow
from cell.run.states import ASKED, Event, State, is_permitted
from drivers.errors import FAULTS, FaultCode
from plc_bridge.protocol.messages import LeaseState, PartEvidence, PartPlace, Refusal, Report, Result, Warnings
from skills.catalogue import CATALOGUE

NEXT = {
    State.IDLE: "Ready. Start a program here, or let the PLC start one.",
    State.STARTING: "A run begins.",
    State.EXECUTE: "A run is under way. Hold pauses it, stop ends it.",
    State.HOLDING: "The arm comes to rest.",
    State.HELD: "The run is paused. Unhold goes on with it, stop ends it.",
    State.UNHOLDING: "The arm goes back to where it was held.",
    State.COMPLETING: "The run ends.",
    State.COMPLETE: "The run has ended. Start the next one, or reset.",
    State.STOPPING: "The arm comes to rest.",
    State.STOPPED: "Stopped. Reset makes the cell ready again.",
    State.ABORTING: "The arm comes to rest.",
    State.ABORTED: "Do what the fault's remedy says, then reset.",
    State.CLEARING: "The fault is acknowledged.",
    State.RESETTING: "The cell becomes ready.",
}
"""Advice on the next step, for a person at the cell."""

THEN = {
    State.IDLE: "Then start a program here, or let the PLC start one.",
    State.COMPLETE: "Then start the next run, or reset.",
}
"""Advice on the next step if another action must come first."""

WAITING = (State.IDLE, State.COMPLETE, State.STOPPED, State.ABORTED)
"""States at rest, in which a person may reach into the cell."""
BY_PERSON = ("cleared", "refilled")
"""Controls with which a person confirms an action at the cell."""

BUTTONS = {
    Action.RECOVER: {"ask": "start", "program": "recover", "label": "Recover the peg"},
    Action.CLEARED: {"ask": "cleared", "label": "Peg taken away"},
}
"""Button of each action at the peg."""
PRESSED: ActionWords = {Action.RECOVER: "start the program recover", Action.CLEARED: 'press "Peg taken away"'}
"""Words of the page for the actions at the peg."""

REFUSED = {
    Refusal.UNKNOWN_CODE: "this cell has no such program",
    Refusal.UNKNOWN_RECIPE: "this cell has no such recipe",
    Refusal.BUSY: "a run is under way, or too much waits already",
    Refusal.NOT_READY: "not in this state of the cell",
    Refusal.NOT_HOLDER: "another client holds the lease; every client may stop and abort",
    Refusal.PARAMETER: "a parameter or the serial number cannot be taken",
    Refusal.PART_UNRESOLVED: "the last peg is not where it may stay: recover it, or take it away and confirm it",
    Refusal.HOLE_OCCUPIED: "the switch under the hole is closed: the workpiece must be exchanged",
    Refusal.SWITCH_UNKNOWN: "the switch under the hole gives no valid answer",
    Refusal.RACK_EMPTY: "the rack is empty: fill it and confirm it",
    Refusal.COMMISSIONING: "the cell is in commissioning: only `cell run` starts motions, slowly",
    Refusal.STOP_HELD: "a client holds its stop coil at 1; nothing starts until the coil is 0",
}
"""Reason in words for each refusal."""

_WARNINGS = {
    Warnings.NOT_RECORDED: "runs are not recorded",
    Warnings.DISK_LOW: "the disk is almost full",
    Warnings.SCAN_OVERRUNS: "scans take longer than their period",
    Warnings.ARM_CALIBRATION: "the arm's calibration does not fit what the arm does",
    Warnings.COMMISSIONING: "in commissioning: the PLC starts nothing",
}


def permitted(state: State, unplugged: Sequence[str] = ()) -> list[str]:
    """Return the permitted requests in a state: `start` if every cable is plugged in, controls and confirmations by name."""
    asked = [
        event.value
        for event in ASKED
        if is_permitted(state, event) or (event is Event.RESET and is_permitted(state, Event.CLEAR))
    ]
    starts = ["start"] if state in (State.IDLE, State.COMPLETE) and not unplugged else []
    return [*starts, *asked, *(BY_PERSON if state in WAITING else ())]


def told(image: Report, message: str, evidence: str, unplugged: Sequence[str] = ()) -> dict[str, object]:
    """Return the part of a report for all pages.

    Args:
        image: The report.
        message: Message of the last fault.
        evidence: Evidence of the peg's place, one line.
        unplugged: Names of the simulated devices whose cables are unplugged.
    """
    state = State(image.state) if image.state else State.IDLE
    part = PartState(PartPlace(image.part), evidence, depth=image.part_depth, basis=PartEvidence(image.part_evidence))
    times = {name: image.stage_times[n - 1] for n, name in CATALOGUE.stages.items() if n <= len(image.stage_times)}
    return {
        "state": state.name,
        "next": _next(state, part, unplugged),
        "unplugged": list(unplugged),
        "permitted": permitted(state, unplugged),
        "steps": steps(state, part),
        "program": CATALOGUE.by_code[image.code].name if image.code in CATALOGUE.by_code else "",
        "stage": CATALOGUE.stages.get(image.stage, ""),
        "stage_times": {name: round(time, 2) for name, time in times.items()},
        "progress": image.progress,
        "result": Result(image.result).name.lower(),
        "reason": CATALOGUE.reasons.get(image.reason, str(image.reason)).lower(),
        "run": image.run,
        "holder": image.holder,
        "part": part.place.name.lower(),
        "evidence": evidence,
        "peak_force": round(image.peak_force, 2),
        "hole": list(image.hole) if any(image.hole) else None,
        "warnings": [text for bit, text in _WARNINGS.items() if image.warnings & bit],
        "fault": _fault(image.fault, message),
    }


def steps(state: State, part: PartState) -> list[dict[str, str]]:
    """Return the buttons for the next steps of a person, in their order: what is requested, its label, its program."""
    if state is State.HELD:
        return [{"ask": "unhold", "label": "Unhold"}]
    if state not in WAITING:
        return []
    ready = [{"ask": "reset", "label": "Reset"}] if state in (State.STOPPED, State.ABORTED) else []
    useless = Action.RECOVER if part.basis & PartEvidence.HAND_EMPTY else None
    return [*ready, *(BUTTONS[action] for action in REMEDIES[part.place].actions if action is not useless)]


def _next(state: State, part: PartState, unplugged: Sequence[str]) -> str:
    """Return the next step; at rest, add the remedies for unplugged cables and for the peg, with its place and evidence."""
    if state not in WAITING:
        return NEXT.get(state, "")
    plug = [f"Plug in what was pulled out: {', '.join(unplugged)}."] if unplugged else []
    is_in_place = part.place in (PartPlace.RACK, PartPlace.BIN)
    peg = [] if is_in_place else [f"The part: {told_peg(part, PRESSED)}."]
    if state in THEN and (plug or peg):
        return " ".join([*plug, *peg, THEN[state]])
    return " ".join([*plug, NEXT[state], *peg])


def _fault(code: int, message: str) -> dict[str, object] | None:
    if code == FaultCode.NONE:
        return None
    return {"code": code, "name": FaultCode(code).name, "message": message, **asdict(FAULTS[FaultCode(code)])}


def own(image: Report) -> dict[str, object]:
    """Return the part of a report for one page: its lease, the answer to its last command, and the buttons for a refusal."""
    refusal = Refusal(image.refusal)
    return {
        "lease": LeaseState(image.lease).name.lower(),
        "answered": image.answered,
        "refusal": REFUSED.get(refusal, refusal.name.lower()) if refusal else "",
        "steps": [{"ask": "refilled", "label": "Rack filled"}] if refusal is Refusal.RACK_EMPTY else [],
    }


def meaning(fault: int, reason: str) -> str:
    """Return the meaning of a fault, or of a reason without one; empty if there is none."""
    why = explained(fault, reason)
    return "" if why is None else why.meaning


_OF_A_ROW = (
    *("run", "started", "program", "recipe", "serial", "source"),
    *("outcome", "stage", "reason", "fault", "message"),
)


def row(run: RunRow) -> dict[str, object]:
    """Return a recorded run for the page's list."""
    return {
        **{name: getattr(run, name) for name in _OF_A_ROW},
        "meaning": meaning(run.fault, run.reason),
        "cycle_time": round(run.cycle_time, 2) if run.cycle_time is not None else None,
        "peak_force": round(run.peak_force, 1) if run.peak_force is not None else None,
    }
