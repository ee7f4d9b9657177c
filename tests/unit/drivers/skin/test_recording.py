"""Frames of a recording are replayed at their recorded times; a wrong file is refused in one line."""

import numpy as np
import pytest

from drivers.errors import ConfigError, DeviceNotOpenedError, SkinSilentError
from drivers.skin.health import ERROR_COUNT
from drivers.skin.recording import RecordedSkin
from tests.skins import ScriptedWorld

SUIS = (100, 200, 300, 400, 500)


@pytest.fixture
def path(tmp_path):
    """Write five modules of 12 channels, 20 frames at 10 Hz; module 500 is never touched, one taxel is dead."""
    uid = [sui << 4 | name for sui in SUIS for name in range(12)]
    rows = []
    for number in range(20):
        counts = [0 if sui == 500 else sui + 10 * name + number for sui in SUIS for name in range(12)]
        counts[uid.index(200 << 4 | 3)] = 0
        rows.append([number, f"{5 + 0.1 * number:.6f}", *counts])
    rows[4][2 + uid.index(300 << 4 | 1)] = ERROR_COUNT
    file = tmp_path / "patch.txt"
    file.write_text("\n".join(" ".join(map(str, row)) for row in [uid, *rows]))
    return file


def _opened(path):
    clock = ScriptedWorld()
    skin = RecordedSkin(path, clock)
    skin.open()
    return skin, clock


def test_frames_come_when_they_were_recorded(path):
    skin, clock = _opened(path)
    for number in range(20):
        clock.time = 0.1 * number + 0.05
        frame = skin.read()
        assert (frame.sequence, frame.stamp) == (number, pytest.approx(0.1 * number))


def test_most_touched_modules_become_the_fingers_without_temperatures(path):
    values = _opened(path)[0].read().values.reshape(4, 10)
    assert values[0].tolist() == [100 + 10 * name for name in (1, 2, 3, 4, 9, 10, 5, 8, 6, 7)]
    assert values[3, 0] == 410


def test_dead_taxels_and_error_marks_are_masked(path):
    skin, clock = _opened(path)
    assert np.argwhere(~skin.read().trusted).tolist() == [[0, 12]]
    clock.time = 0.41
    assert np.argwhere(~skin.read().trusted).tolist() == [[0, 12], [1, 0]]


def test_recording_that_has_not_begun_or_has_ended_cannot_be_read(path):
    with pytest.raises(DeviceNotOpenedError):
        RecordedSkin(path, ScriptedWorld()).read()
    skin, clock = _opened(path)
    clock.time = 2.3
    with pytest.raises(SkinSilentError, match="has ended"):
        skin.read()


@pytest.mark.parametrize("text", ["", "1 2 3", "1 2 3\n0 0.0 1 2", "a b\n0 0.1 1 2", "1 2\n0 0.1 1 x"])
def test_a_file_that_is_no_recording_is_refused_in_one_line(tmp_path, text):
    file = tmp_path / "patch.txt"
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"patch\.txt: no recording"):
        _opened(file)


def test_missing_file_and_missing_modules_are_named(path):
    with pytest.raises(ConfigError, match="cannot be read"):
        _opened(path.with_name("other.txt"))
    uid, *rows = (line.split() for line in path.read_text().splitlines())
    path.write_text("\n".join(map(" ".join, [uid[:36], *(row[:38] for row in rows)])))
    with pytest.raises(ConfigError, match=r"4 modules with 10 taxels needed, not \[100, 200, 300\]"):
        _opened(path)
