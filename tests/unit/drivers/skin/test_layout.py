import numpy as np
import pytest

from drivers.skin.layout import LAYOUTS, PITCH, finger_positions, pad_size, positions, triangles


def _areas(layout):
    a, b, c = (positions(layout)[triangles(layout)[:, k]].T for k in range(3))
    return np.abs((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])) / 2


@pytest.mark.parametrize("layout", LAYOUTS)
def test_neighbouring_taxels_are_a_pitch_apart(layout):
    taxels = positions(layout)
    distance = np.linalg.norm(taxels[:, None] - taxels, axis=-1) + np.eye(20)
    assert distance.min(axis=1) == pytest.approx(PITCH)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_centre_of_the_taxels_is_the_finger_centre(layout):
    assert positions(layout).mean(axis=0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("layout", "hull"), [("parallelogram", 12 * 2), ("base_to_base", 2 * 9 + 3 * 2 * 7.6 / 6.495190528)]
)
def test_triangles_cover_the_hull_once(layout, hull):
    equilateral = PITCH**2 * 0.75**0.5 / 2
    assert _areas(layout).sum() == pytest.approx(hull * equilateral)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_no_taxel_lies_inside_a_triangles_circumcircle(layout):
    taxels = positions(layout)
    for corners in triangles(layout):
        a, b, c = taxels[corners]
        centre = np.linalg.solve(2 * np.array([b - a, c - a]), [b @ b - a @ a, c @ c - a @ a])
        assert (np.linalg.norm(taxels - centre, axis=1) > np.linalg.norm(a - centre) - 1e-9).all()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_left_finger_mirrors_the_right_one_about_the_finger_axis(layout):
    left, right = finger_positions(layout)
    assert left == pytest.approx(right * [1.0, -1.0])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pad_reaches_as_far_as_the_taxels(layout):
    half = np.array(pad_size(layout)) / 2
    assert (np.abs(positions(layout)) <= half + 1e-9).all()
