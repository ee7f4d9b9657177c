"""Writes pictures and films: one picture as PNG, a film as MP4 for people and GIF for pages."""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pillow

from cell.film.drawing import Image
from cell.film.frames import HEIGHT, WIDTH, filmed
from cell.film.recorded import RecordedRun
from drivers.errors import ConfigError

MP4_RATE = 25.0
"""Picture rate of MP4 files, Hz."""
GIF_RATE = 10.0
"""Picture rate of GIF files, Hz; a GIF is for pages, and counts time in hundredths of a second."""
GIF_SIZE = (800, 450)
CODEC = "vp09"
"""Video codec that browsers play and OpenCV's wheel can write; it cannot write H.264."""

Draw = Callable[[float], Image]
"""Function that returns the picture at a time since the first scan, s."""
Done = Callable[[int, int], None]
"""Function that is called after each picture with the number of pictures done and of all."""


def write_film(run: RecordedRun, path: Path, at: float | None, done: Done) -> int:
    """Write a run in the form of the file's ending, and return the number of pictures drawn.

    Args:
        run: The run.
        path: `*.mp4` or `*.gif` for a film in real time, `*.png` for one picture.
        at: Time of the one picture since the first scan, s; None takes the last scan's.
        done: Called after each picture.

    Raises:
        ConfigError: The ending is unknown, the time is outside the run, the file cannot be written, or OpenGL is missing.
    """
    duration = float(run.times[-1])
    write, rate = _require_kind(path)
    if at is not None and rate is not None:
        raise ConfigError(f"--at {at:g}: a film shows all of a run; allowed with *.png")
    if at is not None and not 0.0 <= at <= duration:
        raise ConfigError(f"--at {at:g}: run {run.row.run} has 0 to {duration:.2f} s")
    times = instants(duration, rate) if rate is not None else [duration if at is None else at]
    with filmed(run) as film:

        def draw(number: int) -> Image:
            image = film.frame(times[number])
            done(number + 1, len(times))
            return image

        _require(write(path, map(draw, range(len(times)))), path)
    return len(times)


def _write_png(path: Path, pictures: Iterator[Image]) -> bool:
    return bool(cv2.imwrite(str(path), _bgr(next(pictures)), [cv2.IMWRITE_PNG_COMPRESSION, 9]))


def _write_mp4(path: Path, pictures: Iterator[Image]) -> bool:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*CODEC), MP4_RATE, (WIDTH, HEIGHT))
    try:
        if not writer.isOpened():
            return False
        for picture in pictures:
            writer.write(_bgr(picture))
    finally:
        writer.release()
    return True


def _write_gif(path: Path, pictures: Iterator[Image]) -> bool:
    """Write a GIF that repeats for ever, each picture with its own palette."""
    small = [_shrunk(picture).quantize(256, dither=Pillow.Dither.NONE) for picture in pictures]
    try:
        small[0].save(path, save_all=True, append_images=small[1:], duration=round(1e3 / GIF_RATE), loop=0)
    except OSError:
        return False
    return True


_KINDS: dict[str, tuple[Callable[[Path, Iterator[Image]], bool], float | None]] = {
    ".mp4": (_write_mp4, MP4_RATE),
    ".gif": (_write_gif, GIF_RATE),
    ".png": (_write_png, None),
}
"""Writer and picture rate of each kind of file; a single picture has no rate."""


def _require_kind(path: Path) -> tuple[Callable[[Path, Iterator[Image]], bool], float | None]:
    if path.suffix.lower() not in _KINDS:
        raise ConfigError(f"--out {path}: *{', *'.join(_KINDS)} allowed")
    return _KINDS[path.suffix.lower()]


def instants(duration: float, rate: float) -> list[float]:
    """Return the times of a film's pictures, s; the last scan's is among them."""
    times = np.arange(0.0, duration, 1.0 / rate).tolist()
    return [*times, duration]


def _shrunk(image: Image) -> Pillow.Image:
    return Pillow.fromarray(cv2.resize(image, GIF_SIZE, interpolation=cv2.INTER_AREA))


def _bgr(image: Image) -> Image:
    return np.ascontiguousarray(image[..., ::-1])


def _require(is_written: bool, path: Path) -> None:
    if not is_written:
        raise ConfigError(f"--out {path}: cannot be written")
