"""The panels beside the pictures of the scene: touch, force, stages and head line."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cell.film.drawing import COLOURS, FAINT, INK, PAPER, RULE, Image, blank, colour, width_of, write, write_right
from cell.film.recorded import RecordedRun
from cell.records.wall_clock import local
from drivers.quantities import FINGER_NAMES, FINGERS, Vector
from drivers.scene_facts import BRIGHT, NOISE, felt, touch_colours
from drivers.skin.layout import Layout, finger_positions, triangles

EDGE = 3e-3
"""Margin drawn around the outermost taxels, m."""
SCALE = 90
"""Length of the scale of colours, pixels."""
LIGHT = 430
"""If the sum of a colour's three channels is above this value, text on it is dark."""
_FORCE = colour("#c2374d")


@dataclass(frozen=True, slots=True, eq=False)
class _Pad:
    """Interpolation of each pixel of one finger from its taxels."""

    corners: NDArray[np.intp]
    """Indices of the taxels at the corners of the triangle around each pixel, shape (height, width, 3)."""
    weights: Vector
    """Weights of these taxels, shape (height, width, 3); 0 outside all triangles."""
    labels: tuple[tuple[int, int], ...]
    """Left end of each taxel's number, column and row, pixels."""


class TouchPanel:
    """Both fingers' readings as pictures, interpolated between the taxels, with the peg's angle drawn on them.

    The tip of the hand points down. Both fingers are drawn from the same side, as in the finger frame, so that the
    angle is the same line on both.
    """

    def __init__(self, layout: Layout, width: int, height: int) -> None:
        """Compute the triangle of every pixel."""
        self._width, self._height = width, height
        places = finger_positions(layout)
        low, high = places.min(axis=(0, 1)) - EDGE, places.max(axis=(0, 1)) + EDGE
        self._scale = (height - 34) / (high[0] - low[0])
        self._origin = low
        self._size = (int((high[1] - low[1]) * self._scale), height - 34)
        self._pads = [self._pad(places[finger], layout) for finger in range(FINGERS)]

    def draw(self, taxels: Vector, theta: float, age: float) -> Image:
        """Return the panel for counts, shape (2, n), the angle, rad, and its age, s; NaN without an angle."""
        image = blank(self._width, self._height)
        for finger, pad in enumerate(self._pads):
            left = 14 + finger * (self._size[0] + 22)
            picture = self._finger(pad, taxels[finger], theta)
            image[24 : 24 + picture.shape[0], left : left + picture.shape[1]] = picture
            write(image, FINGER_NAMES[finger], (left, 17), 13, FAINT)
        left = 14 + FINGERS * (self._size[0] + 22)
        write(image, "theta", (left, 44), 13, FAINT)
        write(image, "no peg" if np.isnan(theta) else f"{np.degrees(theta):+.1f}°", (left, 74), 26, INK, bold=True)
        if np.isfinite(age):
            write(image, f"{1e3 * age:.0f} ms old", (left, 96), 13, FAINT)
        write(image, "highest taxel", (left, 120), 13, FAINT)
        write(image, f"{taxels.max() / 1e3:.1f} k counts", (left, 138), 15)
        scale = touch_colours(felt(np.linspace(0.0, BRIGHT, SCALE)))
        image[148:156, left : left + SCALE] = scale.astype(np.uint8)
        write(image, f"0 to {BRIGHT / 1e3:g} k, noise < {NOISE / 1e3:g}", (left, 172), 11, FAINT)
        return image

    def _finger(self, pad: _Pad, values: Vector, theta: float) -> Image:
        counts = (pad.weights * felt(values)[pad.corners]).sum(axis=2)
        picture: Image = touch_colours(counts).astype(np.uint8)
        for taxel, at in enumerate(pad.labels):
            write(picture, str(taxel), at, 9, (213, 222, 230))
        if not np.isnan(theta):
            # The finger's centre is the origin; the tip lies in the direction (cos, sin).
            way = 0.05 * np.array([np.cos(theta), np.sin(theta)])
            start, end = ([round(part) for part in self._pixel(share * way)] for share in (1.0, -0.3))
            for thickness, ink in ((5, (20, 20, 24)), (2, (120, 235, 255))):
                cv2.line(picture, start, end, ink, thickness, cv2.LINE_AA)
        return picture

    def _pixel(self, place: Vector) -> tuple[float, float]:
        return (
            float((place[1] - self._origin[1]) * self._scale),
            float((place[0] - self._origin[0]) * self._scale),
        )

    def _pad(self, places: Vector, layout: Layout) -> _Pad:
        across, down = np.meshgrid(np.arange(self._size[0]), np.arange(self._size[1]))
        x = self._origin[0] + (down + 0.5) / self._scale
        y = self._origin[1] + (across + 0.5) / self._scale
        corners, weights = np.zeros((*x.shape, 3)), np.zeros((*x.shape, 3))
        for corner in triangles(layout):
            a, b, c = places[corner]
            edges = np.linalg.inv(np.column_stack([b - a, c - a]))
            along = np.stack([x - a[0], y - a[1]], axis=-1) @ edges.T
            parts = np.concatenate([1.0 - along.sum(axis=-1, keepdims=True), along], axis=-1)
            inside = parts.min(axis=-1) >= -1e-9
            corners[inside], weights[inside] = corner, parts[inside]
        labels = [
            (round(column - width_of(str(taxel), 9) / 2), round(row) + 3)
            for taxel, (column, row) in enumerate(map(self._pixel, places))
        ]
        return _Pad(corners.astype(int), weights, tuple(labels))


class ForcePanel:
    """The external force over the whole run, drawn up to the present scan."""

    def __init__(self, run: RecordedRun, width: int, height: int) -> None:
        """Draw the axes and the whole curve once."""
        self._run, self._width, self._height = run, width, height
        # Least upper end of the force axis, N.
        self._top = max(25.0, 1.08 * float(np.nanmax(run.force)))
        self._ground = blank(width, height)
        for level in range(0, int(self._top) + 1, 10):
            row = round(self._row(level))
            cv2.line(self._ground, (34, row), (width - 12, row), RULE, 1)
            write_right(self._ground, str(level), (28, row + 4), 11, FAINT)
        write(self._ground, "external force, N", (34, 17), 13, FAINT)
        columns = 34 + (width - 46) * run.times / max(float(run.times[-1]), 1e-9)
        self._points = np.column_stack([columns, self._row(run.force)]).round().astype(np.int32)
        self._whole = cv2.polylines(self._ground.copy(), [self._points], False, _FORCE, 2, cv2.LINE_AA)

    def draw(self, scan: int) -> Image:
        """Return the panel at one scan."""
        image, now = self._ground.copy(), self._points[scan, 0] + 1
        image[:, :now] = self._whole[:, :now]
        cv2.circle(image, tuple(map(int, self._points[scan])), 4, _FORCE, -1, cv2.LINE_AA)
        write_right(image, f"{self._run.force[scan]:.1f} N", (self._width - 12, 19), 17, INK, bold=True)
        return image

    def _row(self, force: Any) -> Any:
        """Return the pixel row of one or many forces."""
        return self._height - 12 - (self._height - 40) * force / self._top


def stage_strip(run: RecordedRun, scan: int, width: int, height: int) -> Image:
    """Return the stages of a run as a strip over time, with the present time marked."""
    image = blank(width, height)
    last = max(float(run.times[-1]), 1e-9)

    def column(time: float) -> int:
        return round(time / last * (width - 1))

    stages = run.samples["stage"].astype(int)
    edges = [0, *(np.flatnonzero(np.diff(stages)) + 1), len(stages) - 1]
    for first, end in pairwise(edges):
        left, right = column(run.times[first]), column(run.times[end])
        ink = colour(COLOURS[stages[first] % len(COLOURS)])
        pale = [round(255 - 0.30 * (255 - part)) for part in ink]
        cv2.rectangle(image, (left, 0), (max(right - 1, left), height - 24), pale, -1)
        if first <= scan:
            cv2.rectangle(image, (left, 0), (min(column(run.times[scan]), right - 1), height - 24), ink, -1)
        name = run.stages[first].replace("_", " ")
        if width_of(name, 13, bold=True) + 10 < right - left:
            is_on_dark = column(run.times[scan]) > left + width_of(name, 13) / 2 and sum(ink) < LIGHT
            write(image, name, (left + 6, height - 34), 13, PAPER if is_on_dark else INK, bold=True)
    for second in range(0, int(last) + 1, max(1, round(last / 12))):
        write(image, f"{second} s", (min(column(second), width - 26), height - 6), 12, FAINT)
    now = column(run.times[scan])
    cv2.line(image, (now, 0), (now, height - 22), INK, 2)
    return image


def head_line(run: RecordedRun, scan: int, width: int, height: int) -> Image:
    """Return the head line: run, program, stage, time since the start, and start time."""
    image = blank(width, height)
    row = run.row
    base = height - 15
    write(image, f"Run {row.run}", (12, base), 20, INK, bold=True)
    left = 24 + width_of(f"Run {row.run}", 20, bold=True)
    kind = "simulated" if run.is_simulated else "as sensed"
    write(image, f"{row.program}, {kind}: {row.outcome} {row.reason}".rstrip(), (left, base), 15, FAINT)
    write_right(image, f"{run.times[scan]:6.2f} s", (width - 12, base), 20, INK, bold=True)
    stage = run.stages[scan].replace("_", " ")
    write_right(image, f"{stage}    started {local(row.started)}", (width - 110, base), 15, FAINT)
    return image
