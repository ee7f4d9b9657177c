"""Every command and every study has the same parts, and the error on an unknown name suggests the nearest one."""

import json
import os
import resource
import time
import tomllib
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from cell.commands import view
from cell.commands.cli import COMMANDS, FAULT, GOOD, WRONG_USE, load_command, main
from cell.lab.commands.study import STUDIES
from cell.records.journal import Journal
from cell.records.provenance import PINS, licence, packages, versions
from cell.records.schema import EventKind, EventRow, RunRow
from drivers import compiled
from drivers.errors import FaultCode

ROOT = Path(__file__).parents[4]


PARTS = {
    **{name: (summary, load_command, name) for name, summary in COMMANDS.items()},
    **{f"study {name}": (study.SUMMARY, import_module, study.module) for name, study in STUDIES.items()},
}
"""Summary of each command and study, and how its module is loaded."""


@pytest.mark.parametrize("name", PARTS)
def test_every_command_and_study_has_its_help(name, capsys):
    summary, loaded, module = PARTS[name]
    with pytest.raises(SystemExit, match="0"):
        main([*name.split(), "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert summary in told
    assert f"cell {name}" in told
    assert callable(loaded(module).run)


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["fualts"], "faults"),
        (["study", "tactil"], "tactile"),
        (["run", "insert_pegg"], "insert_peg"),
        (["map", "--format", "jsn"], "json"),
        (["faults", "skin_slient"], "SKIN_SILENT"),
        (["trials", "--trails", "3"], "--trials"),
        (["study", "faults", "--knid", "disk"], "--kind"),
        (["runs", "--program", "insert_pg"], "insert_peg"),
        (["report", "--program", "insert_pg"], "insert_peg"),
    ],
)
def test_a_mistyped_word_is_answered_with_the_nearest(words, meant, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert main(words) == WRONG_USE
    assert capsys.readouterr().err.rstrip().endswith(f"; did you mean {meant}?")


@pytest.mark.parametrize("word", ["1002", FaultCode(1002).name, FaultCode(1002).name.lower()])
def test_one_fault_is_found_by_number_or_name(word, capsys):
    assert main(["faults", word, "--json"]) == GOOD
    assert [entry["code"] for entry in json.loads(capsys.readouterr().out)] == [1002]


SERIAL = "PN7[a]-[/x] :warning: [red]"
"""As a PLC may send it: a number that looks like the terminal's own markup."""
RUN = RunRow(0, "2026-01-01T20:00:00+00:00", "insert_peg", 0, SERIAL, "plc[/]", 1)


def test_a_serial_number_like_markup_is_printed_unchanged(tmp_path, capsys):
    with Journal(tmp_path) as journal:
        journal.writer.begin(RUN)
        journal.writer.begin(replace(RUN, serial="", source="10.0.0.1"))
    assert main(["runs", "--journal", str(tmp_path)]) == GOOD
    printed = capsys.readouterr().out
    assert all(word in printed for word in SERIAL.split())
    (line,) = [line for line in printed.splitlines() if line.startswith(" 2 ")]
    assert "running" in line
    assert len(line.rstrip()) <= 80
    assert main(["show", "1", "--journal", str(tmp_path)]) != WRONG_USE
    printed = capsys.readouterr().out
    assert SERIAL in printed
    assert "plc[/]" in printed


@pytest.mark.parametrize(
    "words",
    ["runs", "alarms", "show 2", "report", "compare 1 2", "compare --since 1900-01-01 --with 1800-01-01"],
)
def test_times_are_local_with_their_zone(words, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("TZ", "Asia/Kolkata")
    time.tzset()
    with Journal(tmp_path) as journal:
        for _ in range(2):
            begun = journal.writer.begin(RUN)
            journal.writer.note(
                EventRow(0, "2026-01-01T20:00:01+00:00", 0.0, EventKind.FAULT, "SKIN_SILENT", 1001, run=begun.run)
            )
            journal.writer.finish(replace(begun, outcome="fault", fault=1001))
    assert main([*words.split(), "--journal", str(tmp_path)]) != WRONG_USE
    monkeypatch.undo()
    time.tzset()
    printed = capsys.readouterr().out
    assert "2026-01-02 01:30" in printed or "01-01 22:00" in printed, printed
    assert "IST" in printed or "+0530" in printed, printed
    assert "+00:00" not in printed


def test_the_version_is_printed_with_those_of_the_packages(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    told = capsys.readouterr().out
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert told.startswith(f"cell {project['version']}, Python ")
    assert "numpy" in told
    assert "differs" not in told
    assert max(map(len, told.splitlines())) <= 80


def test_every_package_of_the_program_states_its_licence():
    licences = {line.name: line.licence for line in packages()}
    assert "not stated" not in licences.values()
    assert licences["python-can"] == "LGPL-3.0-only"  # an expression
    assert licences["rich"] == "MIT License"  # a classifier
    assert licences["shtab"] == "MPL-2.0"  # a text alone
    assert licence("nobody-wrote-this") == "not installed"


def test_the_fingerprint_of_the_program_covers_the_arm_files(tmp_path, monkeypatch):
    before = versions.__wrapped__()["code"]
    monkeypatch.setattr("cell.records.provenance.ARMS", tmp_path)
    assert versions.__wrapped__()["code"] != before


def test_every_package_of_the_program_is_pinned():
    assert PINS.read_text() == (ROOT / "constraints.txt").read_text()
    assert [line.name for line in packages() if line.tested == "not pinned"] == []


WRONG = {
    "FILE": "demo --out, demo --journal, serve --journal, run home --journal, trials --trials 1 --out, show 1 --export, "
    "tune --want fast --out, runs --export csv --out, calibrate skin --out, study tactile --out",
    "FILE/deeper": "demo --out",
    "FOLDER": "check --plc 3 --out, film 1 --out, report --out, skin --record",
    "/proc/none/x": "trials --trials 1 --out, check --plc 3 --out",
    "unheard of": "study faults --kind, study margins --method, study margins --error, study frontier --scene, "
    "study modelling --only",
    "csv": "runs --export",
    "Gehäuse 7": "run cleared --serial",
    "nan": "skin --seconds",
    "50": "teach --length",
}
"""Wrong values, and the options that get them."""


@pytest.mark.parametrize(("words", "value"), [(words, value) for value in WRONG for words in WRONG[value].split(", ")])
def test_wrong_use_is_refused_in_one_line_before_anything_is_compiled(words, value, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compiled, "folder", lambda: tmp_path / "nothing compiled")
    Path("FILE").touch()
    Path("FOLDER").mkdir()
    assert main([*words.split(), value]) == WRONG_USE
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_folder_that_cannot_be_written_is_refused_before_the_measurement(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    for words in (["calibrate", "skin"], ["teach"]):
        assert main([*words, "--out", str(tmp_path / "new")]) == WRONG_USE
        assert capsys.readouterr().err == f"cell: {tmp_path}/new: cannot be written: no permission in {tmp_path}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("refused", "status", "told"),
    [
        (PermissionError(13, "Permission denied", "run-000001.png"), WRONG_USE, "run-000001.png: Permission denied"),
        (
            PermissionError(1, "Not permitted"),
            FAULT,
            "fault 4003: PermissionError: [Errno 1] Not permitted; -v shows more",
        ),
    ],
)
def test_a_refused_permission_is_wrong_use_only_if_it_names_a_file(refused, status, told, monkeypatch, capsys):
    monkeypatch.setattr(view, "run", lambda _: (each for each in ()).throw(refused))
    assert main(["view"]) == status
    assert capsys.readouterr().err == f"cell: {told}\n"


@pytest.mark.parametrize("words", ["runs", "alarms", "show 1", "report", "compare 1 2", "film 1 --out a.png", "view"])
def test_a_named_folder_without_records_is_refused_in_one_line(words, tmp_path, capsys):
    for folder in (tmp_path, tmp_path / "missing"):
        assert main([*words.split(), "--journal", str(folder)]) == WRONG_USE
        told = capsys.readouterr()
        assert (told.out, told.err.count("\n")) == ("", 1)
        assert f"--journal {folder}: no runs.sqlite there" in told.err


def test_a_full_disk_keeps_the_commented_config(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(text := "scan_rate = 100.0\n")
    size, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8, most))
    status = main(["config", "comment", str(file)])
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))
    assert (status, file.read_text()) == (WRONG_USE, text)
