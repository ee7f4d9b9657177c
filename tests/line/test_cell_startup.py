"""Commands that only show something import only what they use; `tests/bench/test_speed.py` measures starts."""

import subprocess
import sys

import pytest

from tests.bench.speed.starts import SHOWING, heavy_imports


@pytest.mark.parametrize("name", SHOWING)
def test_a_command_that_only_shows_something_imports_nothing_heavy(name, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert heavy_imports(SHOWING[name]) == []


def test_the_list_of_imports_would_show_a_heavy_one():
    assert "canopen" in heavy_imports(("map", "--format", "eds"))


def test_the_product_does_not_bring_the_laboratory_along():
    modules = "cell.run.supervisor, cell.commands.run, cell.commands.serve, cell.devices.assembly"
    code = f"import sys, {modules}; print([name for name in sys.modules if name.startswith('cell.lab')])"
    told = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert told.stdout.strip() == "[]"
