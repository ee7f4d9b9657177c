"""Tests of the program `feeder` against a simulated cell, which the fixture `cell` serves."""

from contextlib import closing

import pytest
from feeder import Feeder


@pytest.fixture
def feeder(cell):
    with closing(Feeder(*cell.address)) as feeder:
        yield feeder


def test_a_peg_is_inserted_and_recorded(cell, feeder):
    assert feeder.insert("P-001") == "good"
    (run,) = cell.runs
    assert (run.serial, run.outcome) == ("P-001", "success")


def test_a_run_with_an_unplugged_skin_ends_in_a_fault_and_the_next_one_is_good(cell, feeder):
    cell.unplug_skin()
    assert feeder.insert("P-001") == "fault 1001"
    cell.repair()
    assert feeder.reset() == "good"
    assert feeder.insert("P-001") == "good"


def test_a_run_without_a_peg_fails_and_nothing_is_recorded_as_inserted(cell, feeder):
    cell.empty_rack()
    assert feeder.insert("P-001") == "failed"
    assert [run.reason for run in cell.runs] == ["missed_grasp"]


def test_the_program_writes_where_the_map_says(cell):
    place = cell.map["command_serial"]
    assert (place.address, place.words) == (8, 16)
