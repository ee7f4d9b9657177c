import os
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from cell.run.brake import fault_of
from drivers.errors import CellError, DeviceNotOpenedError, GripperSilentError
from drivers.gripper import franka
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.quantities import GripperState

CLIENT = '''
from os.path import exists
from types import SimpleNamespace

class FrankaException(Exception):
    """Base of the library's errors that are no RuntimeError."""

class CommandException(RuntimeError):
    pass

class Gripper:
    def __init__(self, host):
        self.force = 0.0
        if host == "old":
            raise FrankaException("Incompatible library version")

    def read_once(self):
        if exists("unplugged"):
            raise RuntimeError("UDP receive: Timeout")
        return SimpleNamespace(width=0.008, is_grasped=self.force > 0.0)

    def grasp(self, width, speed, force, inner, outer):
        self.force = force
        open("grasp").read()
        return True

    def move(self, width, speed):
        self.force = 0.0
        open("move").read()
        return True
'''
"""The maker's library for a hand whose fingers move until the test has opened and closed the FIFO of the command."""


@pytest.fixture
def hand_at(tmp_path, monkeypatch):
    """Return a function that opens the hand at an address."""
    (tmp_path / "pylibfranka.py").write_text(CLIENT)
    os.mkfifo(tmp_path / "grasp")
    os.mkfifo(tmp_path / "move")
    own = Path(franka.__file__).parents[2]
    monkeypatch.setenv("PYTHONPATH", f"{own}{os.pathsep}{tmp_path}")
    monkeypatch.setattr(franka, "find_spec", lambda name: True)
    monkeypatch.chdir(tmp_path)
    opened = []

    def open_at(host):
        hand = FrankaGripper(FrankaGripperConfig(kind="franka", host=host), 0.08)
        hand.open()
        opened.append(hand)
        return hand

    yield open_at
    for hand in opened:
        hand.close()


def eventually(act, error):
    """Return the result of `act` as soon as it no longer raises `error`."""
    end = time.monotonic() + 10.0
    while True:
        try:
            return act()
        except error:
            assert time.monotonic() < end
            os.sched_yield()


@contextmanager
def during(command):
    """Wait until the fingers move for this command; they arrive at the end."""
    fifo = eventually(lambda: os.open(command, os.O_WRONLY | os.O_NONBLOCK), OSError)
    yield
    os.close(fifo)


def test_commands_sent_during_a_motion_are_obeyed_in_order(hand_at):
    hand = hand_at("here")
    hand.grip(30.0)
    hand.release(0.06)
    hand.grip(20.0)
    for command in ("grasp", "move", "grasp"):
        with during(command):
            assert hand.read().is_moving
    while hand.read().is_moving:
        os.sched_yield()
    assert hand.read() == GripperState(0.008, is_gripping=True, is_moving=False)


def test_a_lost_hand_takes_no_command_and_stands_still_afterwards(hand_at):
    hand = hand_at("here")
    Path("unplugged").touch()
    while fault_of(hand.read) is None:
        os.sched_yield()
    with pytest.raises(GripperSilentError, match="Timeout"):
        hand.release(0.06)
    Path("unplugged").unlink()
    assert not eventually(hand.read, CellError).is_moving


def test_a_hand_of_another_version_is_named(hand_at):
    with pytest.raises(DeviceNotOpenedError, match="Incompatible library version"):
        hand_at("old")
