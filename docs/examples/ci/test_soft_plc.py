"""A compiled program in Structured Text against a simulated cell: the line of docs/examples/line, built into build/plc."""

import subprocess
from pathlib import Path

import pytest

PROGRAM = Path("build/plc")


@pytest.mark.skipif(not PROGRAM.is_file(), reason="build/plc is not compiled: see line/build.sh")
def test_two_pegs_are_fed_and_inserted(cell):
    host, port = cell.address
    told = subprocess.run([PROGRAM, host, str(port), "2", "300"], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stdout
    assert [run.outcome for run in cell.runs] == ["success", "success"]
