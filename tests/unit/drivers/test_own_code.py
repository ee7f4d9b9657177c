"""Programs that the cell starts run its own code, whatever lies in the folder that it was started in."""

import asyncio
import subprocess

import pytest

from cell.page.records import _run
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """Return a function that plants a module in the present folder, and the file that the module would write."""
    monkeypatch.chdir(tmp_path)
    written = tmp_path / "written"

    def plant(module):
        file = tmp_path.joinpath(*module.split(".")).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        for folder in file.relative_to(tmp_path).parents[:-1]:
            (tmp_path / folder / "__init__.py").touch()
        file.write_text(f"open({str(written)!r}, 'w').close()\n")
        return written

    return plant


def test_the_hand_s_loop_is_the_cell_s_own(planted, monkeypatch):
    """The driver starts its loop in some way; an interpreter that is started in the same way imports that loop, which reaches for no device."""
    written, commands = planted("drivers.gripper.loop"), []

    def start(command, **_):
        commands.append(command)
        raise OSError("not started")

    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", start)
        with pytest.raises(OSError, match="not started"):
            FrankaGripper(FrankaGripperConfig(kind="franka", host="127.0.0.1"), 0.08)._start()
    [command] = commands
    at = command.index("-m")
    assert command[at + 1] == "drivers.gripper.loop"
    subprocess.run([*command[:at], "-c", f"import {command[at + 1]}"], check=True)
    assert not written.exists()


def test_the_page_starts_this_program_and_no_other(planted):
    written = planted("cell.__main__")
    assert asyncio.run(_run(["--version"]))
    assert not written.exists()
