"""Writes a film while it is drawn: MP4 for people, animated WebP for pages."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import av

from cell.film.drawing import Image


@dataclass(frozen=True, slots=True)
class FilmFormat:
    """Format of a film file."""

    codec: str
    rate: int
    """Picture rate, Hz."""
    size: tuple[int, int]
    """Width and height, pixels; even."""
    options: dict[str, str]
    """Options of the encoder."""
    container: dict[str, str]
    """Options of the file."""


FORMATS = {
    ".mp4": FilmFormat(
        "libx264", 25, (1280, 720), {"preset": "veryfast"}, {}
    ),  # H.264: every browser and tablet plays it
    ".webp": FilmFormat(
        "libwebp_anim", 10, (800, 450), {"quality": "80", "compression_level": "6"}, {"loop": "0"}
    ),  # repeated without end
}
"""Format by the file's suffix."""


def encode(path: Path, film_format: FilmFormat, pictures: Iterable[Image]) -> int:
    """Write a film and return its number of pictures; 0 if no file can be written.

    Args:
        path: The file.
        film_format: Its format.
        pictures: Pictures of any size in order; the film ends with the last one.
    """
    number = 0
    try:
        with av.open(str(path), "w", options=film_format.container) as film, ThreadPoolExecutor(1) as other:
            stream = film.add_stream(film_format.codec, rate=film_format.rate, options=film_format.options)
            assert isinstance(stream, av.VideoStream)
            (stream.width, stream.height), stream.pix_fmt = film_format.size, "yuv420p"

            def add(picture: Image) -> None:
                film.mux(stream.encode(av.VideoFrame.from_ndarray(picture)))

            added = other.submit(lambda: None)
            for picture in pictures:  # the other thread encodes a picture while this one draws the next
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
