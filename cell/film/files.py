"""Writes pictures and films: one picture as PNG, a film in a format of the encoder."""

from collections.abc import Callable, Iterator
from itertools import takewhile
from pathlib import Path

import cv2
import numpy as np

from cell.film.drawing import Image
from cell.film.encoder import FORMATS, encode
from cell.film.frames import filmed
from cell.film.recorded import RecordedRun
from drivers.errors import ConfigError

PICTURE = ".png"
"""Suffix of a single picture."""


def write_film(
    run: RecordedRun, path: Path, at: float | None, done: Callable[[int, int], None], is_ended: Callable[[], bool]
) -> tuple[int, int]:
    """Write a run in the format of the file's suffix; return the numbers of pictures written and of pictures in the whole run.

    Args:
        run: The run.
        path: `*.mp4` or `*.webp` for a film in real time, `*.png` for one picture.
        at: Time of the one picture since the first scan, s; None for the last scan.
        done: Function called after each drawn picture, with the number drawn so far and the number to draw.
        is_ended: Function that returns True to end the film early; the file then has the pictures so far, if there are any.

    Raises:
        ConfigError: The suffix is unknown, the time is outside the run, the file cannot be written, or OpenGL is missing.
    """
    duration, kind = float(run.times[-1]), path.suffix.lower()
    if kind not in (*FORMATS, PICTURE):
        raise ConfigError(f"--out {path}: *{', *'.join((*FORMATS, PICTURE))} allowed")
    film_format = FORMATS.get(kind)
    if at is not None and film_format is not None:
        raise ConfigError(f"--at {at:g}: a film shows the whole run; --at allowed with *.png")
    if at is not None and not 0.0 <= at <= duration:
        raise ConfigError(f"--at {at:g}: run {run.row.run} has 0 to {duration:.2f} s")
    times = instants(duration, film_format.rate) if film_format is not None else [duration if at is None else at]
    with filmed(run, is_fine=film_format is None) as film:

        def draw(number: int) -> Image:
            image = film(times[number])
            done(number + 1, len(times))
            return image

        wanted = takewhile(lambda _: not is_ended(), range(len(times)))
        drawn = map(draw, wanted)
        pictures = _write_png(path, drawn) if film_format is None else encode(path, film_format, drawn)
    if pictures < len(times) and not is_ended():
        raise ConfigError(f"--out {path}: cannot be written")
    return pictures, len(times)


def _write_png(path: Path, pictures: Iterator[Image]) -> int:
    drawn = next(pictures, None)
    return int(
        drawn is not None
        and cv2.imwrite(str(path), np.ascontiguousarray(drawn[..., ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    )


def instants(duration: float, rate: float) -> list[float]:
    """Return the times of a film's pictures, s, including that of the last scan."""
    times = np.arange(0.0, duration, 1.0 / rate).tolist()
    return [*times, duration]
