"""A film has the pictures that were drawn, in a codec that every browser plays."""

from dataclasses import replace

import av
import numpy as np
import pytest

from cell.film.encoder import FORMATS, encode

SIZE = (64, 48)
MP4 = replace(FORMATS[".mp4"], size=SIZE)


def grey(number):
    return np.full((SIZE[1], SIZE[0], 3), 8 * number, dtype=np.uint8)


def test_a_film_has_its_pictures_in_order_in_h264(tmp_path):
    assert encode(tmp_path / "a.mp4", MP4, map(grey, range(27))) == 27
    with av.open(tmp_path / "a.mp4") as film:
        shown = [picture.to_ndarray(format="rgb24").mean() for picture in film.decode(video=0)]
        assert film.streams.video[0].codec_context.name == "h264"
    assert shown == pytest.approx([8 * each for each in range(27)], abs=6)


def test_a_film_without_a_picture_leaves_no_file(tmp_path):
    assert encode(tmp_path / "a.mp4", MP4, iter(())) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_film_that_cannot_be_written_has_no_pictures(tmp_path):
    assert encode(tmp_path / "none" / "a.mp4", MP4, map(grey, range(3))) == 0
