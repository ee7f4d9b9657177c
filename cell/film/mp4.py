"""Writes a film as MP4 while it is drawn, in short pieces, so that whoever ends it early waits for no encoder and has a film."""

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
"""Number of pictures of one piece, which begins with a picture that needs no other; OpenCV makes every twelfth picture so."""
PATIENCE = 0.05
"""Time between two looks at whether somebody has ended the film, s."""


class _Piece(Thread):
    """Encodes some pictures beside the drawing of the next ones; nobody waits for it when the program ends."""

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
        """Wait until all is encoded or somebody ends the film, and tell whether all is encoded."""
        while self.is_alive() and not is_ended():
            self.join(PATIENCE)
        return self.is_good and not self.is_alive()

    def packets(self) -> Iterator[tuple[Image, bool]]:
        """Return the encoded pictures in order, and whether each needs no other; the piece is deleted behind them."""
        reader = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
        while (read := reader.read())[0]:
            yield np.asarray(read[1], dtype=np.uint8).ravel(), bool(reader.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME))
        reader.release()
        self.path.unlink()


def write_mp4(path: Path, size: tuple[int, int], pictures: Iterable[Image], is_ended: Callable[[], bool]) -> int:
    """Write a film and return the number of pictures in it; 0 where there is no file, or none that can be written.

    Args:
        path: The file.
        size: Width and height, pixels.
        pictures: Pictures in order; they end early where the film is ended.
        is_ended: Whether somebody has ended the film: what is encoded by then is written and nothing waited for.
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
    """Yield the pieces that are encoded, in order; while one is encoded the pictures of the next are drawn."""
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
    """Append the pictures of a piece as they are encoded, and return their number."""
    pictures = 0
    for packet, is_key in piece.packets():
        whole.set(cv2.VIDEOWRITER_PROP_KEY_FLAG, float(is_key))
        whole.write(packet)
        pictures += 1
    return pictures
