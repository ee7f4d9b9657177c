"""Place of the peg and its evidence: values and decisions; pure.

sensor                 evidence of a scan          decision              readers
---------------------  --------------------------  --------------------  ------------------------------------------
width of the hand  --> is_gripping, width     --.
skin --> estimator --> touched or free        --.
skin --> theta     --> end of the peg, depth  ----> after() --> PartState --> report_part and its users, page,
arm                                           --'                          run's record, `cell watch`, file beside
switch             --> closed or open         --'                          the journal, condition of the next start
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from cell.config.cell_config import CellConfig
from drivers.parts import Hole, Point
from drivers.quantities import WIDTH_TOLERANCE, ArmState, GripperState, SwitchState, Vector
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal
from skills.catalogue import GRASP, RECOVER
from skills.insert.grip import grip_of
from skills.seating.decision import CLOSED_TOLERANCE, depth_of

IN_HOLE_DEPTH = 0.004
"""Depth from which the end of a held peg counts as in the hole, m; the arm measures heights with about this accuracy."""
HOLE_MARGIN = 0.005
"""Margin around `hole.area` within which the tip counts as over the hole, m."""
SLOT_REACH = 0.01
"""If the hand releases a peg below the rack's surface within this distance of a slot's axis, it is in the slot, m."""
BIN_REACH = 0.05
"""If the hand releases a peg within this distance of the reject bin's middle, it falls into the bin, m."""

CAME_ALONG = "was seated and let go; the switch is open now"
"""Evidence text if a seated peg came out with the hand or sprang out of the hole."""

UNRESOLVED = (PartPlace.UNKNOWN, PartPlace.IN_HAND, PartPlace.ON_PLATE, PartPlace.IN_HOLE)
"""Places from which a peg must be removed before the next one can be taken."""
IN_THE_HOLE = (PartPlace.IN_HOLE, PartPlace.SEATED)
"""Places in the hole, partly or fully inserted."""


@dataclass(frozen=True, slots=True)
class PegEvidence:
    """Evidence of the peg from one reading of the devices."""

    hand: GripperState
    tip: tuple[float, float, float]
    """Position of the end of a peg in the hand, m, base frame; from arm and skin."""
    switch: SwitchState
    is_felt: bool | None = None
    """True if the skin measures a peg; None without a trusted frame."""
    is_inserting: bool = False
    """True in a stage after the search, when the peg may lean in the hole."""
    push: float = 0.0
    """Axial force on the peg, away from its end, N; above the grip's friction limit the peg slides between the fingers."""


@dataclass(frozen=True, slots=True)
class PartState:
    """Place of the peg, and its evidence."""

    place: PartPlace
    evidence: str
    """Evidence of the place, one line."""
    is_held: bool = False
    """True if the hand holds the peg."""
    depth: float = 0.0
    """Depth of the peg's end below the plate's surface, m; 0 unless the peg is in the hole or seated."""
    tip: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Last measured position of the peg's end, m, base frame; zeros before the first grasp."""
    was_in_hole: bool = False
    """True if the peg has been in the hole, or at it after the search, since the grasp."""
    basis: PartEvidence = PartEvidence.NOTHING
    """Evidence of the place as bits, as sent on the buses."""
    width: float = 0.0
    """Distance between the pads in the reading that decided the place, m."""
    slid: float = 0.0
    """Largest distance the fingers may have slid down the peg since the grasp, m."""


@dataclass(frozen=True, slots=True)
class Places:
    """Possible places of a peg, and the grip's friction limit."""

    thickness: float
    """Width of the peg between the pads, m."""
    hole: Hole
    slots: tuple[Point, ...]
    """Middle of each slot on the rack's surface, m, base frame."""
    bin: Point
    bears: float
    """Axial force below which the peg does not slide between the pads, N."""


def places_of(config: CellConfig) -> Places:
    """Return the places of the part of a config."""
    rack = config.rack
    x, y, z = rack.first
    slots = tuple((x, y + rack.pitch * number, z) for number in range(rack.slots))
    bears = grip_of(config.params(GRASP)).bears
    return Places(config.peg.part.thickness, config.hole, slots, config.params(RECOVER).bin, bears)


def evidence_of(
    arm: ArmState,
    hand: GripperState,
    switch: SwitchState,
    tip: Vector,
    is_felt: bool | None,
    is_inserting: bool = False,
) -> PegEvidence:
    """Return the evidence from readings of the devices at one instant.

    Args:
        arm: State of the arm.
        hand: State of the hand.
        switch: State of the switch under the hole.
        tip: Position of the end of a peg in the hand, shape (3,), m, base frame.
        is_felt: True if the skin measures a peg; None without a trusted frame.
        is_inserting: True in a stage after the search.
    """
    where = arm.tcp.position if not np.isfinite(tip).all() else tip
    x, y, z = (float(value) for value in where)
    along = arm.tcp.position - where
    push = float(arm.wrench.force @ along) / math.hypot(*along) if along.any() else 0.0
    return PegEvidence(hand, (x, y, z), switch, is_felt, is_inserting, push)


def at_start(kept: PartState | None, seen: PegEvidence, places: Places) -> PartState:
    """Return the state of the peg when the program begins.

    Args:
        kept: State recorded by the earlier program; None without a record.
        seen: Evidence of the first reading.
        places: Places where a peg can be.
    """
    if _is_between(seen, places):
        return _shown(_held(seen, places, kept.slid if kept is not None and kept.is_held else 0.0), seen, places)
    if kept is None:
        place = PartPlace.SEATED if seen.switch is SwitchState.CLOSED else PartPlace.RACK
        return _shown(PartState(place, f"no record of a peg; hand empty, switch {seen.switch}"), seen, places)
    if kept.is_held:
        evidence = f"{_word(kept.place)} when the program ended; the hand is empty now"
        gone = replace(kept, place=PartPlace.UNKNOWN, is_held=False, evidence=evidence)
        return _shown(gone, seen, places)
    now = _left_alone(kept, seen, places)
    if now is kept and kept.basis:
        return replace(kept, basis=kept.basis | PartEvidence.RECORD)
    # Also if the record has no evidence bits: no file, a damaged one, or one of version 0.2.
    return _shown(now, seen, places)


def after(before: PartState, seen: PegEvidence, places: Places, is_running: bool) -> PartState:
    """Return the state of the peg after one more reading of the devices.

    Args:
        before: State of the peg before the reading.
        seen: Evidence of the reading.
        places: Places where a peg can be.
        is_running: True during a run; outside a run, the cell did not command the hand to open.
    """
    now = _after(before, seen, places, is_running)
    return now if now is before else _shown(now, seen, places)


def _after(before: PartState, seen: PegEvidence, places: Places, is_running: bool) -> PartState:
    """Return the state after one more reading, without evidence bits; `before` itself if nothing changed."""
    if _is_between(seen, places):
        return _gripped(before, seen, places)
    if before.is_held:
        if seen.hand.is_moving:
            return before
        if _is_slack(seen, places):
            return replace(
                before,
                place=PartPlace.UNKNOWN,
                is_held=False,
                evidence=f"the hand does not grip, {_mm(seen.hand.width)} open at a peg of {_mm(places.thickness)}",
            )
        return _let_go(before, seen, places, is_running)
    if before.place is PartPlace.ON_PLATE and seen.switch is SwitchState.CLOSED:
        return replace(before, place=PartPlace.UNKNOWN, evidence=f"{before.evidence}, but the switch is closed")
    return _left_alone(before, seen, places) if not is_running else before


def _gripped(before: PartState, seen: PegEvidence, places: Places) -> PartState:
    now = _held(seen, places, _slid(before, seen, places))
    was_in_hole = now.place in IN_THE_HOLE or _is_at_hole(seen, places.hole)
    return replace(now, was_in_hole=was_in_hole or (_may_be_same(before, places) and before.was_in_hole))


def by_hand_alone(
    before: PartState, hand: GripperState, switch: SwitchState, places: Places, is_running: bool
) -> PartState:
    """Return the state of the peg after a reading without the arm's pose; `before` itself if nothing changed.

    If the arm times out, a closing hand still closes on its peg. An opening hand releases the peg at the arm's last pose. A held peg
    whose end was at the hole may have entered it since then.
    """
    seen = PegEvidence(hand, before.tip, switch)
    if not _is_between(seen, places):
        return after(before, seen, places, is_running)
    if before.is_held:
        if before.place is not PartPlace.IN_HAND or not (before.was_in_hole and _is_near_hole(before.tip, places.hole)):
            return before
        told = f"hand grips {_mm(hand.width)}, the end of the peg was at the hole when the arm measured last"
        return _shown(replace(before, place=PartPlace.UNKNOWN, evidence=told), seen, places)
    told = f"hand grips {_mm(hand.width)}; the arm reports no position"
    return _shown(PartState(PartPlace.IN_HAND, told, is_held=True, tip=before.tip), seen, places)


def proven(before: PartState, evidence: str, by: PartEvidence) -> PartState:
    """Return the state of a released peg as seated, because the evidence `by` proved the run's success; `before` itself if it already states both."""
    if before.place is PartPlace.SEATED and by in before.basis:
        return before
    told = f"{before.evidence}; {evidence}"
    return replace(before, place=PartPlace.SEATED, is_held=False, evidence=told, basis=before.basis | by)


def after_run(before: PartState, seen: PegEvidence, places: Places) -> PartState:
    """Return the state of the peg at the end of a run.

    If the switch has opened since the peg was seated, the peg came out with the hand or sprang out.
    If the switch times out, the peg still counts as seated; its next valid reading decides, see `_left_alone`.
    """
    now = after(before, seen, places, is_running=True)
    if places.hole.evidence != "switch" or now.place is not PartPlace.SEATED or now.is_held:
        return now
    if seen.switch is SwitchState.OPEN:
        return _shown(replace(now, place=PartPlace.UNKNOWN, evidence=CAME_ALONG), seen, places)
    if seen.switch is SwitchState.UNKNOWN and now.basis & PartEvidence.SWITCH_CLOSED:
        return _shown(replace(now, evidence=f"{now.evidence}; the switch does not answer now"), seen, places)
    return now


def _shown(part: PartState, seen: PegEvidence, places: Places) -> PartState:
    """Return a state with the evidence bits and the width of the reading that decided it."""
    signs = {
        PartEvidence.HAND_HOLDS: _is_between(seen, places),
        PartEvidence.HAND_EMPTY: not _is_between(seen, places) and not _is_slack(seen, places),
        PartEvidence.SKIN_TOUCHED: seen.is_felt is True,
        PartEvidence.SKIN_FREE: seen.is_felt is False,
        PartEvidence.TIP_IN_HOLE: part.depth > 0.0,
        PartEvidence.SWITCH_CLOSED: seen.switch is SwitchState.CLOSED,
        PartEvidence.SWITCH_OPEN: seen.switch is SwitchState.OPEN,
    }
    return replace(part, basis=PartEvidence(sum(sign for sign in signs if signs[sign])), width=seen.hand.width)


def _is_between(seen: PegEvidence, places: Places) -> bool:
    return seen.hand.is_gripping and abs(seen.hand.width - places.thickness) <= WIDTH_TOLERANCE


def _is_slack(seen: PegEvidence, places: Places) -> bool:
    return not seen.hand.is_gripping and abs(seen.hand.width - places.thickness) <= WIDTH_TOLERANCE


def _may_be_same(before: PartState, places: Places) -> bool:
    """Return True if the peg between the pads may be the last peg: the hand held it, or the pads were a peg's width apart without a grip."""
    return before.is_held or abs(before.width - places.thickness) <= WIDTH_TOLERANCE


def _slid(before: PartState, seen: PegEvidence, places: Places) -> float:
    """Return the largest distance the fingers may have slid down the held peg, m, after one more reading."""
    if not _may_be_same(before, places):
        return 0.0
    if seen.push <= places.bears:
        return before.slid
    return max(before.slid + before.tip[2] - seen.tip[2], 0.0)


def _held(seen: PegEvidence, places: Places, slid: float) -> PartState:
    """Return the state of a peg between the pads; `slid` is the largest distance the fingers may have slid along it, m."""
    depth = depth_of(np.array(seen.tip), places.hole)
    hand = f"hand grips {_mm(seen.hand.width)}"
    is_over = _is_over_hole(seen.tip, places.hole)
    is_seated = is_over and seen.switch is SwitchState.CLOSED and abs(depth - places.hole.depth) <= CLOSED_TOLERANCE
    if not is_seated and (depth - slid < IN_HOLE_DEPTH or not is_over):
        return PartState(PartPlace.IN_HAND, f"{hand}, switch {seen.switch}", True, 0.0, seen.tip, slid=slid)
    place = PartPlace.SEATED if is_seated else PartPlace.IN_HOLE
    return PartState(
        place, f"{hand}, its end {_mm(depth)} deep, switch {seen.switch}", True, depth, seen.tip, slid=slid
    )


def _let_go(before: PartState, seen: PegEvidence, places: Places, is_running: bool) -> PartState:
    """Return the state of a peg that the hand has released since the last scan."""
    hand = f"hand {_mm(seen.hand.width)} open"
    if before.place in IN_THE_HOLE:
        # A switch that was closed already while the peg was held too far above the bottom proves nothing.
        is_high = before.depth < places.hole.depth - CLOSED_TOLERANCE
        is_early = is_high and PartEvidence.SWITCH_CLOSED in before.basis
        place = PartPlace.SEATED if seen.switch is SwitchState.CLOSED and not is_early else PartPlace.IN_HOLE
        evidence = f"let go {_mm(before.depth)} deep, {hand}, switch {seen.switch}"
    else:
        place, why = _fallen(before, places, is_running)
        evidence = f"{why}, {hand}"
    return replace(before, place=place, is_held=False, evidence=evidence)


def _fallen(before: PartState, places: Places, is_running: bool) -> tuple[PartPlace, str]:
    """Return the place of a peg that the hand has released outside the hole, and its evidence."""
    tip = before.tip
    if math.dist(tip[:2], places.bin[:2]) <= BIN_REACH:
        return PartPlace.BIN, "let go above the bin"
    if any(math.dist(tip[:2], slot[:2]) <= SLOT_REACH and tip[2] < slot[2] for slot in places.slots):
        return PartPlace.RACK, "let go in its slot"
    if before.was_in_hole and _is_over_hole(tip, places.hole):
        return PartPlace.UNKNOWN, "lost over the hole after it stood in it or at it"
    if not is_running:
        return PartPlace.UNKNOWN, "the hand was opened outside a run"
    height = _mm(-depth_of(np.array(tip), places.hole))
    return PartPlace.ON_PLATE, f"fell from {height} above the plate's height at x {tip[0]:.3f}, y {tip[1]:.3f} m"


def _left_alone(before: PartState, seen: PegEvidence, places: Places) -> PartState:
    """Return the state of a free peg while the cell waits; `before` itself if nothing changed.

    If the switch opens, a person has removed the seated peg. If the switch timed out during the run and is open at its
    next valid reading, it may have opened during the run; the peg's place is then unknown.
    """
    if places.hole.evidence != "switch" or before.place is not PartPlace.SEATED:
        return before
    is_doubted = bool(before.basis) and not before.basis & PartEvidence.SWITCH_CLOSED
    if seen.switch is SwitchState.OPEN and is_doubted:
        return replace(before, place=PartPlace.UNKNOWN, evidence=CAME_ALONG)
    if seen.switch is SwitchState.OPEN:
        return PartState(PartPlace.RACK, "the seated peg was taken away: the switch is open")
    if seen.switch is SwitchState.CLOSED and is_doubted:
        return replace(before, evidence="let go, and the switch is closed again")
    return before


def _is_over_hole(tip: tuple[float, float, float], hole: Hole) -> bool:
    return all(abs(tip[k] - hole.centre[k]) <= hole.area[k] / 2 + HOLE_MARGIN for k in range(2))


def _is_at_hole(seen: PegEvidence, hole: Hole) -> bool:
    """Return True if the end of a peg is too close to the found hole for the arm to measure whether the peg is in it."""
    return seen.is_inserting and _is_near_hole(seen.tip, hole)


def _is_near_hole(tip: tuple[float, float, float], hole: Hole) -> bool:
    return abs(depth_of(np.array(tip), hole)) < IN_HOLE_DEPTH and _is_over_hole(tip, hole)


def refusal_of(part: PartState, switch: SwitchState, is_rack_empty: bool, recovers_first: bool) -> Refusal:
    """Return why no fresh peg can be taken now, or NONE.

    Args:
        part: Place of the last peg.
        switch: State of the switch under the hole.
        is_rack_empty: True if all slots have been emptied.
        recovers_first: True if `recover` removes a held peg before the program begins.
    """
    # Places from which `recover` can remove a held peg.
    if part.place in UNRESOLVED and not (
        recovers_first and part.is_held and part.place in (PartPlace.IN_HAND, PartPlace.IN_HOLE)
    ):
        return Refusal.PART_UNRESOLVED
    if switch is SwitchState.UNKNOWN:
        return Refusal.SWITCH_UNKNOWN
    if switch is SwitchState.CLOSED:
        return Refusal.HOLE_OCCUPIED
    return Refusal.RACK_EMPTY if is_rack_empty else Refusal.NONE


class Action(StrEnum):
    """Action that resolves the place of a peg; each user interface has its own words for it."""

    RECOVER = "recover"
    CLEARED = "cleared"


ActionWords = Mapping[str, str]
FOR_PLC: ActionWords = {Action.RECOVER: "run `recover`", Action.CLEARED: "send CLEARED"}
"""Words for a PLC programmer, also in the log."""


@dataclass(frozen=True, slots=True)
class Remedy:
    """Remedy for a place of the peg."""

    text: str
    """Text with placeholders for the words of actions: the name of the action in braces."""
    actions: tuple[Action, ...] = ()
    """Actions that can resolve the place, the preferred one first."""

    def told(self, words: ActionWords = FOR_PLC) -> str:
        """Return the text with the words of a user interface."""
        return self.text.format_map(words)


READY = "ready: "
"""First word of a remedy if the next peg can be taken."""
_BOTH = (Action.RECOVER, Action.CLEARED)
REMEDIES = {
    PartPlace.RACK: Remedy(f"{READY}the next peg is in the rack"),
    PartPlace.BIN: Remedy(f"{READY}the last peg is in the reject bin"),
    PartPlace.SEATED: Remedy(
        "the peg is seated: if the hand still holds it, {recover}; take the workpiece away before the next start", _BOTH
    ),
    PartPlace.IN_HAND: Remedy("the hand holds a peg: {recover}", (Action.RECOVER,)),
    PartPlace.IN_HOLE: Remedy(
        "a peg stands in the hole: if the hand holds it, {recover}; if not, draw it out, then {cleared}", _BOTH
    ),
    PartPlace.ON_PLATE: Remedy(
        "a peg lies on the plate or below it: a person must take it away, then {cleared}", (Action.CLEARED,)
    ),
    PartPlace.UNKNOWN: Remedy(
        "the place of the peg is unknown: after a fault, reset; if it stays unknown, look at hand, hole and plate, take the peg away, then {cleared}",
        (Action.CLEARED,),
    ),
}
"""Remedy by the peg's place."""

LOST_WITH_WORLD = (PartPlace.IN_HAND, PartPlace.IN_HOLE, PartPlace.ON_PLATE)
"""Places from which the peg of a simulated cell vanishes when the process ends."""

SIGNS = {
    PartEvidence.HAND_HOLDS: "the hand holds a peg",
    PartEvidence.HAND_EMPTY: "the hand holds no peg",
    PartEvidence.SKIN_TOUCHED: "skin touched",
    PartEvidence.SKIN_FREE: "skin not touched",
    PartEvidence.TIP_IN_HOLE: "its end was in the hole",
    PartEvidence.SWITCH_CLOSED: "switch closed",
    PartEvidence.SWITCH_OPEN: "switch open",
    PartEvidence.FORCE: "seated by the force of its latch",
    PartEvidence.PERSON: "a person has taken the last peg away",
    PartEvidence.RECORD: "on record from the program before",
}
"""Text of each evidence bit."""


def in_words(basis: PartEvidence, width: float) -> str:
    """Return the evidence sent on the buses as words: its bits, and the distance between the pads, m."""
    by_hand = PartEvidence.HAND_HOLDS | PartEvidence.HAND_EMPTY
    slack = [] if basis & (by_hand | PartEvidence.PERSON) or not basis else ["the hand does not grip"]
    pads = [f"pads {_mm(width)} apart"] if basis & ~PartEvidence.PERSON else []
    return ", ".join([*slack, *(SIGNS[sign] for sign in PartEvidence if sign & basis), *pads])


def described(part: PartState) -> str:
    """Return the place of the peg and its evidence, one line."""
    depth = f", {_mm(part.depth)} deep" if part.depth > 0.0 else ""
    return f"peg {_word(part.place)}{depth} ({part.evidence})"


def told(part: PartState, words: ActionWords = FOR_PLC) -> str:
    """Return the place of the peg, its evidence and the remedy, one line."""
    return f"{described(part)}: {REMEDIES[part.place].told(words)}"


def _word(place: PartPlace) -> str:
    return place.name.lower().replace("_", " ")


def _mm(length: float) -> str:
    return f"{1e3 * length:.1f} mm"
