"""Writes a film as MP4 while it is drawn."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import av

from cell.film.drawing import Image

RATE = 25
"""Picture rate, Hz."""
CODEC: Final = "libx264"
"""Encoder of H.264, which every browser and tablet plays."""
FAST = {"preset": "veryfast"}
"""Options of the encoder."""


def write_mp4(path: Path, size: tuple[int, int], pictures: Iterable[Image]) -> int:
    """Write a film and return its number of pictures; 0 if no file can be written.

    Args:
        path: The file.
        size: Width and height, pixels; even.
        pictures: Pictures in order; if the film ends early, they stop.
    """
    number = 0
    try:
        with av.open(str(path), "w") as film, ThreadPoolExecutor(1) as other:
            stream = film.add_stream(CODEC, rate=RATE, width=size[0], height=size[1], options=FAST)

            def add(picture: Image) -> None:
                film.mux(stream.encode(av.VideoFrame.from_ndarray(picture)))

            added = other.submit(lambda: None)
            for picture in pictures:  # one is added while the next one is drawn
                added.result()
                added = other.submit(add, picture)
                number += 1
            added.result()
            film.mux(stream.encode())
    except av.FFmpegError:
        return 0
    if not number:
        path.unlink(missing_ok=True)
    return number
