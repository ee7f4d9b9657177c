import numpy as np
import pytest

from drivers.errors import ConfigError
from drivers.skin.layout import LAYOUTS, PITCH, finger_positions, layout_of, pad_size, positions, triangles


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


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        ("places = [[0.0, 0.0]]", "places: Tuple should have at least 3"),
        ("places = [[0.0, 0.0], [0.0, 7.0], [7.0, 0.0]]", r"places.1.1: Input should be less"),
        (
            "places = [[0.0, 0.0], [0.0, 0.007], [0.007, 0.0]]\nmodules = 2",
            "places: 3; a multiple of modules = 2 allowed",
        ),
        ("places = ", "not TOML"),
    ],
)
def test_a_file_that_is_no_layout_is_refused_in_one_line(tmp_path, figures, said):
    path = tmp_path / "other.toml"
    path.write_text(f"pad = [0.03, 0.02]\nfull_scale = 20_000.0\nnoise = 0.015\nbeside = 0.1\n{figures}\n")
    with pytest.raises(ConfigError, match=said) as caught:
        layout_of(str(path))
    assert "\n" not in str(caught.value)


def test_a_layout_whose_file_is_missing_is_refused_by_its_name():
    with pytest.raises(ConfigError, match=r"nowhere\.toml: layout cannot be read"):
        layout_of("nowhere.toml")
