"""Other programs read exported runs and samples."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from cell.commands.cli import GOOD, main
from cell.records.sample_blocks import COLUMNS, JOINT_COLUMNS
from cell.records.sample_export import unit_of, write_mcap, write_runs_parquet, write_samples_parquet
from cell.records.samples import columns_of, read_samples
from cell.records.schema import RunRow
from tests.fakes import Rig
from tests.filmed_runs import record

ROW = RunRow(7, "2025-01-01T00:00:00.000+00:00", "insert_peg", 1, "PN7[a]-[/x]", "10.0.0.5:1", 42, ended="")
NSEC = 1_735_689_600_000_000_000  # the same start


@pytest.fixture
def samples(rig: Rig):
    number = record(rig, rig.journal, knows_truth=True)
    assert rig.journal.find(number).outcome == "running"  # after this, all of it is on the disk
    return read_samples(rig.journal.samples_path(number))


def test_every_column_has_its_unit_and_frame_in_the_file(samples, tmp_path):
    write_samples_parquet(ROW, samples, tmp_path / "run.parquet")
    schema = pq.read_schema(tmp_path / "run.parquet")
    assert [field.metadata[b"unit"].decode() for field in schema] == [unit_of(name) for name in columns_of(samples)]
    assert schema.field("force_z").metadata[b"frame"] == b"base"
    names = ("true_peg_qw", "true_hole_x", "joint_7", "joint_velocity_7", "joint_torque_1", "taxel_left_3")
    assert [unit_of(name) for name in names] == ["", "m", "rad", "rad/s", "N·m", "counts"]
    assert {unit_of(name) for name in COLUMNS} == {"", "s", "m", "N", "rad"}
    assert b"without what the arm itself adds against gravity" in schema.field("joint_torque_1").metadata[b"note"]
    assert json.loads(schema.metadata[b"run"])["serial"] == ROW.serial


def test_pandas_and_duckdb_read_the_same_samples(samples, tmp_path):
    pandas, duckdb = pytest.importorskip("pandas"), pytest.importorskip("duckdb")
    path = tmp_path / "run.parquet"
    write_samples_parquet(ROW, samples, path)
    frame = pandas.read_parquet(path)
    assert np.array_equal(frame["tip_z"], samples["tip_z"], equal_nan=True)
    (found,) = duckdb.sql(f"SELECT count(*), max(joint_1) FROM '{path}'").fetchall()
    assert found == (samples["stamp"].size, samples["joints"][:, 0].max())


def test_a_run_without_a_scan_is_a_file_without_rows(samples, tmp_path):
    none = {name: values[:0] for name, values in samples.items()}
    none |= dict.fromkeys(("taxels", *JOINT_COLUMNS), np.empty((0, 0)))
    write_samples_parquet(ROW, none, tmp_path / "none.parquet")
    assert pq.read_table(tmp_path / "none.parquet").num_rows == 0


def test_runs_are_a_table_with_times_as_times(tmp_path):
    duckdb = pytest.importorskip("duckdb")
    write_runs_parquet([ROW], tmp_path / "runs.parquet")
    table = pq.read_table(tmp_path / "runs.parquet")
    assert str(table.schema.field("started").type) == "timestamp[ms, tz=UTC]"
    assert duckdb.sql(f"SELECT run, serial, ended FROM '{tmp_path / 'runs.parquet'}'").fetchall() == [
        (7, ROW.serial, None)
    ]


def test_an_mcap_reader_finds_every_scan_under_its_schema(samples, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    write_mcap(ROW, samples, tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        opened = reader.make_reader(file)
        found = [
            (schema.name, channel.topic, message.log_time, json.loads(message.data))
            for schema, channel, message in opened.iter_messages()
        ]
        summary = opened.get_summary()
    assert summary.statistics.message_count == 6 * samples["stamp"].size
    name, topic, time, tip = found[0]
    assert (name, topic, time) == ("foxglove.PoseInFrame", "/tip", NSEC)
    assert tip["pose"]["position"]["z"] == pytest.approx(samples["tip_z"][0])
    assert np.linalg.norm(list(tip["pose"]["orientation"].values())) == pytest.approx(1.0)
    joints = next(message for _, topic, _, message in found if topic == "/joints")
    assert [joints[name] for name in ("position", "velocity")] == [
        samples[name][0].tolist() for name in ("joints", "velocities")
    ]
    assert len(joints["effort"]) == 7
    touch = next(message for _, topic, _, message in found if topic == "/touch")
    assert touch["left"] + touch["right"] == samples["taxels"][0].tolist()


@pytest.mark.parametrize(("kind", "files"), [("parquet", 2), ("csv", 2), ("mcap", 1)])
def test_runs_are_exported_with_their_samples(rig, tmp_path, capsys, kind, files):
    if kind == "mcap":
        pytest.importorskip("mcap")
    number = record(rig, rig.journal, knows_truth=False)
    rig.journal.close()
    folder = str(rig.journal.folder)
    assert main(["runs", "--journal", folder, "--export", kind, "--out", str(tmp_path / "out"), "--json"]) == GOOD
    told = json.loads(capsys.readouterr().out)
    assert [run["run"] for run in told["runs"]] == [number]
    assert len(told["files"]) == files == len(list((tmp_path / "out").iterdir()))
