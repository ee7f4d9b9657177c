"""The commands of the documents succeed as printed."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cell.config.load import load
from cell.lab.faults.program import LOADED
from cell.run.record import scene_facts
from drivers.errors import ConfigError
from sim.visual.render import Camera
from sim.visual.scene import Stage
from tests.line.forked import forked
from tests.pages import RENDERING, ROOT, blocks

PAGES_WITH_COMMANDS = sorted({block.page for block in blocks() if block.info in ("console", f"console {RENDERING}")})


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Yield this tree's `cell`."""
    with forked(tmp_path_factory.mktemp("bin"), ROOT, LOADED) as command:
        yield command


def run(commands: str, folder: Path, cell: Path) -> None:
    """Run the lines of a block in a shell; every line has to succeed."""
    path = os.pathsep.join([str(cell.parent), str(Path(sys.executable).parent), os.environ["PATH"]])
    told = subprocess.run(
        ["sh", "-e"],
        input=commands,
        cwd=folder,
        env={**os.environ, "PATH": path, "XDG_DATA_HOME": str(folder / "data")},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert told.returncode == 0, f"{commands}\n{told.stdout}\n{told.stderr}"


def can_render() -> bool:
    try:
        with Camera(Stage(scene_facts(load().cell), None)):
            return True
    except ConfigError:
        return False


@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS, ids=lambda page: page.name)
def test_the_commands_of_a_page_succeed_one_after_the_other(page, tmp_path, cell):
    kinds = ["console", *([f"console {RENDERING}"] if can_render() else [])]
    for block in blocks():
        if block.page == page and block.info in kinds:
            run(block.text, tmp_path, cell)
