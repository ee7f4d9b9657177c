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
from drivers.quantities import SwitchState
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal
from tests.trouble import full_disk, until

OPEN = SwitchState.OPEN
RUN = RunRow(0, "2025-01-01T00:00:00.000+00:00", "insert_peg", 0, "", "plc", 1, is_simulated=1)


@pytest.fixture
def places(loaded):
    return places_of(loaded.cell.job(), loaded.cell.recover.bin)


@pytest.fixture
def rack(loaded):
    return loaded.cell.rack.model_copy(update={"refill": "asked"})


def holding(places):
    return PegEvidence(places.thickness, True, False, (0.45, 0.0, 0.3), 0.1, OPEN)


def empty():
    return PegEvidence(0.04, False, False, (0.45, 0.0, 0.3), 0.0, OPEN)


def test_the_next_program_knows_what_the_last_one_knew(tmp_path, places):
    first = Custody(tmp_path, "sim")
    first.see(empty(), places, is_running=False)
    first.see(holding(places), places, is_running=True)
    assert first.flush()
    second = Custody(tmp_path, "sim")
    second.see(empty(), places, is_running=False)
    assert second.part.place is PartPlace.UNKNOWN
    assert second.part.evidence == "in hand when the program ended; the hand is empty now"


def test_the_evidence_outlives_the_program(tmp_path, places):
    first = Custody(tmp_path, "sim")
    first.see(holding(places), places, is_running=True)
    first.see(empty(), places, is_running=True)
    assert first.flush()
    second = Custody(tmp_path, "sim")
    second.see(empty(), places, is_running=False)
    fell = first.part
    assert fell.place is PartPlace.ON_PLATE
    assert second.part == replace(fell, basis=fell.basis | PartEvidence.RECORD)


def test_a_file_of_an_earlier_version_has_the_place_and_the_first_look_the_bits(tmp_path, places):
    before = {"place": "ON_PLATE", "evidence": "fell", "is_held": False, "depth": 0.0, "tip": [0, 0, 0], "emptied": 2}
    (tmp_path / "part-sim.json").write_text(json.dumps(before))
    custody = Custody(tmp_path, "sim")
    custody.see(empty(), places, is_running=False)
    look = PartEvidence.HAND_EMPTY | PartEvidence.SWITCH_OPEN
    assert custody.part == PartState(PartPlace.ON_PLATE, "fell", basis=look, width=0.04)


@pytest.mark.parametrize(("has_run", "place"), [(False, PartPlace.RACK), (True, PartPlace.UNKNOWN)])
def test_without_a_file_a_new_cell_has_its_peg_in_the_rack_and_one_that_has_run_does_not_know(
    tmp_path, places, has_run, place
):
    with Journal(tmp_path) as journal:
        if has_run:
            journal.begin(RUN)
    custody = Custody(tmp_path, "sim")
    custody.see(empty(), places, is_running=False)
    assert custody.part.place is place
    assert ("part-sim.json is missing, although runs are on record" in custody.part.evidence) == has_run


def test_without_a_file_a_peg_in_the_hand_is_still_told_by_the_hand(tmp_path, places):
    with Journal(tmp_path) as journal:
        journal.begin(RUN)
    custody = Custody(tmp_path, "sim")
    custody.see(holding(places), places, is_running=False)
    assert custody.part.place is PartPlace.IN_HAND


def test_what_a_simulated_cell_knows_is_nothing_to_a_real_one(tmp_path, places):
    simulated = Custody(tmp_path, "sim")
    simulated.see(holding(places), places, is_running=True)
    assert simulated.flush()
    real = Custody(tmp_path, "franka")
    real.see(empty(), places, is_running=False)
    assert real.part.place is PartPlace.RACK


def test_only_its_owner_reads_the_file_and_nothing_stays_beside_it(tmp_path, places):
    custody = Custody(tmp_path, "sim")
    custody.see(holding(places), places, is_running=True)
    assert custody.flush()
    (file,) = tmp_path.iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert json.loads(file.read_text())["place"] == "IN_HAND"


SOUND = {"place": "RACK", "evidence": "", "is_held": False, "depth": 0.0, "tip": [0, 0, 0], "emptied": 0}
DAMAGED = ["", "{", "[]", "[" * 100_000, "\x00" * 200, '{"place": "\\ud800"}', '{"place": "MOON"}']
DAMAGED += [
    json.dumps({**SOUND, **change}) for change in ({"emptied": -1}, {"emptied": 2**31}, {"depth": float("nan")})
]
DAMAGED += [
    json.dumps({**SOUND, **change}) for change in ({"tip": [0]}, {"tip": [0, 0, 9e9]}, {"more": 1}, {"basis": -1})
]
DAMAGED += [json.dumps(SOUND).replace("0.0", "1e400"), json.dumps(SOUND).replace("RACK", "RACK" * 10_000)]


@pytest.mark.parametrize("text", DAMAGED, ids=range(len(DAMAGED)))
def test_a_damaged_file_says_that_nobody_knows(tmp_path, places, text):
    (tmp_path / "part-sim.json").write_text(text)
    custody = Custody(tmp_path, "sim")
    custody.see(empty(), places, is_running=False)
    assert custody.part.place is PartPlace.UNKNOWN
    assert "cannot be read" in custody.part.evidence


def test_a_folder_that_cannot_be_written_stops_nothing(tmp_path, places, caplog):
    custody = Custody(tmp_path / "gone", "sim")
    custody.see(holding(places), places, is_running=True)
    assert custody.part.place is PartPlace.IN_HAND
    until(lambda: "cannot be kept" in caplog.text)
    (tmp_path / "gone").mkdir()
    assert custody.flush()


def test_what_a_full_disk_could_not_keep_is_unknown_to_the_next_program_and_kept_later(tmp_path, places):
    first, file = Custody(tmp_path, "sim"), tmp_path / "part-sim.json"
    first.see(empty(), places, is_running=False)
    assert first.flush()
    assert json.loads(file.read_text())["place"] == "RACK"
    with full_disk():
        first.see(holding(places), places, is_running=True)
        first.see(empty(), places, is_running=True)
        until(lambda: not file.read_text())
        second = Custody(tmp_path, "sim")
        second.see(empty(), places, is_running=False)
        assert second.part.place is PartPlace.UNKNOWN
    assert first.flush()
    assert json.loads(file.read_text())["place"] == "ON_PLATE"
    assert [path.name for path in tmp_path.iterdir()] == ["part-sim.json"]


@pytest.mark.parametrize(("hours", "place"), [(-1, PartPlace.UNKNOWN), (1, PartPlace.RACK)])
def test_a_file_older_than_a_lost_run_says_that_nobody_knows(tmp_path, places, hours, place):
    file = tmp_path / "part-sim.json"
    file.write_text(json.dumps(SOUND))
    began = datetime.now(UTC)
    with closing(Index(tmp_path, is_read_only=False)) as index:
        index.put(replace(RUN, run=1, started=began.isoformat(), outcome=LOST))
    os.utime(file, times=(began.timestamp() + 3600 * hours,) * 2)
    custody = Custody(tmp_path, "sim")
    custody.see(empty(), places, is_running=False)
    assert custody.part.place is place
    assert ("older than the last run, which was lost" in custody.part.evidence) == (hours < 0)


def test_an_index_that_cannot_be_read_may_have_runs(tmp_path, places):
    (tmp_path / INDEX).write_text("no index")
    custody = Custody(tmp_path, "sim")
    custody.see(empty(), places, is_running=False)
    assert custody.part.place is PartPlace.UNKNOWN


def test_the_rack_empties_slot_by_slot_is_refused_empty_and_full_again_when_told(tmp_path, places, rack):
    custody = Custody(tmp_path, "sim")
    custody.see(empty(), places, is_running=False)
    assert [custody.take(rack) for _ in range(rack.slots)] == list(range(rack.slots))
    assert custody.refusal(OPEN, rack, recovers_first=False) is Refusal.RACK_EMPTY
    assert custody.flush()
    later = Custody(tmp_path, "sim")
    later.see(empty(), places, is_running=False)
    assert later.refusal(OPEN, rack, recovers_first=False) is Refusal.RACK_EMPTY
    later.refill()
    assert later.refusal(OPEN, rack, recovers_first=False) is Refusal.NONE
    assert later.take(rack) == 0


def test_a_feeder_goes_round_the_slots_for_ever(tmp_path, loaded):
    custody = Custody(tmp_path, "sim")
    rack = loaded.cell.rack
    assert [custody.take(rack) for _ in range(rack.slots + 2)] == [*range(rack.slots), 0, 1]
    assert custody.refusal(OPEN, rack, recovers_first=False) is Refusal.PART_UNRESOLVED


def test_a_person_who_clears_is_believed_until_the_hand_says_otherwise(tmp_path, places):
    custody = Custody(tmp_path, "sim")
    custody.see(holding(places), places, is_running=True)
    custody.clear()
    assert custody.part.place is PartPlace.RACK
    custody.see(holding(places), places, is_running=False)
    assert custody.part.place is PartPlace.IN_HAND


def test_the_next_program_knows_how_far_the_hand_has_slid_down_the_peg(tmp_path, places):
    places, (x, y, z) = replace(places, bears=12.5), places.hole.centre
    first = Custody(tmp_path, "sim")
    for depth in (0.0, 0.006):
        pressed = replace(holding(places), tip=(x, y, z - depth), push=20.0)
        first.see(pressed, places, is_running=True)
    first.end(pressed, places)
    assert first.flush()
    second = Custody(tmp_path, "sim")
    second.see(replace(pressed, push=0.0), places, is_running=False)
    assert (second.part.place, second.part.slid) == (PartPlace.IN_HAND, pytest.approx(0.006))
