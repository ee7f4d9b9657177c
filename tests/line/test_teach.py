"""The simulated arm: its place, and motion and teaching by keys on standard input."""

import io
import json
import tomllib
from types import SimpleNamespace

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
SQUARE = "h" + 10 * "x" + 10 * "y" + "hw"
"""Keys that show two corners of a hole's area and write them."""


@pytest.fixture
def typed(monkeypatch, capsys):
    """Return a function that runs a command with text on standard input; it returns status, output and complaints."""

    def run(text, *arguments):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        status = main([*arguments, *IDEAL])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def where(typed):
    return json.loads(typed("", "where", "--json")[1])


def test_where_prints_joints_and_the_pose_that_belongs_to_them(typed):
    found, arm = where(typed), load().cell.arm_model()
    position, rotation, _, _ = impedance.forward(impedance.figures(arm), np.array(found["q"]))
    assert found["position"] == pytest.approx(position)
    assert found["quaternion"] == pytest.approx(quaternion(rotation))
    assert found["q"] == pytest.approx(arm.home, abs=0.01)
    printed = typed("", "where")[1]
    assert all(place in printed for place in ("finger centre (m)", "end of a straight peg (m)"))


def test_ten_keys_jog_the_tool_by_ten_steps(typed):
    start = where(typed)["position"]
    status, printed, _ = typed("x" * 10 + "q", "jog")
    assert status == GOOD
    place = printed.rpartition("finger centre at ")[2].removesuffix(" m\n").split(", ")
    way = np.subtract([float(word) for word in place], start)
    # The tool follows its setpoint, less what joint friction holds back.
    assert way[0] == pytest.approx(10 * JOG_SPEED * DEAD_MAN, rel=0.25)
    assert way[1:] == pytest.approx([0.0, 0.0], abs=2e-3)


def test_keys_close_and_open_the_fingers():
    with opened(assemble(load(sets=["sim.pace=max", "reality.scale=0"]).cell), "arm", "gripper") as cell:
        widths = []

        def act(key, state):
            widths.append(cell.gripper.read().width)
            return True

        typed = iter("kg" + 200 * "-" + "ko" + 200 * "-" + "kq")  # one key in each scan, `-` for none
        keys = SimpleNamespace(next=lambda is_waiting: next(typed).replace("-", ""))
        moved_by_keys(cell, keys, act, is_guided=False)
    assert widths[1] < 0.001 < 0.039 < widths[2]


class Push:
    """A person who pushes the hand along x from 1 to 3 s with a force, N, and not from then to 5 s."""

    def __init__(self, cell, force):
        self.world, self.force, self.began = cell.arm._world, force, cell.clock.now()
        self.places = []

    def next(self, is_waiting):
        time = self.world.now() - self.began
        model, data = self.world.physics()
        data.xfrc_applied[model.body("link7").id, 0] = self.force if 1.0 < time < 3.0 else 0.0
        self.places.append((time, *self.world.tcp().position))
        return "q" if time > 5.0 else ""

    def at(self, time):
        return next(np.array(place) for stamp, *place in self.places if stamp >= time)


@pytest.mark.parametrize(("force", "is_followed"), [(5.0, False), (15.0, True)])
def test_an_arm_follows_a_push_and_stays_where_it_is_left(force, is_followed):
    config = load(sets=["sim.pace=max", "sim.seed=7"]).cell
    with opened(assemble(config), "arm") as cell:
        push = Push(cell, force)
        moved_by_keys(cell, push, lambda key, state: True, is_guided=True)
    steps = np.linalg.norm(np.diff([place for _, *place in push.places], axis=0), axis=1)
    assert steps.max() * config.scan_rate < 1.5 * GUIDE_SPEED
    assert (push.at(3.0)[0] - push.at(1.0)[0] > 0.1) == is_followed
    assert np.linalg.norm(push.at(4.9) - push.at(4.0)) < 1e-3


def test_corners_shown_by_keys_are_written(typed, tmp_path):
    status, printed, _ = typed(SQUARE, "teach", "--out", str(tmp_path), "--json", *ELSEWHERE)
    assert status == GOOD
    (file,) = tmp_path.iterdir()
    found = tomllib.loads(file.read_text(encoding="utf-8"))["hole"]
    assert json.loads(printed)["file"] == str(file)
    assert found["area"] == pytest.approx([0.04, 0.04], rel=0.25)


@pytest.mark.parametrize(
    ("keys", "options", "status", "line"),
    [
        ("hxxxxxhq", (), NOT_GOOD, "teach: nothing written"),  # no key to write
        ("1w", ("--length", "0.6"), NOT_GOOD, "teach: 1: hand at z = -0."),  # outside the workspace
        (SQUARE, (), WRONG_USE, "the rack overlaps the plate"),
    ],
)
def test_places_that_cannot_be_written_are_refused_in_one_line(typed, tmp_path, keys, options, status, line):
    found, _, said = typed(keys, "teach", "--out", str(tmp_path), *options)
    assert (found, line in said, said.count("\n")) == (status, True, 1), said
    assert not list(tmp_path.iterdir())
