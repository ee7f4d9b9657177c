"""Boards with a real driver: lost, corrupt or foreign data never become a wrong value."""

import math

import numpy as np
import pytest

from drivers.errors import DeviceNotOpenedError, SkinSilentError
from drivers.skin.boards import CanSkin, SerialSkin
from drivers.skin.health import BASELINE_FRAMES, SkinHealth, SkinHealthConfig
from drivers.skin.layout import LAYOUTS
from drivers.transport.wires import CanFrame
from sim.config import WireFaults
from tests.cyskin_makers import SENT
from tests.plc_bytes import SerialWire
from tests.skins import WIRED, BoardRig, ScriptedWorld, can_config, held_peg, serial_config

STEADY = SkinHealthConfig().model_copy(update={"drift_time": 1e5})
"""A baseline that follows nothing."""
FULL_SCALE = LAYOUTS["parallelogram"].full_scale


@pytest.fixture(params=["can", "serial"])
def rig(request):
    """Yield an opened skin on either wire."""
    made = BoardRig(WIRED[request.param])
    made.skin.open()
    return made


@pytest.mark.parametrize("name", [name for name in WIRED if name != "icub"])
def test_every_count_that_the_board_measures_comes_through(name):
    rig = BoardRig(WIRED[name].model_copy(update={"health": STEADY}))
    measured = rig.spied()
    rig.skin.open()
    rig.world.load = held_peg()
    frames = {frame.sequence: frame for frame in rig.scan(2.0)}
    raw = np.array([counts for _, counts in measured])
    first = BASELINE_FRAMES - 1
    health = SkinHealth(STEADY, raw[: first + 1], FULL_SCALE)
    wanted = [health.update(counts, 0.0) for counts in raw[first:]]
    assert len(frames) > 15
    for sequence, frame in frames.items():
        values, trusted = wanted[sequence]
        assert (frame.trusted == trusted).all()
        assert np.allclose(frame.values, values, atol=0.1)


def test_stamp_is_no_more_than_one_scan_and_the_wire_behind_the_measurement(rig):
    measured = rig.spied()
    rig.scan(0.095)
    frames = {frame.sequence: frame for frame in rig.scan(3.0)}
    first = min(frames)
    delays = [frame.stamp - measured[n - first][0] for n, frame in frames.items() if n - first < len(measured)]
    assert len(delays) > 25
    assert 0.0 < min(delays) <= max(delays) < 0.01 + 0.0015


def test_lost_messages_cost_scans_and_are_counted(rig):
    rig.link.faults = WireFaults(drop=0.01)
    frames = rig.scan(20.0)
    figures = rig.skin.figures()
    assert figures.lost > 5
    seen = {frame.sequence for frame in frames if frame is not None}
    assert len(seen) + figures.lost == pytest.approx(max(seen), abs=3)


def test_corrupt_messages_are_refused_and_no_value_is_wrong():
    """A quiet skin reads within its noise, and one wrong high byte would stand out."""
    for name in ("can", "serial"):
        rig = BoardRig(WIRED[name], noise=0.001, drift=0.0)
        rig.skin.open()
        rig.link.faults = WireFaults(corrupt=0.02)
        values = [frame.values for frame in rig.scan(60.0) if frame is not None]
        assert rig.skin.figures().refused > 20
        assert np.abs(values).max() < 200.0


@pytest.mark.parametrize("seconds", [0.5, 3.0])
def test_board_that_was_unplugged_comes_back_with_the_old_baseline(rig, seconds):
    rig.world.load = held_peg()
    before = rig.scan(1.0)[-1]
    rig.unplug(seconds)
    gone = rig.scan(seconds)
    back = rig.scan(2.0)
    assert gone[-1] is None
    assert back[-1] is not None
    assert np.corrcoef(before.values.flat, back[-1].values.flat)[0, 1] > 0.95
    assert back[-1].sequence > before.sequence


def test_a_skin_not_read_for_seconds_is_not_started_again(rig):
    for _ in range(5):
        rig.clock.wait_until(rig.clock.now() + 1.0)
        assert None not in rig.scan(1.5)
    rig.clock.wait_until(rig.clock.now() + 5.0)
    assert rig.skin.read().stamp > rig.clock.now() - 0.15


def test_a_silent_skin_is_reported_with_the_cause(rig):
    rig.unplug(10.0)
    rig.scan(1.0)
    with pytest.raises(
        SkinSilentError, match=r"no frame for 1\.\d+ s > 0\.350 s limit: .*(does not answer|no such port)"
    ):
        rig.skin.read()


def test_exchanged_modules_are_reported_until_the_skin_is_opened_again():
    rig = BoardRig(can_config())
    rig.skin.open()
    rig.hub.replace_modules((9, 8, 7, 6))
    rig.link.faults = WireFaults(resets=(rig.clock.now() + 0.05,))
    assert rig.scan(2.0)[-1] is None
    with pytest.raises(SkinSilentError, match="modules 9, 8, 7, 6 in place of 3500"):
        rig.skin.read()
    rig.skin.close()
    rig.skin.open()
    assert rig.skin.read().trusted.all()


def test_modules_are_placed_by_their_own_numbers():
    order = (40, 10, 30, 20)
    plain, mixed = BoardRig(can_config()), BoardRig(can_config(board={"kind": "cyskin", "modules": order}))
    mixed.hub.replace_modules(tuple(sorted(order)))
    for rig in (plain, mixed):
        rig.skin.open()
        rig.world.load = held_peg()
    a, b = (rig.scan(0.5)[-1].values.reshape(4, 10) for rig in (plain, mixed))
    assert np.allclose(b, a[[3, 0, 2, 1]], atol=2500.0)


def test_module_that_is_not_on_the_hub_is_not_trusted():
    rig = BoardRig(can_config(board={"kind": "cyskin", "modules": (1, 2, 3, 4)}))
    rig.hub.replace_modules((1, 2, 4))
    rig.skin.open()
    assert np.flatnonzero(~rig.skin.read().trusted.reshape(4, 10).all(axis=1)).tolist() == [2]


@pytest.mark.parametrize(
    ("dialect", "said"),
    [
        ({"crc": {"polynomial": 0x31}}, "wrong check sum: see board.wire.crc"),
        ({"byte_order": "little"}, "12 channels, mask 0xFF07; 1 to 12 channels allowed: see board.wire.byte_order"),
    ],
)
def test_wrong_dialect_is_named_by_its_key(dialect, said):
    rig = BoardRig(can_config())
    rig.skin.open()  # the board sends from now on
    rig.skin.close()
    skin = CanSkin(can_config(board={"kind": "cyskin", "wire": dialect}), rig.link, rig.clock)
    with pytest.raises(SkinSilentError, match=said):
        skin.open()


def test_bytes_without_a_frame_suggest_another_baud_rate():
    line = SerialWire()
    line.pieces = [bytes(range(1, 200))]
    with pytest.raises(SkinSilentError, match=r"199 bytes received, but no frame: check that skin\.baud_rate"):
        SerialSkin(serial_config(), line, ScriptedWorld()).open()


def test_start_up_of_a_firmware_without_boot_loaders_is_a_key():
    steps = ("discover", "set_number", "declare", "details", "start")
    rig = BoardRig(can_config(open_timeout=1.0, board={"kind": "cyskin", "wire": {"start_up": steps}}))
    rig.link.write(SENT[0])
    rig.clock.wait_until(0.1)
    rig.hub.are_modules_in_boot_loaders = False
    rig.skin.open()
    assert rig.skin.read().trusted.all()


def second_hub(link):
    """Let another hub answer the discovery too."""
    real = link.board.take

    def take(item, at):
        other = CanFrame(0x5FF, bytes.fromhex("10040000000981"))
        return [*real(item, at), other] if item.data[:1] == b"\x10" else real(item, at)

    link.board.take = take


def kept_in_boot_loaders(link):
    """Lose the frame by which modules leave their boot loaders."""
    real = link.write
    link.write = lambda frame: None if frame.data[0] == 0x31 else real(frame)


def unplugged(link):
    link.faults = link.faults.model_copy(update={"unplugged": ((0.0, 100.0),)})


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (second_hub, "is one of 2 on the bus, uid 00000009, 12345678: one allowed"),
        (kept_in_boot_loaders, "hub 1 has modules that have not left their boot loaders: check their plugs"),
        (unplugged, "hub 1 does not answer"),
    ],
)
def test_what_keeps_a_hub_from_starting_is_named_in_time(spoil, words):
    rig = BoardRig(can_config(open_timeout=2.0))
    spoil(rig.link)
    with pytest.raises(SkinSilentError, match=words):
        rig.skin.open()
    assert rig.clock.now() == pytest.approx(2.0, abs=0.02)


def test_skin_that_could_not_be_opened_can_be_opened_later(rig):
    rig.skin.close()
    rig.unplug(5.0)
    with pytest.raises((SkinSilentError, DeviceNotOpenedError)):
        rig.skin.open()
    rig.clock.wait_until(rig.clock.now() + 5.0)
    rig.skin.open()
    assert rig.skin.read().sequence == 0


def test_a_skin_that_is_not_open_has_no_readings_and_figures():
    skin = BoardRig(can_config()).skin
    with pytest.raises(DeviceNotOpenedError, match="read before it was opened"):
        skin.read()
    figures = skin.figures()
    assert (figures.scans, figures.lost, figures.age) == (0, 0, math.inf)
    assert math.isnan(figures.rate)


@pytest.mark.parametrize("number", range(len(SENT)))
def test_any_frame_lost_during_the_start_is_sent_again(number):
    rig, sent = BoardRig(can_config(open_timeout=6.0)), []
    real = rig.link.write

    def write(frame):
        sent.append(frame)
        if len(sent) != number + 1:
            real(frame)

    rig.link.write = write
    rig.skin.open()
    rig.scan(6.0)
    assert len(sent) >= len(SENT)
    assert rig.skin.figures().rate == pytest.approx(10.0, rel=0.05)


def test_a_pause_of_the_reader_is_no_silence_of_the_board(rig):
    rig.skin.open()
    rig.unplug(20.0)
    rig.clock.wait_until(rig.clock.now() + 19.9)
    before = rig.skin.read()
    rig.clock.wait_until(rig.clock.now() + 0.3)
    assert rig.skin.read().sequence == before.sequence
    rig.clock.wait_until(rig.clock.now() + 5.0)
    rig.unplug(5.0)
    assert rig.scan(0.3)[-1] is not None
    assert rig.scan(0.3)[-1] is None


def test_a_board_with_other_taxels_than_the_layout_is_not_opened(tmp_path):
    path = tmp_path / "three.toml"
    path.write_text(
        "places = [[0.0, 0.0], [0.0, 0.007], [0.007, 0.0]]\npad = [0.03, 0.02]\nfull_scale = 20_000.0\nnoise = 0.015\nbeside = 0.1\n"
    )
    config = WIRED["can"]
    rig = BoardRig(config)
    skin = CanSkin(config.model_copy(update={"layout": str(path)}), rig.link, rig.clock)
    with pytest.raises(DeviceNotOpenedError, match=r"skin: 40 taxels read; 6 in skin\.layout = .*: name the layout"):
        skin.open()
