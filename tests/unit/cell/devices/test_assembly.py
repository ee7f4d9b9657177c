"""A cell of hardware: what its config makes of it, without any hardware."""

import json
import subprocess
import sys

import pytest

from cell.commands.cli import FAULT, GOOD, main
from cell.config.files import SHIPPED
from cell.config.load import load
from cell.devices.assembly import assemble, check
from drivers.arm.franka import FrankaArm
from drivers.clock import WallClock
from drivers.errors import ConfigError
from drivers.gripper.franka import FrankaGripper
from drivers.skin.boards import CanSkin, SerialSkin
from drivers.switch.board import SerialSuccessSwitch

ARM = "arm={kind='franka', host='127.0.0.1', collision_torque=40.0, collision_force=40.0}"
GRIPPER = "gripper={kind='franka', host='127.0.0.1'}"
SWITCH = "switch={kind='serial', port='/dev/no-such-switch'}"
LINE, BUS = "skin={kind='serial', port='/dev/no-such-skin'}", "skin={kind='can', channel='no-such-bus'}"


@pytest.mark.parametrize(("skin", "kind"), [(LINE, SerialSkin), (BUS, CanSkin)])
def test_a_real_arm_comes_with_real_devices_and_wall_time(skin, kind):
    cell = assemble(load(sets=[ARM, GRIPPER, SWITCH, skin]).cell)
    kinds = [type(device) for _, device in cell.devices()]
    assert (kinds, type(cell.clock)) == ([FrankaArm, FrankaGripper, kind, SerialSuccessSwitch], WallClock)
    assert not cell.cables


@pytest.mark.parametrize(
    ("sets", "cables"),
    [
        ([], ["skin", "switch"]),
        (["skin={kind='can'}"], ["skin", "switch"]),
        ([BUS], ["switch"]),
        (
            ["switch={kind='none'}", "hole.evidence='force'", "hole.latch={kind='detent', force=5.0, height=0.003}"],
            ["skin"],
        ),
    ],
)
def test_only_cables_of_simulated_devices_can_be_pulled(sets, cables):
    assert list(assemble(load(sets=sets).cell).cables) == cables


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        ([ARM], "needs a simulated arm"),
        ([ARM, GRIPPER, SWITCH], "skin.kind"),
        ([GRIPPER], "gripper.kind"),
        ([ARM, GRIPPER, LINE, "switch={kind='serial', port='emulated'}"], "switch.port"),
        ([ARM.replace("40.0", "400.0")], "collision_torque = 400.0"),
    ],
)
def test_devices_that_do_not_go_together_are_refused_in_one_line(sets, told):
    with pytest.raises(ConfigError, match=rf"\A[^\n]*{told}[^\n]*\Z"):
        load(sets=sets)


def test_check_names_every_device_that_is_not_there():
    config = load(sets=[ARM.replace("127.0.0.1", "127.254.254.254"), GRIPPER, SWITCH, LINE]).cell
    found = dict(check(assemble(config)))
    assert set(found) == {"arm", "gripper", "skin", "switch", "clock"}
    assert "no such port" in found["switch"]
    assert all("fault" in found[name] for name in ("arm", "gripper", "skin", "switch"))


WITHOUT_STAND_INS = """
import importlib.abc, sys

class Wall(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == "mujoco" or name.startswith("sim.") and name != "sim.config":
            raise ImportError(f"{name}: not for a physical cell")

sys.meta_path.insert(0, Wall())
from cell.commands.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize("command", [["check", "--json"], ["skin"]])
def test_a_physical_cell_imports_neither_physics_nor_stand_ins(command):
    hosts = ("skin.channel=can-none", "arm.host=127.254.254.254", "gripper.host=127.254.254.254")
    sets = [word for text in hosts for word in ("--set", text)]
    whole = [sys.executable, "-c", WITHOUT_STAND_INS, *command, "--config", str(SHIPPED / "cell_01.toml"), *sets]
    done = subprocess.run(whole, capture_output=True, text=True)
    assert done.returncode == FAULT
    assert "CAN bus socketcan can-none" in done.stdout + done.stderr
    assert "not for a physical cell" not in done.stdout + done.stderr


def test_the_wall_before_the_stand_ins_stops_a_simulated_cell():
    done = subprocess.run([sys.executable, "-c", WITHOUT_STAND_INS, "check", "--json"], capture_output=True, text=True)
    assert "not for a physical cell" in done.stderr


@pytest.mark.parametrize(
    ("simulated", "simulated_kinds"),
    [
        (("arm", "gripper"), ["SimArm", "SimGripper", "CanSkin", "SerialSuccessSwitch"]),
        (("arm", "gripper", "switch"), ["SimArm", "SimGripper", "CanSkin", "SimSwitch"]),
        (("arm", "gripper", "skin"), ["SimArm", "SimGripper", "SimSkin", "SerialSuccessSwitch"]),
    ],
)
def test_named_devices_are_simulated_and_the_others_stay(simulated, simulated_kinds):
    cell = load(SHIPPED / "cell_01.toml", simulate=simulated).cell
    assert cell.arm.model == "fr3"
    assert [type(device).__name__ for _, device in assemble(cell).devices()] == simulated_kinds


def test_a_calibration_does_not_go_over_to_a_simulated_device(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(f'{(SHIPPED / "cell_01.toml").read_text()}\n[calibration]\narm = "arm.toml"\nskin = "skin.toml"\n')
    for name in ("arm.toml", "skin.toml"):
        (tmp_path / name).touch()
    calibration = load(file, simulate=("arm", "gripper")).cell.calibration
    assert (calibration.arm, calibration.skin) == (None, tmp_path / "skin.toml")


@pytest.mark.parametrize("only", ["arm", "skin", "gripper,switch"])
def test_chosen_devices_are_checked_alone(only, capsys):
    assert main(["check", "--json", "--only", only]) == GOOD
    assert [each["device"] for each in json.loads(capsys.readouterr().out)] == only.split(",")
