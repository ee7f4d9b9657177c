"""A skin behind the makers' host program, which a writer of the same lines stands in for.

The form is that of file_publisher.cpp, src/cyskin_acquisition of ladylou899/ros2_ws_cyskin_project at 269ebfa: a blank
ends the first line, times have six decimals.
"""

from pathlib import Path

import numpy as np
import pytest

from drivers.errors import DeviceNotOpenedError, SkinSilentError
from drivers.skin.board_config import MODULE_CHANNELS, HostSkinConfig
from drivers.skin.boards import HostSkin
from drivers.skin.health import BASELINE_FRAMES
from drivers.skin.host_file import HostFile
from drivers.skin.recording import Recording
from tests.skins import scanned

RECORDINGS = Path(__file__).parents[5] / "shared" / "data"
SUIS = (3500, 3501, 3502, 3503)
PERIOD = 0.1


class HostProgram:
    """A Clock that writes a sample every 100 ms, as the makers' program does."""

    def __init__(self, path, suis=SUIS):
        self.path, self.time, self.is_hub_silent = path, 0.0, False
        self.touch = np.zeros(48, dtype=int)
        self._rng = np.random.default_rng(0)
        self.begin(suis)

    def begin(self, suis=SUIS):
        """Start with a new file."""
        self.uids = [sui << 4 | name for sui in suis for name in range(12)]
        self.path.write_text(" ".join(map(str, self.uids)) + " \n")
        self.number, self.is_running, self._next = 0, True, self.time + PERIOD

    def append(self, text):
        with self.path.open("a") as file:
            file.write(text)

    def now(self):
        return self.time

    def wait_until(self, stamp):
        while self.is_running and self._next <= stamp:
            self.time, self._next = self._next, self._next + PERIOD
            if not self.is_hub_silent:
                self._noise = self._rng.integers(-40, 41, len(self.uids))
            counts = 5000 + self._noise + self.touch[: len(self.uids)]
            self.append(" ".join(map(str, [self.number, f"{self.number * PERIOD:.6f}", *counts])) + "\n")
            self.number += 1
        self.time = max(self.time, stamp)


@pytest.fixture
def host(tmp_path):
    return HostProgram(tmp_path / "skin_data.txt")


@pytest.fixture
def skin(host):
    made = HostSkin(HostSkinConfig(kind="host", file=str(host.path)), host)
    yield made
    made.close()


def test_samples_are_frames_at_the_host_programs_rate(skin, host):
    skin.open()
    frames = scanned(host, skin, 2.0)
    assert frames[-1].sequence == 20
    assert skin.figures().rate == pytest.approx(10.0, rel=0.01)
    assert all(0.0 <= host.time - frame.stamp < 0.11 for frame in frames[-1:])


def test_readings_go_to_their_taxels_by_the_first_line(skin, host):
    skin.open()
    host.touch[host.uids.index(3502 << 4 | 4)] = 9000
    values = scanned(host, skin, 0.3)[-1].values
    assert np.argwhere(values > 4000.0).tolist() == [[1, 3]]
    assert skin.figures().temperature == pytest.approx(np.full(4, 5000.0), abs=40.0)


def test_what_stood_in_the_file_before_is_left_out(skin, host):
    host.touch[:] = 20_000
    host.wait_until(60.0)
    host.touch[:] = 0
    skin.open()
    assert host.time - 60.0 == pytest.approx(BASELINE_FRAMES * PERIOD, abs=0.2)
    assert np.abs(skin.read().values).max() < 200.0


def test_line_that_is_not_whole_yet_waits_for_its_rest(skin, host):
    skin.open()
    before = skin.read().sequence
    host.is_running = False
    text = " ".join(map(str, [host.number, f"{host.number * PERIOD:.6f}", *range(5000, 5048)])) + "\n"
    host.append(text[:40])
    assert scanned(host, skin, 0.05)[-1].sequence == before
    host.append(text[40:])
    assert scanned(host, skin, 0.05)[-1].sequence == before + 1


def test_lines_that_are_no_samples_are_counted_and_left_out(skin, host):
    skin.open()
    for text in ("1 2 3\n", "x\n", "7 0.1 " + "70000 " * 48 + "\n", "7 0.1 " + "-1 " * 48 + "\n"):
        host.append(text)
    assert None not in scanned(host, skin, 0.3)
    assert skin.figures().refused == 4


def test_host_program_that_stops_is_silent_and_named(skin, host):
    skin.open()
    host.is_running = False
    assert scanned(host, skin, 1.0)[-1] is None
    with pytest.raises(SkinSilentError, match=r"skin_data.txt no longer grows: check cyskin_acquisition and the hub"):
        skin.read()


def test_hub_that_falls_silent_behind_the_host_program_is_not_trusted(skin, host):
    skin.open()
    host.is_hub_silent = True
    assert not scanned(host, skin, 1.0)[-1].trusted.any()


def test_host_program_that_starts_again_is_followed(skin, host):
    skin.open()
    before = scanned(host, skin, 0.5)[-1]
    host.begin()
    assert scanned(host, skin, 0.5)[-1].sequence > before.sequence


def test_other_channels_than_before_need_a_new_opening(skin, host):
    skin.open()
    host.begin((9, 8, 7, 6))
    assert scanned(host, skin, 0.5)[-1] is None
    with pytest.raises(SkinSilentError, match="other channels than when the skin was opened"):
        skin.read()


@pytest.mark.parametrize(
    ("content", "error", "said"),
    [
        (None, DeviceNotOpenedError, "No such file or directory; start cyskin_acquisition --buffer file --filename"),
        ("CySkin\n", DeviceNotOpenedError, "first line b'CySkin.n'; the channels' numbers needed"),
        ("", SkinSilentError, "has no first line yet: check whether cyskin_acquisition found its hub"),
    ],
    ids=["missing", "another file", "no first line yet"],
)
def test_file_that_is_not_the_host_programs_is_named(skin, host, content, error, said):
    host.is_running = False
    host.path.unlink() if content is None else host.path.write_text(content)
    with pytest.raises(error, match=said):
        skin.open()


def test_module_that_the_host_program_lacks_is_not_trusted(tmp_path):
    host = HostProgram(tmp_path / "data.txt", (3500, 3501, 3503))
    config = {"kind": "host", "file": str(host.path), "board": {"kind": "cyskin", "modules": SUIS}}
    skin = HostSkin(HostSkinConfig.model_validate(config), host)
    skin.open()
    assert np.flatnonzero(~skin.read().trusted.reshape(4, 10).all(axis=1)).tolist() == [2]
    skin.close()


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason=f"no recordings at {RECORDINGS}")
def test_every_line_that_the_makers_program_wrote_is_a_scan(tmp_path):
    source, path = RECORDINGS / "cyskin_2_finger_01.txt", tmp_path / "skin_data.txt"
    recorded = Recording(source)
    modules = recorded.most_touched()
    head, *lines = source.read_text().splitlines(keepends=True)
    path.write_text(head)
    config = {"kind": "host", "file": str(path), "board": {"kind": "cyskin", "modules": modules}}
    port = HostFile(HostSkinConfig.model_validate(config))
    port.open()
    path.write_text(head + "".join(lines))
    scans = port.exchange(100.0)
    port.close()
    order = [recorded.uid.tolist().index(sui << 4 | name) for sui in modules for name in MODULE_CHANNELS]
    assert [scan.counts.ravel().tolist() for scan in scans] == recorded.counts[:, order].tolist()
    assert [scan.stamp - 100.0 for scan in scans] == pytest.approx((recorded.times - recorded.times[-1]).tolist())
