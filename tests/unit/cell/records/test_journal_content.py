"""No row and no byte of a journal's folder prevents a start or loses another record."""

import json
import math
import os
import random
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from cell.records.index import SET_ASIDE
from cell.records.journal import INDEX, Journal
from cell.records.schema import LOST, EventKind, EventRow, StageRow
from drivers.errors import JournalError
from tests.inputs import KEPT, inputs
from tests.unit.cell.page.test_outside import changed
from tests.unit.cell.records.test_journal_writer import ROW, recorded

EVENT = EventRow(0, "2025", 0.0, EventKind.FAULT, "SKIN_SILENT")
POISON = {
    "stamp that is no number": replace(EVENT, stamp=math.nan),
    "text with half a character": replace(EVENT, text="\ud800"),
    "number too long": replace(EVENT, code=2**70),
    "no text at all": replace(EVENT, name=None),
    "another kind of thing": replace(EVENT, source=object()),
}


def aside(folder: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in (folder / SET_ASIDE).read_text().splitlines()]


@pytest.mark.parametrize("poison", POISON.values(), ids=POISON)
def test_a_row_that_cannot_be_written_holds_up_no_other(tmp_path, caplog, poison):
    with Journal(tmp_path) as journal:
        row = journal.writer.begin(ROW)
        journal.writer.note(poison)
        journal.writer.note(EVENT)
        journal.writer.finish(replace(row, outcome="success"))
        assert [event.name for event in journal.events()] == ["SKIN_SILENT"]
        assert (journal.find(row.run).outcome, journal.trouble) == ("success", "")
    (found,) = aside(tmp_path)
    assert (found["table"], found["row"]["kind"]) == ("events", "fault")
    assert caplog.text.count("set aside") == 1


def test_a_stage_that_cannot_be_written_leaves_its_run_on_record(tmp_path):
    stages = [StageRow(1, 1, "grasp_from_rack", math.nan, 1.0), StageRow(1, 2, "spray_search", 1.0, 2.0)]
    with Journal(tmp_path) as journal:
        row = journal.writer.begin(ROW)
        journal.writer.finish(replace(row, outcome="failure"), stages)
        assert [stage.name for stage in journal.stages(1)] == ["spray_search"]
        assert journal.find(1).outcome == "failure"
    with Journal(tmp_path) as journal:
        assert journal.find(1).outcome == "failure"


def test_a_run_that_cannot_be_written_is_recorded_as_lost(tmp_path):
    for _ in range(2):
        with Journal(tmp_path) as journal:
            row = journal.writer.begin(ROW)
            journal.writer.finish(replace(row, outcome="failure", retries=None))
            assert journal.find(row.run).outcome == LOST
            assert SET_ASIDE in journal.find(row.run).message
    with Journal(tmp_path) as journal:
        assert [row.outcome for row in journal.runs(5)] == [LOST, LOST]
    assert len(aside(tmp_path)) == 2


def test_invalid_text_in_the_index_is_shown_with_replacements(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
    with closing(sqlite3.connect(tmp_path / INDEX)) as index, index:
        index.execute("UPDATE runs SET serial = CAST(x'41ff42' AS TEXT)")
    with Journal(tmp_path, is_read_only=True) as journal:
        assert journal.find(1).serial == "A\ufffdB"


def test_a_run_with_a_damaged_byte_is_recorded_as_lost(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
    for file in tmp_path.glob(f"{INDEX}*"):
        file.unlink()
    samples = tmp_path / "run-000001.arrows"
    whole = samples.read_bytes()
    assert whole.count(b'"insert_peg"') == 2
    samples.write_bytes(whole.replace(b'"insert_peg"', b'"insert\xffpeg"'))
    with Journal(tmp_path) as journal:
        assert (journal.find(1).outcome, journal.writer.begin(ROW).run) == (LOST, 2)


def test_an_error_of_the_start_reaches_the_caller(tmp_path, monkeypatch):
    monkeypatch.setattr("cell.records.writer.warn_of_clock", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        Journal(tmp_path).open()


def test_a_second_process_is_refused_with_the_first_and_its_start(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        for first in (rf"process {os.getpid()} writes these records since 20\d\d-.*reading", "another process writes"):
            with pytest.raises(JournalError, match=first):
                Journal(tmp_path).open()
            (tmp_path / "writer.lock").unlink(missing_ok=True)
        with Journal(tmp_path, is_read_only=True) as reader:
            assert reader.find(1).outcome == "success"
        assert recorded(journal, seen).run == 2


START = """
import sys, json
from pathlib import Path
from cell.calibrate import proven
from cell.page.token import page_token
from cell.peg.custody import Custody
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.run.learning import read_learned
from drivers.errors import CellError
for folder in Path(sys.argv[1]).iterdir():
    try:
        with Journal(folder) as journal:
            run = journal.writer.begin(RunRow(0, "2025-01-01", "insert_peg", 1, "A-17", "plc", 42))
            assert journal.find(run.run).outcome == "running", journal.trouble
            assert journal.trouble == "", journal.trouble
            journal.writer.finish(run)
        Custody(folder, "sim")
        proven.read(folder / proven.FILE)
        read_learned(folder)
        page_token(folder)
        print(folder.name, "started", flush=True)
    except CellError as error:
        assert len(str(error).splitlines()) == 1
        print(folder.name, "refused", flush=True)
"""
FOLDERS = inputs(200)


def damage(folder: Path, rng: random.Random) -> None:
    """Damage a journal's folder as crashes, disks and people do."""
    for path in rng.sample(sorted(folder.iterdir()), rng.randrange(1, 4)):
        data = path.read_bytes()
        path.unlink()
        if rng.random() < 0.05:
            path.mkdir()
        elif rng.random() < 0.9:
            path.write_bytes(changed(data, rng))
            path.chmod(0o600)
    if rng.random() < 0.05:
        (folder / f"run-{rng.randrange(10**12):06d}.arrows").write_bytes(rng.randbytes(100))
    if rng.random() < 0.05:
        (folder / "run-000009.arrows").mkdir()


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[Path]:
    """Yield a folder in memory: on a disk, a start mostly waits for it."""
    with TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else tmp_path) as folder:
        yield Path(folder)


def test_a_damaged_folder_starts_or_is_refused_in_one_line(memory, seen):
    whole, killed, damaged_ones, rng = memory / "whole", memory / "killed", memory / "damaged", random.Random(1)
    with Journal(whole) as journal:
        for number in range(3):
            recorded(journal, seen, scans=5, config_hash=f"{number}")
        row = journal.writer.begin(ROW)
        assert journal.find(row.run)
        for name, text in KEPT.items():
            (whole / name).write_bytes(text)
            (whole / name).chmod(0o600)
        shutil.copytree(whole, killed)
    for number in range(FOLDERS):
        source = rng.choice([whole, killed])
        shutil.copytree(source, damaged_ones / str(number))
        if rng.random() < 0.3:
            for file in (damaged_ones / str(number)).glob(f"{INDEX}*"):
                file.unlink()
        damage(damaged_ones / str(number), rng)
    answer = subprocess.run(
        [sys.executable, "-c", START, str(damaged_ones)],
        capture_output=True,
        text=True,
        timeout=3.0 * FOLDERS,
        check=False,
    )
    assert answer.returncode == 0, answer.stdout[-200:] + answer.stderr[-3000:]
    assert "Traceback" not in answer.stderr
    assert len(answer.stdout.splitlines()) == FOLDERS
