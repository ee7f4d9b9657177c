"""Record of the peg over faults, resets and restarts: its place and the emptied slots of the rack, in a file beside the journal."""

import json
import logging
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field, ValidationError

from cell.peg.part_state import (
    SIGNS,
    PartState,
    PegEvidence,
    Places,
    after,
    after_run,
    at_start,
    by_hand_alone,
    proven,
    refusal_of,
)
from cell.records.journal import newest_run
from cell.records.kept_file import KeptFile
from cell.records.schema import LOST, UNKNOWN_RUN
from drivers.config_model import ConfigModel
from drivers.errors import JournalError
from drivers.parts import Coordinate, Rack
from drivers.quantities import GripperState, SwitchState
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal

logger = logging.getLogger(__name__)

FLUSH_TIME = 5.0
"""Longest wait for the disk when the program ends, s."""


class Custody:
    """Place of one cell's peg, and number of emptied slots of its rack; for the scan thread."""

    def __init__(self, folder: Path, kind: str) -> None:
        """Read the state left by the earlier program.

        If runs are on record but the file is missing or too old, the place is unknown.

        Args:
            folder: Folder of the journal.
            kind: `arm.kind` of the config; simulated and real cells use separate files.
        """
        self._file = KeptFile(folder / f"part-{kind}.json", "where the peg is", is_void_if_late=True)
        self._kept, self._emptied = _read(self._file.path)
        if doubt := _doubt(self._file.path, folder, is_simulated=kind == "sim"):
            logger.warning("%s: %s", self._file.path, doubt)
            self._kept = PartState(PartPlace.UNKNOWN, f"{self._file.path.name} {doubt}")
        self._is_known = False
        self.part = PartState(PartPlace.UNKNOWN, "no device was read yet")
        """Last known state of the peg."""

    def see(self, seen: PegEvidence, places: Places, is_running: bool) -> bool:
        """Update the state from one reading of the devices; return True if the peg's place has changed."""
        if self._is_known:
            return self._become(after(self.part, seen, places, is_running))
        self._is_known = True
        return self._become(at_start(self._kept, seen, places))

    def see_hand(self, hand: GripperState, switch: SwitchState, places: Places, is_running: bool) -> bool:
        """Update the state from one reading without the arm's pose; return True if the peg's place has changed."""
        return self._is_known and self._become(by_hand_alone(self.part, hand, switch, places, is_running))

    def end(self, seen: PegEvidence, places: Places) -> bool:
        """Update the state from the reading after a run; return True if the peg's place has changed."""
        return self._become(after_run(self.part, seen, places))

    def refusal(self, switch: SwitchState, rack: Rack, recovers_first: bool) -> Refusal:
        """Return why no fresh peg can be taken now, or NONE."""
        is_empty = rack.refill == "asked" and self._emptied >= rack.slots
        return refusal_of(self.part, switch, is_empty, recovers_first)

    def take(self, rack: Rack) -> int:
        """Return the slot of the next peg, and count it as emptied."""
        slot = self._emptied % rack.slots
        self._emptied = slot + 1 if rack.refill == "feeder" else self._emptied + 1
        self.keep()
        return slot

    def refill(self) -> None:
        """Register that every slot of the rack is filled."""
        self._emptied = 0
        self.keep()

    def seat(self, evidence: str, by: PartEvidence) -> None:
        """Register that the released peg is seated, by evidence of the run."""
        self._become(proven(self.part, evidence, by))

    def clear(self) -> None:
        """Register that a person has removed the peg; from the next reading on, the devices decide its place again."""
        self._kept = PartState(PartPlace.RACK, SIGNS[PartEvidence.PERSON], basis=PartEvidence.PERSON)
        self._become(self._kept)
        self.keep()

    def _become(self, part: PartState) -> bool:
        before, self.part = self.part, part
        is_new = (before.place, before.is_held) != (part.place, part.is_held)
        if is_new:
            self.keep()
        return is_new

    def keep(self) -> None:
        """Queue the present state for the file, without waiting for the disk."""
        part = self.part if self._is_known or self._kept is None else self._kept
        data = {**asdict(part), "place": part.place.name, "emptied": self._emptied}
        self._file.put(json.dumps(data))

    def flush(self) -> bool:
        """Wait up to `FLUSH_TIME` until the present state is in the file; return True if it is. Called when the program ends."""
        return self._file.flush(FLUSH_TIME)


def _doubt(path: Path, folder: Path, *, is_simulated: bool) -> str:
    """Return why the file does not show the peg's present place; empty if it does, or before the first run.

    If the end of a run is not on record, the peg may have moved after the last write to the disk.
    """
    try:
        newest = newest_run(folder, is_simulated=is_simulated)
        began = 0.0 if newest is None or newest.outcome != LOST else datetime.fromisoformat(newest.started).timestamp()
    except (JournalError, ValueError):
        newest, began = UNKNOWN_RUN, 0.0
    try:
        written = path.stat().st_mtime
    except OSError:
        return "is missing, although runs are on record" if newest is not None else ""
    return "is older than the last run, which was lost" if written < began else ""


def _known_place(name: object) -> PartPlace:
    if name not in PartPlace.__members__:
        raise ValueError(f"{', '.join(PartPlace.__members__)} allowed")
    return PartPlace[str(name)]


class KeptPart(ConfigModel):
    """Content of the file; files of earlier versions lack `basis`, `width` and `slid`."""

    place: Annotated[PartPlace, BeforeValidator(_known_place)]
    evidence: Annotated[str, Field(max_length=1000)]
    is_held: bool
    depth: Coordinate
    tip: tuple[Coordinate, Coordinate, Coordinate]
    was_in_hole: bool = False
    basis: Annotated[int, Field(ge=0, lt=2 << 16)] = 0
    width: Coordinate = 0.0
    slid: Coordinate = 0.0
    emptied: Annotated[int, Field(ge=0, lt=1 << 31)]
    """Number of emptied slots of the rack, or the number of the slot that a feeder fills next."""


def _read(path: Path) -> tuple[PartState | None, int]:
    """Return the state in the file and the number of emptied slots; None and 0 without a file.

    If the file is damaged, the place is unknown.
    """
    try:
        kept = KeptPart.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None, 0
    except (OSError, ValidationError) as error:
        first = error.errors(include_url=False)[0]["msg"] if isinstance(error, ValidationError) else error
        logger.warning("%s: cannot be read: %s", path, first)
        return PartState(PartPlace.UNKNOWN, f"{path.name} cannot be read"), 0
    data = dict(kept)
    emptied, _ = data.pop("emptied"), data.pop("was_in_hole")
    return PartState(**{**data, "basis": PartEvidence(kept.basis)}), emptied
