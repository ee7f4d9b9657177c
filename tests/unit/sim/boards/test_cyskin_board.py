"""The emulated CySkin hub against the bytes of the makers' library; see `tests.cyskin_makers`."""

import math

import numpy as np
import pytest

from drivers.skin.board_config import HubConfig
from drivers.transport.wires import CanFrame
from sim.boards.cyskin_board import CanBoard, EmulatedHub, sealed
from tests.cyskin_makers import COUNTS, LINES, SENT

STARTED = SENT[:-1]
"""Frames after which only the start is missing."""


@pytest.fixture
def board():
    taxels = np.array(list(COUNTS.values()))[:, 1:].reshape(2, 20)
    return CanBoard(EmulatedHub(HubConfig(), lambda: taxels))


def told(board, *frames):
    return [answer for frame in frames for answer in board.take(frame, 0.0)]


def ask(board, command, payload=b""):
    return told(board, CanFrame(0x5FF, sealed(command, payload)))


def test_hub_answers_as_the_makers_library_accepts(board):
    received = [frame for side, frame in LINES if side == "<"]
    assert told(board, *SENT) + board.scan() == received


def test_hub_in_its_boot_loader_answers_nothing(board):
    assert told(board, *SENT[1:]) == []
    assert math.isinf(board.next_scan)


def test_hub_without_a_number_answers_the_discovery_alone(board):
    assert len(told(board, *SENT[:2])) == 1
    assert ask(board, 0x3C) == []


def test_modules_in_their_boot_loaders_send_no_readings(board):
    told(board, *SENT[:5], SENT[-1])
    assert board.next_scan == pytest.approx(0.05)
    assert board.scan() == []


def test_power_lost_is_the_boot_loader_again(board):
    told(board, *SENT)
    board.power(1.0)
    assert math.isinf(board.next_scan)
    assert ask(board, 0x10) == []


@pytest.mark.parametrize(
    ("command", "payload", "error"), [(0x7F, b"", 0xE2), (0x43, b"", 0xE2), (0x38, b"\0\0", 0xE3), (0x38, b"\1", 0xE3)]
)
def test_what_the_hub_cannot_do_is_answered_with_command_and_error(board, command, payload, error):
    told(board, *STARTED)
    assert ask(board, command, payload) == [CanFrame(0x501, sealed(0x13, bytes([command, error])))]


def test_hub_takes_frames_to_its_own_number_and_no_others(board):
    told(board, *STARTED)
    for number, is_started in ((2, False), (1, True)):
        told(board, CanFrame(0x500 | number, sealed(0x37, b"\1")))
        assert math.isfinite(board.next_scan) is is_started


def test_hub_stops_when_told(board):
    told(board, *SENT)
    ask(board, 0x37, b"\0")
    assert math.isinf(board.next_scan)
