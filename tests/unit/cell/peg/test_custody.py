"""State of peg and rack that is kept from one program to the next."""

import json
import os
import stat
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from cell.peg.custody import Custody
from cell.peg.part_state import PartState, PegEvidence, places_of
from cell.records.index import Index
from cell.records.journal import INDEX, Journal
from cell.records.schema import LOST, RunRow
from drivers.quantities import GripperState, SwitchState
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal
from tests.trouble import full_disk, until

OPEN = SwitchState.OPEN
RUN = RunRow(0, "2025-01-01T00:00:00.000+00:00", "insert_peg", 0, "", "plc", 1, is_simulated=1)
FILE = "part-sim.json"


class Keeper(Custody):
    """The custody of one program, and what its hand shows."""

    def __init__(self, folder, places, kind="sim"):
        super().__init__(folder, kind)
        self.places = places

    def holds(self, is_running=True, **changes):
        look = PegEvidence(GripperState(self.places.thickness, True, False), (0.45, 0.0, 0.3), OPEN)
        self.see(replace(look, **changes), self.places, is_running)
        return self

    def is_empty(self, is_running=False):
        self.see(PegEvidence(GripperState(0.04, False, False), (0.45, 0.0, 0.3), OPEN), self.places, is_running)
        return self


@pytest.fixture
def places(loaded):
    return places_of(loaded.cell)


@pytest.fixture
def program(tmp_path, places):
    """Return what begins a program in the same folder."""
    return lambda kind="sim": Keeper(tmp_path, places, kind)


@pytest.fixture
def rack(loaded):
    return loaded.cell.rack.model_copy(update={"refill": "asked"})


def test_the_state_of_the_peg_is_kept_for_the_next_program(program):
    first = program().is_empty().holds()
    assert first.flush()
    second = program().is_empty()
    assert second.part.place is PartPlace.UNKNOWN
    assert second.part.evidence == "in hand when the program ended; the hand is empty now"
    assert program("franka").is_empty().part.place is PartPlace.RACK  # a real cell shares nothing with a simulated one


def test_the_evidence_outlives_the_program(program):
    first = program().holds().is_empty(is_running=True)
    assert first.flush()
    assert first.part.place is PartPlace.ON_PLATE
    assert program().is_empty().part == replace(first.part, basis=first.part.basis | PartEvidence.RECORD)


def test_the_slide_is_kept_for_the_next_program(program, places):
    (x, y, z), first = places.hole.centre, program()
    first.places = replace(places, bears=12.5)
    for depth in (0.0, 0.006):
        first.holds(tip=(x, y, z - depth), push=20.0)
    first.keep()
    assert first.flush()
    second = program()
    second.places = first.places
    second.holds(is_running=False, tip=(x, y, z - 0.006))
    assert (second.part.place, second.part.slid) == (PartPlace.IN_HAND, pytest.approx(0.006))


def test_the_first_look_adds_the_bits_to_an_older_file(tmp_path, program):
    before = {"place": "ON_PLATE", "evidence": "fell", "is_held": False, "depth": 0.0, "tip": [0, 0, 0], "emptied": 2}
    (tmp_path / FILE).write_text(json.dumps(before))
    look = PartEvidence.HAND_EMPTY | PartEvidence.SWITCH_OPEN
    assert program().is_empty().part == PartState(PartPlace.ON_PLATE, "fell", basis=look, width=0.04)


@pytest.mark.parametrize(("has_run", "place"), [(False, PartPlace.RACK), (True, PartPlace.UNKNOWN)])
def test_without_a_file_only_a_new_cell_has_its_peg_racked(tmp_path, program, has_run, place):
    with Journal(tmp_path) as journal:
        if has_run:
            journal.writer.begin(RUN)
    part = program().is_empty().part
    assert part.place is place
    assert ("part-sim.json is missing, although runs are on record" in part.evidence) == has_run
    (tmp_path / FILE).unlink(missing_ok=True)
    assert program().holds(is_running=False).part.place is PartPlace.IN_HAND


def test_only_its_owner_reads_the_file_and_nothing_stays_beside_it(tmp_path, program):
    assert program().holds().flush()
    (file,) = tmp_path.iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert json.loads(file.read_text())["place"] == "IN_HAND"


SOUND = {"place": "RACK", "evidence": "", "is_held": False, "depth": 0.0, "tip": [0, 0, 0], "emptied": 0}
UNSOUND = [{"emptied": -1}, {"emptied": 2**31}, {"depth": float("nan")}, {"tip": [0]}, {"tip": [0, 0, 9e9]}]
UNSOUND += [{"more": 1}, {"basis": -1}]
DAMAGED = ["", "{", "[]", "[" * 100_000, "\x00" * 200, '{"place": "\\ud800"}', '{"place": "MOON"}', "no index"]
DAMAGED += [json.dumps({**SOUND, **change}) for change in UNSOUND]
DAMAGED += [json.dumps(SOUND).replace("0.0", "1e400"), json.dumps(SOUND).replace("RACK", "RACK" * 10_000)]


@pytest.mark.parametrize("text", DAMAGED, ids=range(len(DAMAGED)))
def test_a_damaged_file_makes_the_place_unknown(tmp_path, program, text):
    (tmp_path / FILE).write_text(text)
    part = program().is_empty().part
    assert part.place is PartPlace.UNKNOWN
    assert "cannot be read" in part.evidence


def test_an_index_that_cannot_be_read_may_have_runs(tmp_path, program):
    (tmp_path / INDEX).write_text("no index")
    assert program().is_empty().part.place is PartPlace.UNKNOWN


def test_a_state_lost_to_a_full_disk_is_unknown_until_written(tmp_path, program):
    first, file = program().is_empty(), tmp_path / FILE
    assert first.flush()
    assert json.loads(file.read_text())["place"] == "RACK"
    with full_disk():
        first.holds().is_empty(is_running=True)
        until(lambda: not file.read_text())
        assert program().is_empty().part.place is PartPlace.UNKNOWN
    assert first.flush()
    assert json.loads(file.read_text())["place"] == "ON_PLATE"
    assert [path.name for path in tmp_path.iterdir()] == [FILE]


@pytest.mark.parametrize(("hours", "place"), [(-1, PartPlace.UNKNOWN), (1, PartPlace.RACK)])
def test_a_file_older_than_a_lost_run_makes_the_place_unknown(tmp_path, program, hours, place):
    file = tmp_path / FILE
    file.write_text(json.dumps(SOUND))
    began = datetime.now(UTC)
    with closing(Index(tmp_path, is_read_only=False)) as index:
        index.put(replace(RUN, run=1, started=began.isoformat(), outcome=LOST))
    os.utime(file, times=(began.timestamp() + 3600 * hours,) * 2)
    part = program().is_empty().part
    assert part.place is place
    assert ("older than the last run, which was lost" in part.evidence) == (hours < 0)


def test_the_rack_empties_slot_by_slot_until_refilled(program, rack):
    custody = program().is_empty()
    assert [custody.take(rack) for _ in range(rack.slots)] == list(range(rack.slots))
    assert custody.refusal(OPEN, rack, recovers_first=False) is Refusal.RACK_EMPTY
    assert custody.flush()
    later = program().is_empty()
    assert later.refusal(OPEN, rack, recovers_first=False) is Refusal.RACK_EMPTY
    later.refill()
    assert later.refusal(OPEN, rack, recovers_first=False) is Refusal.NONE
    assert later.take(rack) == 0


def test_words_of_a_person_count_before_the_first_reading(program):
    assert program().holds().is_empty().flush()
    told = program()
    told.refill()
    assert told.flush()
    assert "outside a run" in program().is_empty().part.evidence
    told.clear()
    assert told.flush()
    assert (told.is_empty().part.place, program().is_empty().part.place) == (PartPlace.RACK, PartPlace.RACK)


def test_a_feeder_goes_round_the_slots_for_ever(program, loaded):
    custody, rack = program(), loaded.cell.rack
    assert [custody.take(rack) for _ in range(rack.slots + 2)] == [*range(rack.slots), 0, 1]
    assert custody.refusal(OPEN, rack, recovers_first=False) is Refusal.PART_UNRESOLVED


def test_a_cleared_peg_is_racked_until_the_hand_holds_one(program):
    custody = program().holds()
    custody.clear()
    assert custody.part.place is PartPlace.RACK
    assert custody.holds(is_running=False).part.place is PartPlace.IN_HAND
