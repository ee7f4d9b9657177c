"""Where the peg is, and how the cell knows: values and decisions; pure.

sensor                 evidence of a scan          decision              who reads it
---------------------  --------------------------  --------------------  ------------------------------------------
width of the hand  --> is_gripping, width     --.
skin --> estimator --> touched or free        --.
skin --> theta     --> end of the peg, depth  ----> after() --> PartState --> report_part and what follows it, page,
arm                                           --'                          run's record, `cell watch`, file beside
switch             --> closed or open         --'                          the journal, condition of the next start
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from drivers.parts import Hole, Job, Point
from drivers.quantities import WIDTH_TOLERANCE, ArmState, GripperState, SwitchState, Vector
from plc_bridge.messages import PartEvidence, PartPlace, Refusal
from skills.seating import CLOSED_TOLERANCE, depth_of

IN_HOLE_DEPTH = 0.004
"""Depth by the arm from which the end of a held peg is taken to be in the hole, m: the arm knows heights no better."""
UPRIGHT = 0.25
"""Tilt of a peg below which it may slide into the hole when the hand loses it at the surface, rad; `insert.aligned` is 0.1 as shipped."""
HOLE_MARGIN = 0.005
"""Reach of the hole's place beyond `hole.area`, m."""
SLOT_REACH = 0.01
"""Distance from a slot's axis within which a peg that is let go below the rack's surface stands in the slot, m."""
BIN_REACH = 0.05
"""Distance from the middle of the reject bin within which a peg that is let go falls into it, m."""

CAME_ALONG = "was seated and let go; the switch is open now"
"""Evidence of a peg that came along with the hand, or jumped out of the hole."""

UNRESOLVED = (PartPlace.UNKNOWN, PartPlace.IN_HAND, PartPlace.ON_PLATE, PartPlace.IN_HOLE)
"""Places that a peg must leave before the next one can be taken."""
IN_THE_HOLE = (PartPlace.IN_HOLE, PartPlace.SEATED)
"""Places in the hole, part of the way or all of it."""
RECOVERED = (PartPlace.IN_HAND, PartPlace.IN_HOLE)
"""Places that `recover` can take a held peg from."""


@dataclass(frozen=True, slots=True)
class PegEvidence:
    """Evidence of the peg in one look at the devices."""

    width: float
    """Distance between the pads, m."""
    is_gripping: bool
    is_moving: bool
    tip: tuple[float, float, float]
    """Place of the end of a peg in the hand, by arm and skin, m, base frame."""
    theta: float
    """In-hand angle by the skin, rad."""
    switch: SwitchState
    tilt: float = math.pi / 2
    """Angle between a peg in the hand and the vertical, by arm and skin, rad."""
    is_felt: bool | None = None
    """Whether the skin shows a peg; None where it gave no frame to be trusted."""
    push: float = 0.0
    """Force on the hand along the peg, away from its end, N: what bears the peg presses it along the fingers with that."""


@dataclass(frozen=True, slots=True)
class PartState:
    """Place of the peg, and the evidence of it."""

    place: PartPlace
    evidence: str
    """Evidence of the place, one line."""
    is_held: bool = False
    """Whether the hand holds the peg."""
    depth: float = 0.0
    """Depth of the peg's end below the plate's surface, m; 0 where it is neither in the hole nor seated."""
    tip: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Place of the peg's end when it was seen last, m, base frame; zeros before it was in the hand."""
    was_in_hole: bool = False
    """Whether the peg has stood in the hole, or upright at it, since the hand took hold of it."""
    basis: PartEvidence = PartEvidence.NOTHING
    """Evidence of the place in bits, as the buses carry it."""
    width: float = 0.0
    """Distance between the pads in the look that the place follows from, m."""
    slid: float = 0.0
    """Way that the hand went down the held peg at the most, m: under more than the pads bear a peg may stay where it is."""


@dataclass(frozen=True, slots=True)
class Places:
    """The places where a peg can be."""

    thickness: float
    """Width of the peg between the pads, m."""
    hole: Hole
    slots: tuple[Point, ...]
    """Middle of each slot on the rack's surface, m, base frame."""
    bin: Point
    bears: float = math.inf
    """Largest force along the fingers that the pads surely bear, N."""


def places_of(job: Job, bin_at: Point, bears: float = math.inf) -> Places:
    """Return the places of a job; `bin_at` is the place above the reject bin, m, base frame, and `bears` what the pads surely bear, N."""
    rack = job.rack
    x, y, z = rack.first
    slots = tuple((x, y + rack.pitch * number, z) for number in range(rack.slots))
    return Places(job.peg.part.thickness, job.hole, slots, bin_at, bears)


def evidence_of(
    arm: ArmState, hand: GripperState, switch: SwitchState, tip: Vector, theta: float, is_felt: bool | None
) -> PegEvidence:
    """Return what was read of the devices at one time as evidence.

    Args:
        arm: State of the arm.
        hand: State of the hand.
        switch: State of the switch under the hole.
        tip: Place of the end of a peg in the hand, m, base frame.
        theta: In-hand angle, rad.
        is_felt: Whether the skin shows a peg; None where it gives no frame to be trusted.
    """
    where = arm.tcp.position if not np.isfinite(tip).all() else tip
    x, y, z = (float(value) for value in where)
    along = arm.tcp.position - where
    if not along.any():
        return PegEvidence(hand.width, hand.is_gripping, hand.is_moving, (x, y, z), theta, switch, is_felt=is_felt)
    tilt = math.atan2(math.hypot(along[0], along[1]), along[2])
    push = float(arm.wrench.force @ along) / math.hypot(*along)
    return PegEvidence(hand.width, hand.is_gripping, hand.is_moving, (x, y, z), theta, switch, tilt, is_felt, push)


def at_start(kept: PartState | None, seen: PegEvidence, places: Places) -> PartState:
    """Return where the peg is when the program begins.

    Args:
        kept: State that the earlier program left; None where there is no record of it.
        seen: The first look at the devices.
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
    return _shown(
        now, seen, places
    )  # also where there are no bits on record: no file, a damaged one, one of version 0.2


def after(before: PartState, seen: PegEvidence, places: Places, is_running: bool) -> PartState:
    """Return where the peg is after one more look at the devices.

    Args:
        before: Place of the peg before the look.
        seen: PegEvidence of the look.
        places: Places where a peg can be.
        is_running: Whether a skill moves the cell; otherwise a hand that opens was opened by somebody else.
    """
    now = _after(before, seen, places, is_running)
    return now if now is before else _shown(now, seen, places)


def _after(before: PartState, seen: PegEvidence, places: Places, is_running: bool) -> PartState:
    """Return where the peg is after one more look, without the bits of the evidence; `before` itself where nothing is new."""
    if _is_between(seen, places):
        now = _held(seen, places, _slid(before, seen, places))
        was_in_hole = now.place in IN_THE_HOLE or _stands_at_hole(seen, places)
        return replace(now, was_in_hole=was_in_hole or (before.is_held and before.was_in_hole))
    if before.is_held:
        if seen.is_moving:
            return before
        if _is_slack(seen, places):
            return replace(
                before,
                place=PartPlace.UNKNOWN,
                is_held=False,
                evidence=f"the hand does not grip, {_mm(seen.width)} open at a peg of {_mm(places.thickness)}",
            )
        return _let_go(before, seen, places, is_running)
    if before.place is PartPlace.ON_PLATE and seen.switch is SwitchState.CLOSED:
        return replace(before, place=PartPlace.UNKNOWN, evidence=f"{before.evidence}, but the switch is closed")
    return _left_alone(before, seen, places) if not is_running else before


def by_hand_alone(
    before: PartState, hand: GripperState, switch: SwitchState, places: Places, is_running: bool
) -> PartState:
    """Return where the peg is after a look while the arm does not tell where it is; `before` itself where nothing is new.

    A hand that was closing goes on to close on its peg when the arm falls silent, and one that was opening lets go of it where the arm was last.
    """
    seen = PegEvidence(hand.width, hand.is_gripping, hand.is_moving, before.tip, 0.0, switch)
    if not _is_between(seen, places):
        return after(before, seen, places, is_running)
    if before.is_held:
        return before
    told = f"hand grips {_mm(hand.width)}; the arm does not tell where"
    return _shown(PartState(PartPlace.IN_HAND, told, is_held=True, tip=before.tip), seen, places)


def proven(before: PartState, evidence: str) -> PartState:
    """Return where a peg is that the hand has let go in a hole without a switch, once the run's success is proven by other evidence."""
    return replace(
        before,
        place=PartPlace.SEATED,
        is_held=False,
        evidence=f"{before.evidence}; {evidence}",
        basis=before.basis | PartEvidence.FORCE,
    )


def after_run(before: PartState, seen: PegEvidence, places: Places) -> PartState:
    """Return where the peg is when a run has ended: a seated peg whose switch has opened since came along or jumped out.

    One whose switch does not answer is still seated; what the switch says once it answers decides, see `_left_alone`.
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
    """Return a state with the bits and the width of the look that it follows from."""
    is_known = seen.is_felt is not None
    signs = {
        PartEvidence.HAND_HOLDS: _is_between(seen, places),
        PartEvidence.HAND_EMPTY: not _is_between(seen, places) and not _is_slack(seen, places),
        PartEvidence.SKIN_TOUCHED: is_known and seen.is_felt,
        PartEvidence.SKIN_FREE: is_known and not seen.is_felt,
        PartEvidence.TIP_IN_HOLE: part.depth > 0.0,
        PartEvidence.SWITCH_CLOSED: seen.switch is SwitchState.CLOSED,
        PartEvidence.SWITCH_OPEN: seen.switch is SwitchState.OPEN,
    }
    basis = PartEvidence(sum(sign for sign, is_so in signs.items() if is_so))
    return replace(part, basis=basis, width=seen.width)


def _is_between(seen: PegEvidence, places: Places) -> bool:
    return seen.is_gripping and abs(seen.width - places.thickness) <= WIDTH_TOLERANCE


def _is_slack(seen: PegEvidence, places: Places) -> bool:
    return not seen.is_gripping and abs(seen.width - places.thickness) <= WIDTH_TOLERANCE


def _slid(before: PartState, seen: PegEvidence, places: Places) -> float:
    """Return how far the hand has gone down the held peg at the most, m, after one more look."""
    if not before.is_held or seen.push <= places.bears:
        return before.slid if before.is_held else 0.0
    return max(before.slid + before.tip[2] - seen.tip[2], 0.0)


def _held(seen: PegEvidence, places: Places, slid: float) -> PartState:
    """Return the state of a peg between the pads, along which the hand may have slid so far, m."""
    depth = depth_of(np.array(seen.tip), places.hole)
    hand = f"hand grips {_mm(seen.width)}"
    is_over = _is_over_hole(seen.tip, places.hole)
    is_seated = is_over and seen.switch is SwitchState.CLOSED and abs(depth - places.hole.depth) <= CLOSED_TOLERANCE
    if not is_seated and (depth - slid < IN_HOLE_DEPTH or not is_over):
        return PartState(PartPlace.IN_HAND, f"{hand}, switch {seen.switch}", True, 0.0, seen.tip, slid=slid)
    place = PartPlace.SEATED if is_seated else PartPlace.IN_HOLE
    return PartState(
        place, f"{hand}, its end {_mm(depth)} deep, switch {seen.switch}", True, depth, seen.tip, slid=slid
    )


def _let_go(before: PartState, seen: PegEvidence, places: Places, is_running: bool) -> PartState:
    """Return the state of a peg that was in the hand a scan ago and is not any more."""
    hand = f"hand {_mm(seen.width)} open"
    gone = replace(before, is_held=False)
    if before.place in IN_THE_HOLE:
        place = PartPlace.SEATED if seen.switch is SwitchState.CLOSED else PartPlace.IN_HOLE
        return replace(gone, place=place, evidence=f"let go {_mm(before.depth)} deep, {hand}, switch {seen.switch}")
    if math.dist(before.tip[:2], places.bin[:2]) <= BIN_REACH:
        return replace(gone, place=PartPlace.BIN, evidence=f"let go above the bin, {hand}")
    if any(math.dist(before.tip[:2], slot[:2]) <= SLOT_REACH and before.tip[2] < slot[2] for slot in places.slots):
        return replace(gone, place=PartPlace.RACK, evidence=f"let go in its slot, {hand}")
    if before.was_in_hole and _is_over_hole(before.tip, places.hole):
        return replace(
            gone, place=PartPlace.UNKNOWN, evidence=f"lost over the hole after it stood in it or at it, {hand}"
        )
    height = _mm(-depth_of(np.array(before.tip), places.hole))
    if not is_running:
        return replace(gone, place=PartPlace.UNKNOWN, evidence=f"the hand was opened outside a run, {hand}")
    return replace(
        gone,
        place=PartPlace.ON_PLATE,
        evidence=f"fell from {height} above the plate's height {_at(before.tip)}, {hand}",
    )


def _left_alone(before: PartState, seen: PegEvidence, places: Places) -> PartState:
    """Return the state of a peg that nobody holds while the cell waits: whoever takes a seated one away opens the switch, where there is one.

    A switch that has fallen silent in the run, and is open when it answers again, may have been open all the while.
    """
    if places.hole.evidence != "switch" or before.place is not PartPlace.SEATED:
        return before
    is_doubted = bool(before.basis) and not before.basis & PartEvidence.SWITCH_CLOSED
    if seen.switch is SwitchState.OPEN and is_doubted:
        return _shown(replace(before, place=PartPlace.UNKNOWN, evidence=CAME_ALONG), seen, places)
    if seen.switch is SwitchState.OPEN:
        return PartState(PartPlace.RACK, "the seated peg was taken away: the switch is open")
    if seen.switch is SwitchState.CLOSED and is_doubted:
        return _shown(replace(before, evidence="let go, and the switch is closed again"), seen, places)
    return before


def _is_over_hole(tip: tuple[float, float, float], hole: Hole) -> bool:
    return all(abs(tip[k] - hole.centre[k]) <= hole.area[k] / 2 + HOLE_MARGIN for k in range(2))


def _stands_at_hole(seen: PegEvidence, places: Places) -> bool:
    """Whether a peg in the hand may be in the hole by less than the arm can tell."""
    is_near = abs(depth_of(np.array(seen.tip), places.hole)) < IN_HOLE_DEPTH
    return is_near and seen.tilt < UPRIGHT and _is_over_hole(seen.tip, places.hole)


def refusal_of(part: PartState, switch: SwitchState, is_rack_empty: bool, recovers_first: bool) -> Refusal:
    """Return why no fresh peg can be taken now, or NONE.

    Args:
        part: Place of the last peg.
        switch: State of the switch under the hole.
        is_rack_empty: Whether all slots have been emptied.
        recovers_first: Whether a held peg is cleared away before the program begins.
    """
    if part.place in UNRESOLVED and not (recovers_first and part.is_held and part.place in RECOVERED):
        return Refusal.PART_UNRESOLVED
    if switch is SwitchState.UNKNOWN:
        return Refusal.SWITCH_UNKNOWN
    if switch is SwitchState.CLOSED:
        return Refusal.HOLE_OCCUPIED
    return Refusal.RACK_EMPTY if is_rack_empty else Refusal.NONE


READY = "ready: "
"""Beginning of what is said of a peg that lets the next one be taken."""
REMEDIES = {
    PartPlace.RACK: f"{READY}the next peg is in the rack",
    PartPlace.BIN: f"{READY}the last peg is in the reject bin",
    PartPlace.SEATED: "the peg is seated: where the hand still holds it run `recover`; take the workpiece away before the next start",
    PartPlace.IN_HAND: "the hand holds a peg: run `recover`",
    PartPlace.IN_HOLE: "a peg stands in the hole: where the hand holds it run `recover`; else draw it out, then give CLEARED",
    PartPlace.ON_PLATE: "a peg lies on the plate, or on what is below where it fell: a person must take it away, then give CLEARED",
    PartPlace.UNKNOWN: "nobody knows where the peg is: look at hand, hole and plate, take it away, then give CLEARED",
}
"""Remedy by the peg's place."""


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
"""What each bit of the evidence says, in words."""


def in_words(basis: PartEvidence, width: float) -> str:
    """Return the evidence that the buses carry as words: its bits, and the distance between the pads, m."""
    by_hand = PartEvidence.HAND_HOLDS | PartEvidence.HAND_EMPTY
    slack = [] if basis & (by_hand | PartEvidence.PERSON) or not basis else ["the hand does not grip"]
    pads = [f"pads {_mm(width)} apart"] if basis & ~PartEvidence.PERSON else []
    return ", ".join([*slack, *(SIGNS[sign] for sign in PartEvidence if sign & basis), *pads])


def described(part: PartState) -> str:
    """Return the place of the peg and the evidence of it, as one line."""
    depth = f", {_mm(part.depth)} deep" if part.depth > 0.0 else ""
    return f"peg {_word(part.place)}{depth} ({part.evidence})"


def told(part: PartState) -> str:
    """Return the place of the peg, the evidence of it, and what to do, as one line for a technician."""
    return f"{described(part)}: {REMEDIES[part.place]}"


def _word(place: PartPlace) -> str:
    return place.name.lower().replace("_", " ")


def _at(tip: tuple[float, float, float]) -> str:
    return f"at x {tip[0]:.3f}, y {tip[1]:.3f} m"


def _mm(length: float) -> str:
    return f"{1e3 * length:.1f} mm"
