"""Writes a film as MP4 while it is drawn."""

from collections.abc import Iterable
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
        with av.open(str(path), "w") as film:
            stream = film.add_stream(CODEC, rate=RATE, width=size[0], height=size[1], options=FAST)
            for picture in pictures:
                film.mux(stream.encode(av.VideoFrame.from_ndarray(picture)))
                number += 1
            film.mux(stream.encode())
    except av.FFmpegError:
        return 0
    if not number:
        path.unlink(missing_ok=True)
    return number
