"""Where the taxels are, and what each of them reads more than another."""

from datetime import date

import numpy as np
import pytest

from drivers.errors import ConfigError
from drivers.skin.calibration import CalibratedSkin, SkinCalibration, read_calibration
from drivers.skin.layout import LAYOUTS, PITCH, finger_positions, layout_of, pad_size, positions, triangles
from tests.fakes import FakeClock, FakeSkin


def _areas(layout):
    a, b, c = (positions(layout)[triangles(layout)[:, k]].T for k in range(3))
    return np.abs((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])) / 2


@pytest.mark.parametrize("layout", LAYOUTS)
def test_taxels_are_a_pitch_apart_and_mirrored_between_the_fingers(layout):
    taxels, (left, right) = positions(layout), finger_positions(layout)
    distance = np.linalg.norm(taxels[:, None] - taxels, axis=-1) + np.eye(20)
    assert distance.min(axis=1) == pytest.approx(PITCH)
    assert taxels.mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert (np.abs(taxels) <= np.array(pad_size(layout)) / 2 + 1e-9).all()
    assert left == pytest.approx(right * [1.0, -1.0])


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


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        ("places = [[0.0, 0.0]]", "places: Tuple should have at least 3"),
        ("places = [[0.0, 0.0], [0.0, 7.0], [7.0, 0.0]]", r"places.1.1: Input should be less"),
        ("places = [[0.0, 0.0], [0.0, 0.007], [0.007, 0.0]]\nmodules = 2", "places: 3; a multiple of modules = 2 "),
    ],
)
def test_a_file_that_is_no_layout_is_refused_in_one_line(tmp_path, figures, said):
    path = tmp_path / "other.toml"
    path.write_text(f"pad = [0.03, 0.02]\nfull_scale = 20_000.0\nnoise = 0.015\nbeside = 0.1\n{figures}\n")
    with pytest.raises(ConfigError, match=rf"\A[^\n]*{said}[^\n]*\Z"):
        layout_of(str(path))


def test_a_layout_whose_file_is_missing_is_refused_by_its_name():
    with pytest.raises(ConfigError, match=r"nowhere\.toml: layout cannot be read"):
        layout_of("nowhere.toml")


FOUND = SkinCalibration(
    date=date(2026, 3, 2),
    layout="parallelogram",
    point_spread=1.2e-3,
    residual=0.03,
    unmeasured=((), (3, 4)),
    left=(2.0,) * 20,
    right=tuple(np.linspace(0.9, 1.1, 20).round(4).tolist()),
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "calibration" / "skin.toml"


def test_calibration_comes_back_from_its_file(path):
    FOUND.write(path)
    assert read_calibration(path, "parallelogram") == FOUND


def test_values_are_divided_by_their_gain_and_the_rest_stays():
    skin = FakeSkin(FakeClock())
    plain = skin.read()
    plain.values[:] = 1000.0
    skin.read = lambda: plain
    frame = CalibratedSkin(skin, FOUND).read()
    assert frame.values[0] == pytest.approx(np.full(20, 500.0))
    assert frame.values[1] == pytest.approx(1000.0 / np.array(FOUND.right))
    assert (frame.stamp, frame.sequence) == (plain.stamp, plain.sequence)


def test_calibration_of_another_layout_is_refused(path):
    FOUND.write(path)
    with pytest.raises(ConfigError, match=r'layout = "parallelogram": skin\.layout = "base_to_base" wanted'):
        read_calibration(path, "base_to_base")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("point_spread = 0.0012", "point_spread = 1.2", "point_spread: Input should be less"),
        ("left = [2.0000, ", "left = [", "left: 19 gains; 20 wanted"),
        ("residual", "rest", "residual: Field required"),
    ],
)
def test_a_file_that_is_no_calibration_is_refused_in_one_line(path, old, new, said):
    FOUND.write(path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=rf"\A[^\n]*{said}[^\n]*\Z"):
        read_calibration(path, "parallelogram")
