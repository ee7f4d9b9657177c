"""The panels beside the pictures of the scene show the values that they are given."""

import numpy as np
import pytest

from cell.film.files import instants
from cell.film.panels import TouchPanel
from drivers.skin.layout import LAYOUTS, finger_positions

WIDTH, HEIGHT = 450, 182
ORIGIN = (14, 24)
"""Left upper corner of the left finger's picture, pixels."""


def left_finger(layout, taxels, theta):
    """Return the left finger's picture, and pixels a metre."""
    panel = TouchPanel(layout, WIDTH, HEIGHT)
    image = panel.draw(taxels, theta, 0.0)
    places = finger_positions(layout)
    low, high = places.min(axis=(0, 1)) - 3e-3, places.max(axis=(0, 1)) + 3e-3
    scale = (HEIGHT - 34) / (high[0] - low[0])
    width = int((high[1] - low[1]) * scale)
    return image[ORIGIN[1] : ORIGIN[1] + HEIGHT - 34, ORIGIN[0] : ORIGIN[0] + width].astype(int), scale, low


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("taxel", [0, 7, 13, 19])
def test_a_pressed_taxel_is_brightest_where_it_is(layout, taxel):
    taxels = np.zeros((2, 20))
    taxels[0, taxel] = 10e3
    pressed, scale, low = left_finger(layout, taxels, np.nan)
    untouched, *_ = left_finger(layout, np.zeros((2, 20)), np.nan)
    rise = (pressed - untouched).sum(axis=2)
    x, y = finger_positions(layout)[0, taxel]
    rows, columns = np.nonzero(rise > 0.8 * rise.max())
    # At the rim the triangles lie on one side only, and the taxel's number hides its middle: 2.5 mm of a pitch of 7.5.
    assert np.hypot(rows.mean() / scale - (x - low[0]), columns.mean() / scale - (y - low[1])) < 2.5e-3


@pytest.mark.parametrize("theta", [-0.4, 0.0, 0.4])
def test_the_angle_is_drawn_with_the_tip_down(theta):
    picture, *_ = left_finger("parallelogram", np.zeros((2, 20)), theta)
    is_line = (picture[..., 2] > 200) & (picture[..., 0] < 180)
    rows, columns = np.nonzero(is_line)
    # Columns run along y of the finger frame and rows along x: the tip lies in the direction (cos, sin).
    assert np.polyfit(rows, columns, 1)[0] == pytest.approx(np.tan(theta), abs=0.03)


def test_without_an_angle_no_line_is_drawn():
    picture, *_ = left_finger("parallelogram", np.zeros((2, 20)), np.nan)
    assert not ((picture[..., 2] > 200) & (picture[..., 0] < 180)).any()


def test_a_film_ends_with_the_last_scan():
    assert instants(0.1, 25.0) == pytest.approx([0.0, 0.04, 0.08, 0.1])
