"""Tracks the peg of a cell through its devices: its state, its fields of the report, conditions of a start, proof of success."""

import logging
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell
from cell.peg.custody import Custody
from cell.peg.ending import Ending
from cell.peg.part_state import UNRESOLVED, PartState, PegEvidence, described, evidence_of, places_of, told
from cell.peg.success import LastLook, Proof, SeatingProof, evidence_for, judged
from drivers.errors import CellError, SwitchDisagreesError, SwitchUnknownError
from drivers.frames import end_point
from drivers.quantities import ArmState, GripperState, SwitchState
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal, Report
from skills.catalogue import ADJUST, GRASP, INSERT, RECOVER, SEARCH
from skills.contract import Observation, Outcome, SkillContext, is_trusted
from skills.entry import Claim, Entry
from skills.flow import StageRecord
from skills.guards.scan_guards import require_finite_skin
from skills.seating.decision import depth_of

logger = logging.getLogger(__name__)

LONGEST_UNKNOWN = 0.5
"""Longest time without a valid reading of the switch in a run that needs it, s; after this time the run ends with a fault."""
EARLY_SHARE = 0.5
"""Share of the hole's depth, 0 to 1; if a held peg is less deep, it cannot be on the switch, for any plate height."""
FELT_WITHIN = 0.25
"""The skin counts as touched until the last frame with a peg is this old, s; about one of ten frames a second misses the peg."""
PROVEN_BY_SWITCH = (Claim.SEATED, Claim.LEFT, Claim.INSERTED)
"""Claims that must be proven by the switch, or by force if the hole has no switch."""


class PartWatch:
    """Tracks the place of one cell's peg; for the scan thread."""

    def __init__(self, cell: Cell, context: SkillContext, folder: Path) -> None:
        """Keep the opened cell and its skill context; read the peg's recorded state from the journal's folder."""
        self._cell, self._context, self.commissioning = cell, context, cell.commissioning
        self._custody = Custody(folder, cell.config.arm.kind)
        self._places = places_of(cell.config)
        self._proof: SeatingProof = evidence_for(cell.config.hole)
        self._is_running = self._has_looked = self._needs_switch = False
        self.proof = ""
        """Evidence that proved the last run's success, in words; empty without success or if no proof was required."""
        self._unknown_since: float | None = None
        """Time of the first reading since which the switch has given no valid one in the run, s; None while readings are valid."""
        self._hole, self._peak_force = (0.0, 0.0), 0.0
        self._switch = SwitchState.UNKNOWN
        self._felt_at, self._frame = -math.inf, -1
        """Time of the last frame with a peg, s, and sequence number of the last frame evaluated."""

    def begin(self, config: CellConfig, claim: Claim) -> None:
        """Start tracking a run with this config; `claim` is the meaning of its success."""
        self._places, self._is_running, self.proof = places_of(config), True, ""
        self._needs_switch = claim in PROVEN_BY_SWITCH and config.hole.evidence == "switch"
        self._unknown_since = None
        self._proof, self._hole, self._peak_force = evidence_for(config.hole), (0.0, 0.0), 0.0

    def see(self, seen: Observation) -> None:
        """Take one scan, in a run or outside one.

        Raises:
            SwitchUnknownError: The switch has given no valid reading for too long, so that success could not be proven.
            SwitchDisagreesError: The switch has closed while no peg can be on it.
        """
        self._switch = seen.switch
        self._felt_at, self._frame = max(self._felt_at, seen.peg.stamp), seen.frame.sequence
        is_felt = seen.frame.stamp - self._felt_at <= FELT_WITHIN
        is_inserting = self._context.stage in (INSERT.name, ADJUST.name)
        evidence = evidence_of(seen.arm, seen.gripper, seen.switch, seen.tip, is_felt, is_inserting)
        self._tell(self._custody.see(evidence, self._places, self._is_running))
        if not self._is_running:
            return
        self._require_switch(seen)
        self._require_plausible(seen)
        self._proof = self._proof.after(seen, self._context.lead.held)
        self._peak_force = max(self._peak_force, math.hypot(*seen.arm.wrench.force))
        part = self._custody.part
        if part.is_held and part.place in (PartPlace.IN_HOLE, PartPlace.SEATED):
            self._hole = part.tip[:2]

    def _require_switch(self, seen: Observation) -> None:
        """Require valid readings of the switch if the run's success depends on it; recovery continues without it."""
        if seen.switch is not SwitchState.UNKNOWN or not self._needs_switch or self._context.stage == RECOVER.name:
            self._unknown_since = None
            return
        self._unknown_since = seen.stamp if self._unknown_since is None else self._unknown_since
        if seen.stamp - self._unknown_since > LONGEST_UNKNOWN:
            raise SwitchUnknownError(f"switch: no valid answer for {LONGEST_UNKNOWN:g} s; success could not be proven")

    def _require_plausible(self, seen: Observation) -> None:
        """Require that an open switch does not close before the peg can be on it."""
        # Stages in which no peg can be on the switch: the hole is empty at the start, and the search ends when the
        # peg dips into it.
        is_early = self._needs_switch and self._context.stage in (GRASP.name, SEARCH.name)
        was_open = isinstance(self._proof, Proof) and self._proof.was_open
        if not is_early or not was_open or seen.switch is not SwitchState.CLOSED:
            return
        hole = self._context.job.hole
        depth = depth_of(seen.tip, hole)
        if seen.gripper.is_gripping and depth < EARLY_SHARE * hole.depth:
            raise SwitchDisagreesError(
                f"switch: closed with the tip {1e3 * max(depth, 0.0):.1f} mm deep; {1e3 * hole.depth:.1f} mm expected"
            )
        if not seen.gripper.is_gripping and self._context.stage == GRASP.name:
            raise SwitchDisagreesError("switch: closed before the hand holds a peg; open expected until it is seated")

    def look(self) -> None:
        """Read arm, hand and switch outside a run; ignore devices that time out."""
        try:
            arm, hand, self._switch = self._devices()
            evidence = self._evidence(arm, hand, self._switch)
            self._tell(self._custody.see(evidence, self._places, self._is_running))
        except Exception:  # the run that needs the device reports its fault
            self._see_hand()

    def judge(self, claim: Claim, ending: Ending, records: Sequence[StageRecord]) -> Ending:
        """Return the ending of the run, judged by the evidence; the arm must be at rest.

        Raises:
            CellError: A device times out, or the evidence contradicts the success that the skills report.
        """
        arm, hand, switch = self._devices()
        self._end(arm, hand, switch)
        look = LastLook(hand, arm.tcp.position, switch)
        judgement = judged(claim, ending, records, self._proof, look, self._custody.part, self._context.job)
        is_proven = judgement.outcome is Outcome.SUCCESS and claim in PROVEN_BY_SWITCH
        self.proof = self._proof.told if is_proven else ""
        if claim is Claim.INSERTED and is_proven:
            is_by_force = self._context.job.hole.evidence == "force"
            self._custody.seat(self.proof, PartEvidence.FORCE if is_by_force else PartEvidence.SWITCH_CLOSED)
        return judgement

    def end(self) -> None:
        """Register the end of the run, after any outcome."""
        if self._is_running:
            try:
                self._end(*self._devices())
            except Exception:  # the fault of this device has ended the run already
                self._see_hand()
            self._custody.keep()
        self._is_running = False

    def flush(self) -> None:
        """Wait a few seconds until the peg's state is on the disk, at the end of the program."""
        self._custody.flush()

    def _end(self, arm: ArmState, hand: GripperState, switch: SwitchState) -> None:
        self._tell(self._custody.end(self._evidence(arm, hand, switch), self._places))

    def refusal(self, entry: Entry, config: CellConfig) -> Refusal:
        """Return the reason why a program cannot start with this config now, or NONE."""
        if self.commissioning:
            logger.warning("%s refused: %s", entry.name, self.commissioning)
            return Refusal.COMMISSIONING
        if not entry.starts_empty:
            return Refusal.NONE
        if self._custody.part.place is PartPlace.SEATED and not self._custody.part.is_held:
            self._cell.exchange()
        self.look()
        found = self._custody.refusal(self._switch, config.rack, config.params(RECOVER).first)
        if found is not Refusal.NONE:
            logger.warning("%s refused, %s: %s", entry.name, found.name, told(self._custody.part))
        return found

    @property
    def is_resolved(self) -> bool:
        """True if the last peg may stay at its place, so that the next one can be taken."""
        return self._custody.part.place not in UNRESOLVED

    def take(self, config: CellConfig) -> int:
        """Return the slot of the next peg, and count it as emptied."""
        return self._custody.take(config.rack)

    def refill(self) -> None:
        """Register that the rack has been filled."""
        self._custody.refill()
        self._cell.refill()

    def clear(self) -> None:
        """Register that a person has removed the peg."""
        self._cell.clear()
        self._custody.clear()
        self.look()

    def filled(self, report: Report) -> Report:
        """Return a report with the state of the peg."""
        part = self._custody.part
        # The search result at the end of a run is more accurate than the position where the peg went in. During a run,
        # the result in the report belongs to the run before and must not be used.
        hole = report.hole if any(report.hole) and not self._is_running else self._hole
        told = replace(
            report,
            part=part.place,
            part_depth=part.depth,
            part_evidence=part.basis,
            part_width=round(part.width, 4),  # resolution of the register; smaller changes are noise
            hole=hole,
            peak_force=self._peak_force,
            obstacle=self._obstacle(),
        )
        return report if told == report else told

    def _obstacle(self) -> Refusal:
        """Return the reason why no fresh peg can be taken now, or NONE; a simulated line removes the workpiece with a seated peg."""
        config, part = self._cell.config, self._custody.part
        if self.commissioning:
            return Refusal.COMMISSIONING
        if config.is_simulated and part.place is PartPlace.SEATED and not part.is_held:
            return Refusal.NONE
        return self._custody.refusal(self._switch, config.rack, config.params(RECOVER).first)

    @property
    def part(self) -> PartState:
        """Last known state of the peg."""
        return self._custody.part

    def _devices(self) -> tuple[ArmState, GripperState, SwitchState]:
        return self._context.devices.arm.read(), self._context.read_hand(), self._cell.switch.read()

    def _see_hand(self) -> None:
        """Read hand and switch if the arm or the switch times out; if the hand times out too, change nothing."""
        self._switch = SwitchState.UNKNOWN
        with suppress(CellError):
            self._switch = self._cell.switch.read()
        with suppress(Exception):
            hand = self._context.read_hand()
            self._tell(self._custody.see_hand(hand, self._switch, self._places, self._is_running))

    def _evidence(self, arm: ArmState, hand: GripperState, switch: SwitchState) -> PegEvidence:
        in_hand = self._context.in_hand()
        tip, _ = end_point(arm.tcp, in_hand.theta, in_hand.length)
        return evidence_of(arm, hand, switch, tip, self._is_felt())

    def _is_felt(self) -> bool | None:
        """Return True if the skin measures a peg, for readings outside the scan; None without a trusted frame."""
        try:
            frame = self._cell.skin.read()
            if frame.sequence != self._frame:
                require_finite_skin(frame)
                if not is_trusted(frame):
                    return None
                if self._context.perception.estimator.estimate(frame).healthy:
                    self._felt_at = frame.stamp
                self._frame = frame.sequence
        except CellError:
            return None
        return frame.stamp - self._felt_at <= FELT_WITHIN

    def _tell(self, is_new: bool) -> None:
        if not is_new:
            return
        # At the first reading, log only a peg that needs attention.
        level = logging.INFO if self._has_looked else logging.WARNING
        if self._has_looked or not self.is_resolved:
            # During a run the remedy is left out, because the run handles the peg itself.
            logger.log(level, "%s", (described if self._is_running else told)(self._custody.part))
        self._has_looked = True
