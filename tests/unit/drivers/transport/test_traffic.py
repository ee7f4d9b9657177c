"""Recorded traffic is replayed bit for bit, or refused in one line."""

from pathlib import Path

import pytest

from drivers.errors import ConfigError, SkinSilentError
from drivers.skin.boards import CanSkin, SerialSkin
from drivers.transport.traffic import (
    PlaybackCan,
    PlaybackLine,
    RecordedWire,
    Recorder,
    TrafficEndedError,
    TrafficPlayback,
)
from sim.config import WireFaults
from tests.skins import WIRED, BoardRig, held_peg

OTHER_CLOCK = 1 / 3
"""Times that have no short decimal form."""


def recorded(name, path, seconds=9.0):
    """Record a skin that is touched, loses data and is unplugged for a while; return the frames."""
    rig = BoardRig(WIRED[name])
    rig.clock.wait_until(OTHER_CLOCK)
    recorder = Recorder(path, "serial" if name == "serial" else "can", rig.clock)
    rig.skin = type(rig.skin)(WIRED[name], RecordedWire(rig.link, recorder), recorder)
    recorder.open()
    rig.skin.open()
    rig.link.faults = WireFaults(drop=0.002, corrupt=0.002)
    rig.world.load = held_peg()
    frames = rig.scan(seconds / 2)
    rig.unplug(1.0)
    frames += rig.scan(seconds / 2)
    recorder.close()
    return frames


def played(name, path):
    """Return the frames that the same driver reads from the recording, and the recording."""
    is_serial = name == "serial"
    play = PlaybackLine(path, 10.0 / WIRED[name].baud_rate) if is_serial else PlaybackCan(path)
    skin = (SerialSkin if is_serial else CanSkin)(WIRED[name], play, play)
    skin.open()
    frames = []
    while True:
        try:
            play.wait_until(0.0)
        except TrafficEndedError:
            return frames, play
        try:
            frames.append(skin.read())
        except SkinSilentError:
            frames.append(None)


def told(frame):
    return frame and (frame.stamp, frame.sequence, frame.values.tobytes(), frame.trusted.tobytes())


def fresh(frames):
    """Return the report on every new frame; a port that is gone is not read, and readings are not counted."""
    return list(dict.fromkeys(told(frame) for frame in frames if frame is not None))


@pytest.mark.parametrize("name", ["can", "icub", "serial"])
def test_recorded_wire_is_played_back_bit_for_bit(name, tmp_path):
    live = recorded(name, tmp_path / "traffic")
    again, play = played(name, tmp_path / "traffic")
    assert fresh(again) == fresh(live)
    assert len(fresh(live)) > 25
    assert play.differing == 0


def test_a_recording_has_every_frame_with_its_time(tmp_path):
    path = tmp_path / "traffic"
    recorded("can", path, seconds=1.0)
    lines = path.read_text().splitlines()
    assert lines[0] == "# cell traffic 1 can"
    assert lines[1] == f"@ {OTHER_CLOCK!r}"
    assert lines[2] == "> 17FFFFFF 013b00004f6d17"
    assert any(line.startswith("< 101 ") for line in lines)


def test_recording_that_was_cut_off_plays_up_to_there(tmp_path):
    path = tmp_path / "traffic"
    whole = recorded("can", path, seconds=1.0)
    text = path.read_text()
    path.write_text(text[: text.rindex("@") + 5])
    again, _ = played("can", path)
    assert fresh(again) == fresh(whole)[: len(fresh(again))]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no recorded traffic"),
        ("# cell traffic 1 lin\n@ 1\n", "no recorded traffic"),
        ("# cell traffic 1 can\n", "no traffic in it"),
        ("# cell traffic 1 can\n@ 1.0\n< 101 zz\n@ 2.0\n", "line 3"),
        ("# cell traffic 1 can\n@ 1.0\n< zz 00\n@ 2.0\n", "line 3"),
        ("# cell traffic 1 serial\n@ 1.0\n< 101 00\n@ 2.0\n", "line 3"),
        ("# cell traffic 1 can\n< 101 00\n@ 2.0\n", "line 2"),
    ],
)
def test_a_file_that_is_no_traffic_is_refused_in_one_line(tmp_path, text, said):
    path = tmp_path / "traffic"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said):
        TrafficPlayback(path)


def test_a_recording_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="traffic cannot be written"):
        Recorder(tmp_path / "no" / "folder", "can", BoardRig(WIRED["can"]).clock).open()


def test_a_full_disk_ends_the_recording_and_not_the_skin():
    assert len(fresh(recorded("can", Path("/dev/full")))) > 25


def test_a_driver_that_sends_other_frames_is_noticed(tmp_path):
    path = tmp_path / "traffic"
    recorded("can", path, seconds=1.0)
    play = PlaybackCan(path)
    other = CanSkin(WIRED["can_hub_77"], play, play)
    with pytest.raises(SkinSilentError, match="hub 77 does not report its number of modules"):
        other.open()
    assert play.differing > 0
