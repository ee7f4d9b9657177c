from datetime import date

import numpy as np
import pytest

from drivers.errors import ConfigError
from drivers.skin.calibration import CalibratedSkin, SkinCalibration, read_calibration
from tests.fakes import FakeClock, FakeSkin

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
        ("date = ", "date ", "not TOML"),
    ],
)
def test_file_that_is_no_calibration_is_told_in_one_line(path, old, new, said):
    FOUND.write(path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=said) as caught:
        read_calibration(path, "parallelogram")
    assert "\n" not in str(caught.value)


def test_missing_file_is_told(path):
    with pytest.raises(ConfigError, match="cannot be read"):
        read_calibration(path, "parallelogram")


def test_place_that_cannot_be_written_is_told(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(ConfigError, match="cannot be written"):
        FOUND.write(file / "skin.toml")
