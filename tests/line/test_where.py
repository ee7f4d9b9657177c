"""`cell where` prints the joints and the tool of the simulated arm."""

import json

import numpy as np
import pytest

from cell.commands.cli import GOOD, main
from cell.config.load import load
from drivers import impedance
from drivers.frames import quaternion

IDEAL = ["--set", "reality.scale=0"]
ARM = load().cell.arm_model()


def test_the_pose_belongs_to_the_joints(capsys):
    assert main(["where", "--json", *IDEAL]) == GOOD
    found = json.loads(capsys.readouterr().out)
    position, rotation, _, _ = impedance.forward(impedance.figures(ARM), np.array(found["q"]))
    assert found["position"] == pytest.approx(position)
    assert found["quaternion"] == pytest.approx(quaternion(rotation))
    assert found["q"] == pytest.approx(ARM.home, abs=0.01)


def test_people_read_angles_and_place(capsys):
    assert main(["where", *IDEAL]) == GOOD
    told = capsys.readouterr().out
    assert "finger centre (m)" in told
    assert "end of a straight peg (m)" in told
