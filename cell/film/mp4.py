"""Writes a film as MP4 while it is drawn, in short pieces, so that an early end needs no wait and leaves a film."""

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

import cv2
import numpy as np

from cell.film.drawing import Image

RATE = 25.0
"""Picture rate, Hz."""
CODEC = cv2.VideoWriter.fourcc(*"vp09")
"""Video codec that browsers play and OpenCV's wheel can write; it cannot write H.264."""
PIECE = 12
"""Number of pictures in one piece, which starts with a key frame; OpenCV makes every twelfth picture a key frame."""
PATIENCE = 0.05
"""Period of the check for an early end, s."""


class _Piece(Thread):
    """Encodes some pictures while the next ones are drawn; the end of the program does not wait for it."""

    def __init__(self, path: Path, pictures: list[Image]) -> None:
        super().__init__(name="film piece", daemon=True)
        self.path, self._pictures, self.is_good = path, pictures, False
        self.start()

    def run(self) -> None:
        height, width = self._pictures[0].shape[:2]
        writer = cv2.VideoWriter(str(self.path), cv2.CAP_FFMPEG, CODEC, RATE, (width, height))
        for picture in self._pictures:
            writer.write(np.ascontiguousarray(picture[..., ::-1]))
        self.is_good = writer.isOpened()
        writer.release()

    def is_done(self, is_ended: Callable[[], bool]) -> bool:
        """Wait until all pictures are encoded or the film ends early; return True if all are encoded."""
        while self.is_alive() and not is_ended():
            self.join(PATIENCE)
        return self.is_good and not self.is_alive()

    def packets(self) -> Iterator[tuple[Image, bool]]:
        """Return the encoded pictures in order, each with True if it is a key frame; then delete the piece."""
        reader = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
        while (read := reader.read())[0]:
            yield np.asarray(read[1], dtype=np.uint8).ravel(), bool(reader.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME))
        reader.release()
        self.path.unlink()


def write_mp4(path: Path, size: tuple[int, int], pictures: Iterable[Image], is_ended: Callable[[], bool]) -> int:
    """Write a film and return its number of pictures; 0 if no file can be written.

    Args:
        path: The file.
        size: Width and height, pixels.
        pictures: Pictures in order; the iterator stops if the film ends early.
        is_ended: Function that returns True to end the film early: the encoded pictures are written without a further wait.
    """
    form = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1, cv2.VIDEOWRITER_PROP_KEY_INTERVAL, PIECE]
    whole = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, CODEC, RATE, size, form)
    try:
        if not whole.isOpened():
            return 0
        with TemporaryDirectory(prefix="cell-film-", ignore_cleanup_errors=True) as folder:
            written = sum(_append(whole, piece) for piece in _encoded(Path(folder), pictures, is_ended))
    finally:
        whole.release()
    if not written:
        path.unlink()
    return written


def _encoded(folder: Path, pictures: Iterable[Image], is_ended: Callable[[], bool]) -> Iterator[_Piece]:
    """Yield the encoded pieces in order; while one is encoded, the pictures of the next are drawn."""
    left, under_way = iter(pictures), None
    while (drawn := list(islice(left, PIECE))) or under_way:
        if under_way:
            if not under_way.is_done(is_ended):
                return
            yield under_way
        if is_ended():
            return
        under_way = _Piece(folder / "piece.mp4", drawn) if drawn else None


def _append(whole: cv2.VideoWriter, piece: _Piece) -> int:
    """Append the encoded pictures of a piece, and return their number."""
    pictures = 0
    for packet, is_key in piece.packets():
        whole.set(cv2.VIDEOWRITER_PROP_KEY_FLAG, float(is_key))
        whole.write(packet)
        pictures += 1
    return pictures
