"""Text, lines and colours of a film's panels, drawn with OpenCV; colours are red, green, blue."""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""An image, shape (height, width, 3), red first."""
Colour = tuple[int, int, int]

PAPER: Colour = (255, 255, 255)
BEHIND: Colour = (243, 245, 247)
"""Colour between the panels."""
INK: Colour = (32, 38, 46)
FAINT: Colour = (120, 130, 140)
RULE: Colour = (222, 227, 232)
COLOURS = ("#bbbbbb", "#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377")
"""Colours of stage 0 (none) and of stages 1 to 6; colour-blind readers can distinguish them."""
_FACE = cv2.FontFace("sans")


def colour(code: str) -> Colour:
    """Return the colour of a code `#rrggbb`."""
    red, green, blue = (int(code[place : place + 2], 16) for place in (1, 3, 5))
    return red, green, blue


def blank(width: int, height: int, paper: Colour = PAPER) -> Image:
    """Return an empty panel, as a copy of a cached panel: NumPy takes ten times as long to fill a new one."""
    return _blank(width, height, paper).copy()


@cache
def _blank(width: int, height: int, paper: Colour) -> Image:
    return np.full((height, width, 3), paper, dtype=np.uint8)


def write(image: Image, text: str, at: tuple[int, int], size: int = 15, ink: Colour = INK, bold: bool = False) -> None:
    """Write one line of text with its left end at the point `at`, pixels."""
    cv2.putText(image, text, at, ink, _FACE, size, 700 if bold else 400)


def width_of(text: str, size: int, bold: bool = False) -> int:
    """Return the width of one line of text, pixels."""
    box = cv2.getTextSize((2000, 100), text, (0, 50), _FACE, size, 700 if bold else 400)
    return int(box[2])


def write_right(image: Image, text: str, at: tuple[int, int], size: int, ink: Colour, bold: bool = False) -> None:
    """Write one line of text with its right end at the point `at`, pixels."""
    write(image, text, (at[0] - width_of(text, size, bold), at[1]), size, ink, bold)
