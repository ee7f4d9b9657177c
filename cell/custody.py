"""Custody of the peg over faults, resets and restarts: where it is and what the rack still holds, in a small file
beside the journal.
"""

import json
import logging
import os
from dataclasses import asdict
from pathlib import Path

from cell.part_state import PartState, PegEvidence, Places, after, after_run, at_start, refusal_of
from drivers.parts import Rack
from drivers.quantities import SwitchState
from plc_bridge.messages import PartPlace, Refusal

logger = logging.getLogger(__name__)

OWNER_ONLY = 0o600
"""Permissions of the file."""


class Custody:
    """Place of the peg of one cell, and number of emptied slots of its rack; for the scan thread."""

    def __init__(self, folder: Path, kind: str) -> None:
        """Read the state that the program before this one left.

        Args:
            folder: Folder of the journal.
            kind: `arm.kind` of the config: a simulated cell never speaks for a real one.
        """
        self._path = folder / f"part-{kind}.json"
        self._kept, self._emptied = _read(self._path)
        self._is_known = False
        self.part = PartState(PartPlace.UNKNOWN, "nothing was looked at yet")
        """Last known state of the peg."""

    def see(self, seen: PegEvidence, places: Places, is_running: bool) -> bool:
        """Take one look at the devices; return whether the peg's place has changed."""
        if self._is_known:
            return self._become(after(self.part, seen, places, is_running))
        self._is_known = True
        return self._become(at_start(self._kept, seen, places))

    def end(self, seen: PegEvidence, places: Places) -> bool:
        """Take the look after a run; return whether the peg's place has changed."""
        is_new = self._become(after_run(self.part, seen, places))
        self.keep(is_lasting=True)
        return is_new

    def refusal(self, switch: SwitchState, rack: Rack, recovers_first: bool) -> Refusal:
        """Return why no fresh peg can be taken now, or NONE."""
        is_empty = rack.refill == "asked" and self._emptied >= rack.slots
        return refusal_of(self.part, switch, is_empty, recovers_first)

    def take(self, rack: Rack) -> int:
        """Return the slot that the next peg is taken from, which is empty from now on."""
        slot = self._emptied % rack.slots
        self._emptied = slot + 1 if rack.refill == "feeder" else self._emptied + 1
        self.keep()
        return slot

    def refill(self) -> None:
        """Take note that every slot of the rack is filled."""
        self._emptied = 0
        self.keep(is_lasting=True)

    def clear(self) -> None:
        """Take note that a person has taken the peg away; evidence of the devices counts again from the next look on."""
        self._become(PartState(PartPlace.RACK, "a person has taken the last peg away"))
        self.keep(is_lasting=True)

    def _become(self, part: PartState) -> bool:
        before, self.part = self.part, part
        is_new = (before.place, before.is_held) != (part.place, part.is_held)
        if is_new:
            self.keep()
        return is_new

    def keep(self, is_lasting: bool = False) -> None:
        """Write the file, whole or not at all; with `is_lasting` wait until it is on the disk, which is for times
        without motion.
        """
        data = {**asdict(self.part), "place": self.part.place.name, "emptied": self._emptied}
        beside = self._path.with_suffix(".tmp")
        try:
            handle = os.open(beside, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, OWNER_ONLY)
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump(data, file)
                if is_lasting:
                    file.flush()
                    os.fsync(file.fileno())
            beside.replace(self._path)
        except OSError as error:
            logger.warning("%s: where the peg is cannot be kept: %s", self._path, error.strerror)


def _read(path: Path) -> tuple[PartState | None, int]:
    """Return the content of the file; a damaged one says that the place is unknown."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        emptied = int(data.pop("emptied"))
        x, y, z = (float(value) for value in data.pop("tip"))
        place = PartPlace[data.pop("place")]
        return PartState(place, str(data["evidence"]), bool(data["is_held"]), float(data["depth"]), (x, y, z)), emptied
    except FileNotFoundError:
        return None, 0
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        logger.warning("%s: cannot be read: %s", path, error)
        return PartState(PartPlace.UNKNOWN, f"{path.name} cannot be read"), 0
