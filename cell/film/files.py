"""Writes pictures and films: one picture as PNG, a film as MP4 for people and GIF for pages."""

from collections.abc import Callable, Iterator
from itertools import takewhile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pillow

from cell.film.drawing import Image
from cell.film.frames import HEIGHT, WIDTH, filmed
from cell.film.mp4 import RATE, write_mp4
from cell.film.recorded import RecordedRun
from drivers.errors import ConfigError

GIF_RATE = 10.0
"""Picture rate of GIF files, Hz; GIF files, for pages, store times in hundredths of a second."""

Draw = Callable[[float], Image]
"""Function that returns the picture at a time since the first scan, s."""
Done = Callable[[int, int], None]
"""Function called after each picture with the number of pictures done and of all."""
IsEnded = Callable[[], bool]
"""Function that returns True if the film is to end early."""
Write = Callable[[Path, Iterator[Image]], int]
"""Function that writes all pictures and returns their number in the file; 0 without a file."""


def write_film(
    run: RecordedRun, path: Path, at: float | None, done: Done, is_ended: IsEnded = lambda: False
) -> tuple[int, int]:
    """Write a run in the format of the file's suffix; return the number of pictures in the file, and of all.

    Args:
        run: The run.
        path: `*.mp4` or `*.gif` for a film in real time, `*.png` for one picture.
        at: Time of the one picture since the first scan, s; None for the last scan.
        done: Function called after each drawn picture.
        is_ended: Function that returns True to end the film early: the pictures so far are written; without any, no file.

    Raises:
        ConfigError: The suffix is unknown, the time is outside the run, the file cannot be written, or OpenGL is missing.
    """
    duration = float(run.times[-1])
    write, rate = _require_kind(path)
    if at is not None and rate is not None:
        raise ConfigError(f"--at {at:g}: a film shows all of a run; allowed with *.png")
    if at is not None and not 0.0 <= at <= duration:
        raise ConfigError(f"--at {at:g}: run {run.row.run} has 0 to {duration:.2f} s")
    times = instants(duration, rate) if rate is not None else [duration if at is None else at]
    with filmed(run, is_fine=rate != RATE) as film:

        def draw(number: int) -> Image:
            image = film.frame(times[number])
            done(number + 1, len(times))
            return image

        wanted = takewhile(lambda _: not is_ended(), range(len(times)))
        pictures = write(path, map(draw, wanted))
    if pictures < len(times) and not is_ended():
        raise ConfigError(f"--out {path}: cannot be written")
    return pictures, len(times)


def _write_png(path: Path, pictures: Iterator[Image]) -> int:
    drawn = next(pictures, None)
    return int(
        drawn is not None
        and cv2.imwrite(str(path), np.ascontiguousarray(drawn[..., ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    )


def _write_mp4(path: Path, pictures: Iterator[Image]) -> int:
    return write_mp4(path, (WIDTH, HEIGHT), pictures)


def _write_gif(path: Path, pictures: Iterator[Image]) -> int:
    """Write an endless GIF, each picture with its own palette."""
    frames = 0

    def small() -> Iterator[Pillow.Image]:
        nonlocal frames
        for picture in pictures:
            frames += 1
            shrunk = cv2.resize(picture, (800, 450), interpolation=cv2.INTER_AREA)
            yield Pillow.fromarray(shrunk).quantize(256, dither=Pillow.Dither.NONE)

    try:
        for first in (rest := small()):
            first.save(path, save_all=True, append_images=rest, duration=round(1e3 / GIF_RATE), loop=0)
    except OSError:
        return 0
    return frames


_KINDS: dict[str, tuple[Write, float | None]] = {
    ".mp4": (_write_mp4, RATE),
    ".gif": (_write_gif, GIF_RATE),
    ".png": (_write_png, None),
}
"""Writer and picture rate of each kind of file; a single picture has no rate."""


def _require_kind(path: Path) -> tuple[Write, float | None]:
    if path.suffix.lower() not in _KINDS:
        raise ConfigError(f"--out {path}: *{', *'.join(_KINDS)} allowed")
    return _KINDS[path.suffix.lower()]


def instants(duration: float, rate: float) -> list[float]:
    """Return the times of a film's pictures, s, the last scan's included."""
    times = np.arange(0.0, duration, 1.0 / rate).tolist()
    return [*times, duration]
