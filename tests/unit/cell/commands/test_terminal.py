"""Printed text fits a narrow terminal, is cut nowhere, and is never taken for markup."""

import json
import subprocess
from argparse import Namespace
from dataclasses import replace

import pytest
from rich.console import Group

from cell.commands import terminal
from cell.commands.cli import GOOD, main
from cell.records.journal import Journal
from cell.records.schema import RunRow, StageRow

EVIL = "PN7[a]-[/x]"
ROW = RunRow(0, "2025-01-31T06:00:00.123+00:00", "insert_peg", 0, EVIL, "page 192.168.100.200 b950", 42)
TIMES = json.dumps([("spray_search", 5.0), ("tactile_insert", 1.5), ("spiral_adjust", 3.0)])


@pytest.fixture
def records(tmp_path):
    success = {"outcome": "success", "stage": "release_and_retract", "stage_times": TIMES, "cycle_time": 21.25}
    message = "tactile_insert: 1.3 times the energy"
    fault = {"outcome": "fault", "stage": "tactile_insert", "fault": 2004, "message": message}
    with Journal(tmp_path) as journal:
        for ending in (success, fault):
            run = journal.writer.begin(ROW).run
            stage = StageRow(run, 1, "spray_search", 0.0, 9.0, counted=5.0)
            journal.writer.finish(replace(ROW, run=run, **ending), [stage])
    return str(tmp_path)


@pytest.fixture
def narrow(monkeypatch, capsys):
    """Print as on a terminal of 80 columns."""
    monkeypatch.setattr(terminal, "PIPE_WIDTH", 80)
    return lambda: capsys.readouterr().out


@pytest.mark.parametrize("command", ["runs", "report", "compare 1 2", "faults", "config show"])
def test_tables_fit_80_columns_and_are_cut_nowhere(command, records, narrow):
    main([*command.split(), *(["--journal", records] if command[0] in "rc" and command != "config show" else [])])
    shown = narrow()
    assert "…" not in shown
    if command != "config show":
        assert max(len(line) for line in shown.splitlines()) <= 80


def test_runs_show_both_times_under_their_names(records, narrow):
    main(["runs", "--journal", records])
    shown = narrow()
    assert "9.5" in shown
    assert "21.2" in shown
    assert "cycle: from command to answer" in " ".join(shown.split())


def test_a_shell_completes_commands_studies_and_options(tmp_path, capsys):
    assert main(["completion", "bash"]) == GOOD
    script = tmp_path / "cell.bash"
    script.write_text(capsys.readouterr().out)
    asked = f"source {script}; COMP_WORDS=(cell {{}}); COMP_CWORD={{}}; _shtab_cell; echo ${{{{COMPREPLY[@]}}}}"
    for words, place, expected in (
        ("rep", 1, "report"),
        ("study fron", 2, "frontier"),
        ("runs --outc", 2, "--outcome"),
    ):
        found = subprocess.run(["bash", "-c", asked.format(words, place)], capture_output=True, text=True, check=True)
        assert expected in found.stdout.split()


def test_lines_for_a_file_are_never_folded(narrow):
    line = f'arm = "{"x" * 100}"'
    terminal.show(Namespace(json=False), Group("for the cell's file:", line), {})
    assert line in narrow().splitlines()
