"""The example of docs/examples/ci and the page on it, run as a customer runs them: in a folder of their own."""

import os
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points

from tests.pages import ROOT, blocks

PLUGIN = "cell.testing.plugin"
EXAMPLE = ROOT / "docs" / "examples" / "ci"
PAGE = {block.info.partition(" ")[2]: block.text for block in blocks() if block.page.name == "ci.md"}
FAULTS = """
import pytest
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Result
from skills.catalogue import CATALOGUE

@pytest.fixture
def cell_options(request):
    return request.param

def insert(cell):
    peer = Peer(*cell.address)
    try:
        peer.connect()
        report = peer.run(CATALOGUE["insert_peg"].code, timeout=300.0)
    finally:
        peer.close()
    return Result(report.result).name, CATALOGUE.reasons[report.reason], report.fault

QUICK = ["--set", "hole.area=[0.02,0.02]"]

@pytest.mark.parametrize("cell_options", [QUICK], indirect=True)
def test_faults(cell):
    cell.freeze_arm()
    assert insert(cell)[2] == 1004

@pytest.mark.parametrize("cell_options", [[*QUICK, "--set", "adjust.timeout=1", "--set", "insert.timeout=2"]], indirect=True)
def test_switch(cell):
    cell.jam_switch()
    result, reason, fault = insert(cell)
    assert (result, reason) == ("FAILURE", "NOT_SEATED") or fault == 3001
"""

REAL = PAGE["options"].replace("cell.toml", str(ROOT / "config" / "cell_01.toml"))


def test_the_example_passes_and_a_real_cell_is_refused(tmp_path):
    """With the plugin as it is installed or, in a checkout that was installed before it existed, by name."""
    is_installed = PLUGIN in [each.value for each in entry_points(group="pytest11")]
    plugin = [] if is_installed else ["-p", PLUGIN]
    project = shutil.copytree(EXAMPLE, tmp_path / "line")
    (project / "test_page.py").write_text(PAGE["project"], encoding="utf-8")
    (project / "test_faults.py").write_text(FAULTS, encoding="utf-8")
    (project / "real").mkdir()
    (project / "real" / "conftest.py").write_text(REAL, encoding="utf-8")
    (project / "real" / "test_real.py").write_text("def test_real(cell): ...\n", encoding="utf-8")
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *plugin],
        cwd=project,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "7 passed, 1 skipped, 1 error" in told.stdout, told.stdout + told.stderr
    assert "that of a simulated one allowed" in told.stdout


def test_the_jobs_of_the_page_are_those_of_the_example():
    for name in ("github.yml", "gitlab-ci.yml"):
        assert PAGE[name] == (EXAMPLE / name).read_text(encoding="utf-8")


def test_the_plugin_imports_nothing_slow():
    code = f"import sys, {PLUGIN}; print([m for m in ('numpy', 'pydantic', 'pymodbus', 'sim', 'skills') if m in sys.modules])"
    told = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_the_package_registers_the_plugin():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"cell": PLUGIN}
