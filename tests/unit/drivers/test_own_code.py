"""Programs that the cell starts run its own code, whatever lies in the folder that it was started in."""

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

import drivers
from cell.page.records import _run
from drivers.arm.franka import FrankaArm
from drivers.gripper.franka import FrankaGripper
from tests.fakes import FakeClock
from tests.unit.drivers.arm.test_franka import ARM, FR3, GRIPPER


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


@pytest.mark.parametrize(
    ("module", "device"),
    [
        ("drivers.arm.loop", FrankaArm(ARM, FR3, FakeClock())),
        ("drivers.gripper.loop", FrankaGripper(GRIPPER, FR3.hand.stroke)),
    ],
)
def test_the_loop_of_a_device_is_the_cell_s_own(planted, monkeypatch, module, device):
    """An interpreter started as the driver starts its loop finds the loop in this program."""
    planted(module)
    monkeypatch.setattr(sys.modules[type(device).__module__], "find_spec", lambda name: True)
    commands = []

    def start(command, **_):
        commands.append(command)
        raise OSError("not started")

    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", start)
        with pytest.raises(OSError, match="not started"):
            device.open()
    [command] = commands
    at = command.index("-m")
    assert command[at + 1] == module
    find = f"from importlib.util import find_spec; print(find_spec({module!r}).origin)"
    found = subprocess.run([*command[:at], "-c", find], check=True, capture_output=True, text=True).stdout
    assert Path(found.strip()) == Path(drivers.__file__).parent.joinpath(*module.split(".")[1:]).with_suffix(".py")


def test_the_page_starts_this_program_and_no_other(planted):
    written = planted("cell.__main__")
    assert asyncio.run(_run(["--version"]))
    assert not written.exists()
