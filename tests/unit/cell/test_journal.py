import json
from dataclasses import replace

import numpy as np
import pytest

from cell.journal import Journal, RunRow, config_hash
from cell.samples import BATCH, COLUMNS, TAXEL_COLUMNS, SampleStream, export_csv, read_samples
from drivers.errors import JournalError
from tests.fakes import Rig

ROW = RunRow(0, "2025-01-01T00:00:00.000+00:00", "insert_peg", 1, "A-17", "10.0.0.5:4711", 42)


@pytest.fixture
def journal(tmp_path):
    with Journal(tmp_path / "runs") as opened:
        yield opened


@pytest.fixture
def seen(rig: Rig):
    return rig.cell.context(0).observe()


def test_a_run_is_on_record_before_it_ends(journal):
    number = journal.begin(ROW).run
    assert journal.find(number).outcome == "running"


def test_numbers_count_up_and_are_kept(journal):
    first, second = journal.begin(ROW), journal.begin(ROW)
    assert (second.run - first.run, journal.last_run()) == (1, second.run)


def test_the_ending_ties_outcome_to_command(journal):
    row = journal.begin(ROW)
    journal.finish(
        replace(row, outcome="failure", stage="spray_search", reason="no_hole", stage_times=json.dumps([["a", 1.0]]))
    )
    found = journal.find(row.run)
    assert (found.sequence, found.serial, found.source, found.reason) == (42, "A-17", "10.0.0.5:4711", "no_hole")


def test_the_newest_run_comes_first(journal):
    for _ in range(3):
        journal.begin(ROW)
    assert [row.run for row in journal.runs(2)] == [3, 2]


def test_an_unknown_run_is_told_with_what_is_there(journal):
    journal.begin(ROW)
    with pytest.raises(JournalError, match=r"run 9: .*1 to 1 are on record"):
        journal.find(9)


def test_a_folder_that_cannot_be_made_is_a_fault(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(JournalError, match="cannot be used"):
        Journal(tmp_path / "file" / "runs").open()


def test_a_file_that_is_no_index_is_a_fault(tmp_path):
    (tmp_path / "runs.sqlite").write_text("nothing of the kind, but long enough to be read as a header" * 20)
    with pytest.raises(JournalError, match="cannot be used"):
        Journal(tmp_path).open()


def test_another_config_has_another_hash(loaded):
    other = loaded.cell.model_copy(update={"scan_rate": 50.0})
    assert config_hash(other) != config_hash(loaded.cell)


def test_samples_come_back_as_they_were(tmp_path, seen):
    stream = SampleStream(tmp_path / "a.arrows")
    for _ in range(BATCH + 7):
        stream.add(seen, None, 2)
    stream.close()
    samples = read_samples(tmp_path / "a.arrows")
    assert samples["stage"].tolist() == [2.0] * (BATCH + 7)
    assert samples["tcp_z"][-1] == seen.arm.tcp.position[2]
    assert np.isnan(samples["setpoint_x"]).all()
    assert samples["taxels"].shape == (BATCH + 7, 40)


def test_samples_are_readable_when_the_program_was_killed(tmp_path, seen):
    stream = SampleStream(tmp_path / "a.arrows")
    for _ in range(2 * BATCH):
        stream.add(seen, None, 1)
    whole = (tmp_path / "a.arrows").read_bytes()
    (tmp_path / "b.arrows").write_bytes(whole[:-10])
    assert read_samples(tmp_path / "b.arrows")["stamp"].size == BATCH
    stream.close()


def test_csv_has_a_row_a_scan(tmp_path, seen):
    stream = SampleStream(tmp_path / "a.arrows")
    stream.add(seen, None, 1)
    stream.close()
    export_csv(read_samples(tmp_path / "a.arrows"), tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert (lines[0].split(","), len(lines)) == ([*COLUMNS, *TAXEL_COLUMNS], 2)


def test_no_samples_are_told_by_their_file(tmp_path):
    with pytest.raises(JournalError, match="no samples on record"):
        read_samples(tmp_path / "gone.arrows")
