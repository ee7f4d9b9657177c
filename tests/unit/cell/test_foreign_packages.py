"""The installed program runs beside foreign packages, and reports one that hides its own."""

import os
import shutil
import subprocess
import sys
import tomllib

import pytest

from tests.pages import PACKAGES, ROOT

SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder as an installed wheel leaves it, by the mapping of packages that the wheel is built with."""
    folder = tmp_path_factory.mktemp("site")
    for name in PACKAGES:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name, source in SETUPTOOLS["package-dir"].items():
        shutil.copytree(ROOT / source, folder.joinpath(*name.split(".")))
    return folder


def cell(site, foreign, *words):
    """Run a command with a folder of foreign packages in front."""
    places = os.pathsep.join(map(str, (foreign, site)))
    line = [sys.executable, "-c", "import sys; from cell.__main__ import main; sys.exit(main())", *words]
    return subprocess.run(
        line, cwd=foreign, env={**os.environ, "PYTHONPATH": places}, capture_output=True, text=True, check=False
    )


def test_every_package_except_the_study_of_faults_is_installed():
    names = SETUPTOOLS["packages"]
    folders = [each.parent.relative_to(ROOT) for name in PACKAGES for each in (ROOT / name).rglob("__init__.py")]
    assert {*names, "cell.lab.faults"} == {".".join(folder.parts) for folder in folders} | {"cell.shipped"}
    assert "cell.lab.faults" not in names


def test_an_installed_program_has_every_study_but_that_of_faults(site, tmp_path):
    whole = cell(site, tmp_path, "study", "--help").stdout
    shutil.move(site / "cell" / "lab" / "faults", tmp_path / "faults")
    assert "faults" in whole
    assert "faults" not in cell(site, tmp_path, "study", "--help").stdout
    assert cell(site, tmp_path, "study", "faults").returncode == 2
    shutil.move(tmp_path / "faults", site / "cell" / "lab" / "faults")


def test_a_foreign_config_changes_nothing(site, tmp_path):
    (tmp_path / "config.py").write_text("raise RuntimeError('foreign')\n")
    shown = cell(site, tmp_path, "config", "explain", "search.speed")
    assert (shown.returncode, shown.stderr) == (0, "")
    assert "search.speed" in shown.stdout


def test_a_foreign_package_in_front_is_named_in_one_line(site, tmp_path):
    (tmp_path / "skills").mkdir()
    (tmp_path / "skills" / "__init__.py").touch()
    refused = cell(site, tmp_path, "map")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert f"package skills: found in {tmp_path / 'skills'}" in refused.stderr
