"""Commands that only show something start fast, and import only what they use."""

import subprocess
import sys

import pytest

from tests.bench.speed.starts import SHOWING, heavy_imports, processor_time

GENEROUS = 2.0
"""Twice and more of what is wanted, s: a slow computer is no defect, and the program's own measure prints the figures."""


@pytest.mark.parametrize("name", SHOWING)
def test_a_command_that_only_shows_something_imports_nothing_heavy(name, tmp_path):
    arguments = (*SHOWING[name], *(("--journal", str(tmp_path)) if name == "runs" else ()))
    assert heavy_imports(arguments) == []
    assert processor_time(("-m", "cell", *arguments)) < GENEROUS


def test_the_list_of_imports_would_show_a_heavy_one():
    assert "canopen" in heavy_imports(("map", "--format", "eds"))


@pytest.mark.parametrize(
    "module", ["cell.run.supervisor", "cell.commands.run", "cell.commands.serve", "cell.devices.assembly"]
)
def test_the_product_does_not_bring_the_laboratory_along(module):
    code = f"import sys, {module}; print([name for name in sys.modules if name.startswith('cell.lab')])"
    told = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert told.stdout.strip() == "[]"
