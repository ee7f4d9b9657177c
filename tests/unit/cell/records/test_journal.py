"""The journal returns each run as recorded, and refuses a folder or index that it cannot use."""

import shutil
import sqlite3
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from cell.commands.cli import main
from cell.commands.terminal import FAULT, GOOD
from cell.records.journal import INDEX, Journal, default_folder, newest_run
from cell.records.provenance import config_hash
from cell.records.sample_blocks import BATCH, COLUMNS, JOINT_COLUMNS, SampleStream, taxel_columns
from cell.records.samples import SampleFile, export_csv, read_facts, read_samples
from cell.records.schema import LAYOUT, ConfigRow, EventKind, EventRow, StageRow
from drivers.errors import JournalError
from drivers.frames import rotation_about, rotation_of
from drivers.quantities import Pose
from drivers.scene_facts import Sight
from tests.unit.cell.records.test_journal_writer import ROW, recorded


@contextmanager
def stream(path, facts=None):
    """Write a stream of samples to a file at once."""
    file = SampleFile(path, facts)
    made = SampleStream(file.write)
    yield made
    file.write(made.rest())
    file.close()


@pytest.fixture
def journal(tmp_path):
    with Journal(tmp_path / "runs") as opened:
        yield opened


def test_a_run_is_on_record_from_its_beginning_to_its_end(journal):
    first, row = journal.writer.begin(ROW), journal.writer.begin(ROW)
    assert (row.run - first.run, journal.last_run()) == (1, row.run)
    assert [found.run for found in journal.runs(1)] == [row.run]
    assert journal.find(row.run).outcome == "running"
    journal.writer.finish(replace(row, outcome="failure", stage="spray_search", reason="no_hole"))
    found = journal.find(row.run)
    assert (found.sequence, found.serial, found.source, found.reason) == (42, "A-17", "10.0.0.5:4711", "no_hole")


def test_an_unknown_run_is_refused_with_those_on_record(journal):
    with pytest.raises(JournalError, match=r"run 3: not in .*; no runs are on record yet"):
        journal.find(3)
    assert (journal.is_disk_low, journal.trouble) == (False, "")
    journal.writer.begin(ROW)
    with pytest.raises(JournalError, match=r"run 9: .*1 to 1 are on record"):
        journal.find(9)


def test_an_unusable_folder_or_index_is_a_fault(tmp_path):
    (tmp_path / INDEX).write_text("nothing of the kind, but long enough to be read as a header" * 20)
    for folder, is_read_only in ((tmp_path / INDEX / "runs", False), (tmp_path, True)):
        with pytest.raises(JournalError, match="cannot be used"):
            Journal(folder, is_read_only=is_read_only).open()


def test_the_newest_run_is_that_of_a_simulated_or_real_cell(journal):
    assert newest_run(journal.folder, is_simulated=True) is None
    number = journal.writer.begin(replace(ROW, is_simulated=1)).run
    assert journal.find(number)  # it is written
    assert newest_run(journal.folder, is_simulated=True) == journal.find(number)
    assert newest_run(journal.folder, is_simulated=False) is None


@pytest.mark.parametrize("layout", [0, LAYOUT - 1, LAYOUT + 1])
def test_an_index_of_another_layout_is_refused_unchanged(tmp_path, layout):
    with Journal(tmp_path):
        pass
    with closing(sqlite3.connect(tmp_path / INDEX)) as index:
        index.execute(f"PRAGMA user_version = {layout}")
    for is_read_only in (False, True):
        with pytest.raises(JournalError, match=rf"runs\.sqlite: layout {layout} of another version; {LAYOUT} allowed"):
            Journal(tmp_path, is_read_only=is_read_only).open()
    with closing(sqlite3.connect(tmp_path / INDEX)) as index:
        assert index.execute("PRAGMA user_version").fetchone()[0] == layout


def test_reading_makes_no_folder(tmp_path):
    with Journal(tmp_path / "none", is_read_only=True) as journal:
        assert journal.runs(5) == []
    assert not (tmp_path / "none").exists()


def test_others_can_read_an_open_journal_and_not_write_it(journal):
    number = journal.writer.begin(ROW).run
    assert journal.find(number) == replace(ROW, run=number)
    with Journal(journal.folder, is_read_only=True) as reader:
        assert reader.find(number).outcome == "running"
        with pytest.raises(JournalError, match="not open to write"):
            reader.writer.begin(ROW)


def test_files_are_their_owners_alone(tmp_path):
    with Journal(tmp_path / "runs") as journal:
        journal.writer.begin(ROW)
        assert {file.stat().st_mode & 0o777 for file in journal.folder.iterdir()} == {0o600}
    assert (tmp_path / "runs").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("mode", [0o720, 0o775, 0o702, 0o777])
def test_a_folder_that_others_may_write_is_refused_in_one_line(tmp_path, mode):
    (tmp_path / "own").mkdir()
    (tmp_path / "own").chmod(mode & 0o755)
    with Journal(tmp_path / "own") as journal:
        assert journal.writer.begin(ROW).run == 1
    shutil.rmtree(tmp_path / "own")
    tmp_path.chmod(mode)
    with pytest.raises(JournalError, match=rf"^[^\n]*: mode {mode:o}: others than its owner may write [^\n]*$"):
        Journal(tmp_path).open()
    assert list(tmp_path.iterdir()) == []


def test_stages_are_read_in_order_with_unknown_values_empty(journal):
    row = journal.writer.begin(ROW)
    stages = [
        StageRow(row.run, 1, "grasp_from_rack", 0.0, 4.0, 3.0, "success", theta=0.4, sigma=0.01),
        StageRow(row.run, 2, "spray_search", 4.0, 9.0),
    ]
    journal.writer.finish(replace(row, outcome="fault"), stages)
    assert journal.stages(row.run) == stages


def test_events_are_read_oldest_first_and_by_run(journal):
    for second, run in ((1, 0), (2, 7)):
        journal.writer.note(
            EventRow(0, f"2025-01-01T00:00:0{second}", 1.5, EventKind.FAULT, "SKIN_SILENT", 1001, run=run)
        )
    assert [event.run for event in journal.events()] == [0, 7]
    assert [event.event for event in journal.events(run=7)] == [2]


def test_a_config_is_recorded_once_under_its_hash(journal, loaded):
    for _ in range(2):
        journal.writer.keep_config(ConfigRow("abc", '{"scan_rate": 100.0}'))
    assert (journal.config("abc"), journal.config("other")) == ('{"scan_rate": 100.0}', None)
    assert config_hash(loaded.cell.model_copy(update={"scan_rate": 50.0})) != config_hash(loaded.cell)


def test_samples_are_read_as_recorded(tmp_path, seen):
    untold = replace(seen, arm=replace(seen.arm, commanded=None))
    with stream(tmp_path / "a.arrows") as samples:
        for _ in range(BATCH + 7):
            samples.add(untold, None, 2)
    found = read_samples(tmp_path / "a.arrows")
    assert found["stage"].tolist() == [2.0] * (BATCH + 7)
    assert found["tcp_z"][-1] == seen.arm.tcp.position[2]
    assert found["taxels"].shape == (BATCH + 7, 40)
    unknown = [name for name in COLUMNS if name.startswith("true_")]
    assert all(np.isnan(found[name]).all() for name in ("setpoint_x", "torques", *unknown))
    with pytest.raises(JournalError, match=r"a\.arrows: recorded by another version"):
        read_facts(tmp_path / "a.arrows")
    with pytest.raises(JournalError, match="no samples on record"):
        read_samples(tmp_path / "gone.arrows")
    export_csv(found, tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    joints = [f"{name}_{number}" for name in ("joint", "joint_velocity", "joint_torque") for number in range(1, 8)]
    assert (lines[0].split(","), len(lines)) == ([*COLUMNS, *taxel_columns(40), *joints], BATCH + 8)


def test_joints_and_true_poses_are_read_as_recorded(tmp_path, seen):
    lean = rotation_about(np.array([0.6, 0.0, 0.8]), 2.0)
    sight = Sight(peg=Pose(np.array([0.5, 0.1, 0.2]), lean), hole=Pose(np.array([0.4, 0.0, 0.1]), np.eye(3)))
    torque = np.arange(7.0)
    with stream(tmp_path / "a.arrows") as written:
        written.add(replace(seen, arm=replace(seen.arm, commanded=torque)), None, 2, sight)
    samples = read_samples(tmp_path / "a.arrows")
    quaternion = np.array([samples[f"true_peg_q{part}"][0] for part in "wxyz"])
    assert samples["joints"].tolist() == [seen.arm.q.tolist()]
    assert samples["velocities"].tolist() == [seen.arm.dq.tolist()]
    assert samples["torques"].tolist() == [torque.tolist()]
    assert samples["true_hole_x"].tolist() == [0.4]
    np.testing.assert_allclose(rotation_of(quaternion), lean, atol=1e-15)


def test_samples_of_an_earlier_version_are_read_without_newer_columns(tmp_path, seen):
    with stream(tmp_path / "new.arrows") as written:
        written.add(seen, None, 3)
    with pa.OSFile(str(tmp_path / "new.arrows")) as file:
        table = pa.ipc.open_stream(file).read_all()
    early = table.select(
        [name for name in table.column_names if name not in JOINT_COLUMNS and not name.startswith("true_")]
    )
    with pa.OSFile(str(tmp_path / "old.arrows"), "wb") as file, pa.ipc.new_stream(file, early.schema) as writer:
        writer.write_table(early)
    samples = read_samples(tmp_path / "old.arrows")
    assert (samples["stage"].tolist(), samples["taxels"].shape, samples["torques"].shape) == ([3.0], (1, 40), (1, 0))
    assert np.isnan(samples["true_peg_x"]).all()


def test_samples_of_a_killed_program_are_read(tmp_path, seen):
    with stream(tmp_path / "a.arrows") as written:
        for _ in range(2 * BATCH):
            written.add(seen, None, 1)
        whole = (tmp_path / "a.arrows").read_bytes()
    (tmp_path / "b.arrows").write_bytes(whole[:-10])
    assert read_samples(tmp_path / "b.arrows")["stamp"].size == BATCH


def test_show_prints_the_index_before_a_torn_file_of_samples(tmp_path, capsys):
    with Journal(tmp_path) as journal:
        journal.writer.finish(replace(journal.writer.begin(ROW), outcome="success", serial="A-18"))
    (tmp_path / "run-000001.arrows").write_bytes(b"x")
    assert main(["show", "1", "--journal", str(tmp_path)]) == FAULT
    told = capsys.readouterr()
    assert "A-18" in told.out
    assert "torn: no whole block of samples" in told.err
    with pytest.raises(JournalError, match="torn: not even its head"):
        read_facts(tmp_path / "run-000001.arrows")


def test_an_export_counts_the_samples_that_it_can_read(tmp_path, seen, capsys):
    with Journal(tmp_path) as journal:
        recorded(journal, seen, scans=BATCH + 1)
    path = tmp_path / "run-000001.arrows"
    export = ["runs", "--export", "csv", "--out", str(tmp_path / "csv"), "--journal", str(tmp_path)]
    assert main(export) == GOOD
    assert "torn" not in capsys.readouterr().err
    path.write_bytes(path.read_bytes()[:-1000])
    assert main(export) == GOOD
    assert f"{path}: torn: {BATCH} of {BATCH + 1} samples can be read" in capsys.readouterr().err


def test_the_default_folder_is_in_the_users_data(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "tactile-insertion-cell"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_folder() == tmp_path / ".local" / "share" / "tactile-insertion-cell"
