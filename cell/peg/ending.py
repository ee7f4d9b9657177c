"""The end of a run: its outcome, stage and reason, with meaning, cause and remedy."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import FAULTS, CellError, FaultCode, FaultText
from skills.contract import Outcome, Reason
from skills.flow import StageRecord

REASONS = {
    Reason.MISSED_GRASP: FaultText(
        "the fingers closed, but hold no peg",
        "the slot is empty, or rack.first and rack.pitch are not those of the rack",
        "fill the rack; if it is full, `cell calibrate places`",
    ),
    Reason.LOST_GRASP: FaultText(
        "the peg left the fingers during the run",
        "it caught on an edge, the grip is weak, or the pads are dirty or worn",
        "take the peg away; clean the pads; see the residual of theta in `cell report`",
    ),
    Reason.NO_HOLE: FaultText(
        "the search passed over its area without a hole",
        "the plate is missing or displaced, or theta is wrong",
        "compare the plate with hole.centre and hole.area; `cell calibrate places`",
    ),
    Reason.NOT_ALIGNED: FaultText(
        "the peg did not stand upright in the hole",
        "the place was not the hole, or the peg turned in the hand",
        "look at theta in the curves of the run; clean the pads",
    ),
    Reason.NOT_SEATED: FaultText(
        "the peg did not reach the bottom of the hole",
        "chips or another peg are in the hole, or the part is out of tolerance",
        "look into the hole; measure the part",
    ),
    Reason.FORCE_LIMIT: FaultText(
        "the force exceeded limits.force",
        "a collision, or places that are not those of the config",
        "clear the way; `cell calibrate places`",
    ),
    Reason.WORKSPACE: FaultText(
        "the tool left limits.low to limits.high",
        "the limits are too narrow for the places of the config, or the hand was pushed",
        "see limits and places with `cell config show`",
    ),
    Reason.STOPPED: FaultText("a person or the PLC stopped the run", "see its events", "reset, then start again"),
    Reason.STILL_HELD: FaultText(
        "the peg came up with the hand after the release",
        "the pads stick to the peg, or the fingers did not open",
        "take the peg away; clean the pads",
    ),
    Reason.JAMMED: FaultText(
        "the peg did not come out of the hole; the hand has let go of it",
        "it is wedged, or snapped in",
        "pull it out by hand, then confirm with `cell run cleared`",
    ),
    Reason.PART_LEFT: FaultText(
        "a peg is in a place from which a person must take it",
        "an earlier run left it there",
        "take it away, then confirm with `cell run cleared`",
    ),
}
"""Meaning, usual causes and remedy of each reason without a fault."""


def explained(fault: int, reason: str) -> FaultText | None:
    """Return meaning, cause and remedy of a recorded fault or reason; None without both, and for a skill's own reason."""
    if fault:
        return FAULTS[FaultCode(fault)] if fault in set(FaultCode) else None
    return {known.name.lower(): text for known, text in REASONS.items()}.get(reason)


@dataclass(frozen=True, slots=True)
class Ending:
    """End of a run."""

    outcome: Outcome
    stage: str
    """Name of the first stage that failed and was not retried; if there is none, of the last stage."""
    reason: IntEnum
    """Reason of the end, a `Reason` or one of the skill's own."""

    @property
    def word(self) -> str:
        """The reason in lower case, for records; empty if there is none."""
        return "" if self.reason is Reason.NONE else self.reason.name.lower()


def ending_of(records: Sequence[StageRecord], fault: CellError | None, stage: str) -> Ending:
    """Return the ending of a run: FAULT in `stage` after a fault or without stages, else that of the first failed stage that was not retried, else that of the last stage."""
    if fault is not None or not records:
        return Ending(Outcome.FAULT, stage, Reason.NONE)
    last = next(
        (record for record in records if record.result.outcome is not Outcome.SUCCESS and not record.retried),
        records[-1],
    )
    return Ending(last.result.outcome, last.name, last.result.reason)
