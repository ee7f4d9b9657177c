"""The simulated arm: where it is, and how it is moved and taught by keys on standard input."""

import io
import json
import tomllib

import numpy as np
import pytest

from cell.calibrate.hand_motion import DEAD_MAN, GUIDE_SPEED, JOG_SPEED, moved_by_keys
from cell.commands.cli import GOOD, NOT_GOOD, WRONG_USE, main
from cell.config.load import load
from cell.devices.assembly import assemble, opened
from drivers import impedance
from drivers.frames import quaternion

ELSEWHERE = ["--set", "rack.first=[0.45, 0.2, 0.1]"]
"""A rack beside the plate wherever that is shown."""
IDEAL = ["--set", "reality.scale=0", "--set", "sim.pace=max"]


@pytest.fixture
def typed(monkeypatch, capsys):
    """Return a function that runs a command with text on standard input; it returns status, output and complaints."""

    def run(text, *arguments):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        status = main([*arguments, *IDEAL])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run


def where(typed):
    return json.loads(typed("", "where", "--json")[1])


def test_where_tells_joints_and_the_pose_that_belongs_to_them(typed):
    found, arm = where(typed), load().cell.arm_model()
    position, rotation, _, _ = impedance.forward(impedance.figures(arm), np.array(found["q"]))
    assert found["position"] == pytest.approx(position)
    assert found["quaternion"] == pytest.approx(quaternion(rotation))
    assert found["q"] == pytest.approx(arm.home, abs=0.01)
    _, told, _ = typed("", "where")
    assert "finger centre (m)" in told
    assert "end of a straight peg (m)" in told


def place_of(told):
    return [float(word) for word in told.rpartition("finger centre at ")[2].removesuffix(" m\n").split(", ")]


def test_ten_keys_jog_the_tool_by_ten_steps(typed):
    start = where(typed)["position"]
    status, told, _ = typed("x" * 10 + "q", "jog")
    assert status == GOOD
    # The tool comes after its setpoint, less what joint friction holds back.
    assert place_of(told)[0] - start[0] == pytest.approx(10 * JOG_SPEED * DEAD_MAN, rel=0.25)
    assert place_of(told)[1:] == pytest.approx(start[1:], abs=2e-3)


def test_keys_close_and_open_the_fingers():
    with opened(assemble(load(sets=["sim.pace=max", "reality.scale=0"]).cell), "arm", "gripper") as cell:
        widths = []

        def act(key, state):
            widths.append(cell.gripper.read().width)
            return True

        moved_by_keys(cell, Typed("kg" + 200 * "-" + "ko" + 200 * "-" + "kq"), act, is_guided=False)
    assert widths[1] < 0.001 < 0.039 < widths[2]


class Typed:
    """A person who types a key in each scan, or none for `-`."""

    def __init__(self, text):
        self._keys = iter(text)

    def next(self, is_waiting):
        return next(self._keys).replace("-", "")


class Push:
    """A person who pushes the hand along x from 1 to 3 s with a force, N, and lets it be until 5 s."""

    def __init__(self, cell, force):
        self.cell, self.force, self.began = cell, force, cell.clock.now()
        self.places = []

    def next(self, is_waiting):
        time = self.cell.clock.now() - self.began
        world = self.cell.arm._world
        model, data = world.physics()
        data.xfrc_applied[model.body("link7").id, 0] = self.force if 1.0 < time < 3.0 else 0.0
        self.places.append((time, *world.tcp().position))
        return "q" if time > 5.0 else ""

    def at(self, time):
        return next(np.array(place) for stamp, *place in self.places if stamp >= time)


@pytest.mark.parametrize(("force", "is_followed"), [(5.0, False), (15.0, True)])
def test_an_arm_with_honest_errors_follows_a_push_and_stays_where_it_is_left(force, is_followed):
    config = load(sets=["sim.pace=max", "sim.seed=7"]).cell
    with opened(assemble(config), "arm") as cell:
        push = Push(cell, force)
        moved_by_keys(cell, push, lambda key, state: True, is_guided=True)
    steps = np.linalg.norm(np.diff([place for _, *place in push.places], axis=0), axis=1)
    assert steps.max() * config.scan_rate < 1.5 * GUIDE_SPEED
    assert (push.at(3.0)[0] - push.at(1.0)[0] > 0.1) == is_followed
    assert np.linalg.norm(push.at(4.9) - push.at(4.0)) < 1e-3


def test_corners_shown_by_keys_are_written(typed, tmp_path):
    status, told, _ = typed("h" + 10 * "x" + 10 * "y" + "hw", "teach", "--out", str(tmp_path), "--json", *ELSEWHERE)
    assert status == GOOD
    (file,) = tmp_path.iterdir()
    found = tomllib.loads(file.read_text(encoding="utf-8"))["hole"]
    assert json.loads(told)["file"] == str(file)
    assert found["area"] == pytest.approx([0.04, 0.04], rel=0.25)


def test_without_a_key_to_write_nothing_is_written(typed, tmp_path):
    status, _, said = typed("hxxxxxhq", "teach", "--out", str(tmp_path))
    assert (status, said) == (NOT_GOOD, "cell: teach: nothing written\n")
    assert not list(tmp_path.iterdir())


def test_a_place_outside_the_workspace_is_one_line(typed, tmp_path):
    status, _, said = typed("1w", "teach", "--out", str(tmp_path), "--length", "0.6")
    assert status == NOT_GOOD
    assert said.startswith("cell: teach: 1: hand at z = -0.")
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_rack_shown_on_the_plate_is_one_line(typed, tmp_path):
    status, _, said = typed("h" + 10 * "x" + 10 * "y" + "hw", "teach", "--out", str(tmp_path))
    assert status == WRONG_USE
    assert "the rack overlaps the plate" in said
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())
