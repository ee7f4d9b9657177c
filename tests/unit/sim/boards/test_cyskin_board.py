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
    taxels = np.array(list(COUNTS.values()))[:, HubConfig().channels].reshape(2, 20)
    return CanBoard(EmulatedHub(HubConfig(), lambda: taxels))


def told(board, *frames):
    return [answer for frame in frames for answer in board.take(frame, 0.0)]


def ask(board, command, payload=b""):
    return told(board, CanFrame(0x5FF, sealed(command, payload)))


def test_hub_answers_as_the_makers_library_accepts(board):
    received = [frame for side, frame in LINES if side == "<"]
    assert told(board, *SENT) + board.scan() == received


@pytest.mark.parametrize(
    ("frames", "answers", "next_scan"),
    [
        (SENT[1:], 0, math.inf),
        ([*SENT[:2], CanFrame(0x5FF, sealed(0x3C, b""))], 1, math.inf),
        ([*SENT[:5], SENT[-1]], None, 0.05),
        ([*SENT, CanFrame(0x5FF, sealed(0x37, b"\0"))], None, math.inf),
    ],
    ids=["in its boot loader", "without a number", "modules in their boot loaders", "stopped"],
)
def test_a_hub_that_is_not_started_answers_little_and_sends_no_readings(board, frames, answers, next_scan):
    heard = told(board, *frames)
    assert answers is None or len(heard) == answers
    assert board.next_scan == pytest.approx(next_scan)
    assert math.isinf(next_scan) or board.scan() == []


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
