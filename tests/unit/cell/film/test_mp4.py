"""A film is written in pieces while it is drawn, and ended early it has what was encoded by then."""

import threading

import cv2
import numpy as np
import pytest

from cell.film.mp4 import PIECE, write_mp4

SIZE = (64, 48)


def grey(number):
    return np.full((SIZE[1], SIZE[0], 3), 8 * number, dtype=np.uint8)


def shown(path):
    """Return the mean brightness of each picture of a film."""
    film, found = cv2.VideoCapture(str(path)), []
    while (read := film.read())[0]:
        found.append(read[1].mean())
    return found


def test_the_pieces_of_a_film_are_one_film_in_order(tmp_path):
    number = 2 * PIECE + 3
    assert write_mp4(tmp_path / "a.mp4", SIZE, map(grey, range(number)), lambda: False) == number
    assert shown(tmp_path / "a.mp4") == pytest.approx([8 * each for each in range(number)], abs=6)


def test_a_film_that_is_ended_has_what_was_encoded_and_waits_for_nothing(tmp_path):
    ended = threading.Event()

    def drawn():
        for number in range(100):
            if number == PIECE + 2:
                next(each for each in threading.enumerate() if each.name == "film piece").join()
                ended.set()
                return
            yield grey(number)

    assert write_mp4(tmp_path / "a.mp4", SIZE, drawn(), ended.is_set) == PIECE
    assert len(shown(tmp_path / "a.mp4")) == PIECE


def test_a_film_that_is_ended_before_anything_is_encoded_leaves_no_file(tmp_path):
    assert write_mp4(tmp_path / "a.mp4", SIZE, map(grey, range(3)), lambda: True) == 0
    assert list(tmp_path.iterdir()) == []
