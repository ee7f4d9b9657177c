from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import DeviceNotOpenedError, SkinSilentError
from drivers.skin.health import ERROR_COUNT, dead_groups
from drivers.skin.layout import LAYOUTS, module_of
from sim.config import SimSkinConfig
from sim.hand.pads import Pads
from sim.hand.skin import SimSkin, Taxels, as_believed
from tests.skins import ScriptedWorld, held_peg


def _skin(source, seed=0, disturb=lambda counts: counts, **keys):
    skin = SimSkin(SimSkinConfig(kind="sim", **keys), source, np.random.default_rng(seed), disturb)
    skin.open()
    return skin


def _read_after(skin, source, seconds):
    source.time += seconds
    return skin.read()


def test_reading_before_opening_is_a_fault():
    with pytest.raises(DeviceNotOpenedError):
        SimSkin(SimSkinConfig(kind="sim"), ScriptedWorld(), np.random.default_rng(0)).read()


def test_frames_come_at_the_rate_and_bear_the_time_they_were_measured_at():
    source = ScriptedWorld()
    skin = _skin(source)
    seen = [skin.read()] + [_read_after(skin, source, 0.01) for _ in range(100)]
    stamps = sorted({frame.stamp for frame in seen})
    assert stamps == pytest.approx(np.arange(11) / 10)
    assert [frame.sequence for frame in seen[::10]] == list(range(11))
    assert _read_after(skin, source, 0.31).sequence == 13  # what nobody read is lost


def test_an_unplugged_board_falls_silent_and_goes_on_once_it_is_plugged_in():
    source = ScriptedWorld()
    skin = _skin(source)
    skin.read()
    skin.is_unplugged = True
    assert _read_after(skin, source, 0.3).sequence == 0
    with pytest.raises(SkinSilentError):
        _read_after(skin, source, 0.1)
    skin.is_unplugged = False
    assert _read_after(skin, source, 0.1).sequence == 5


def test_untouched_skin_reads_signed_noise_about_zero():
    source = ScriptedWorld()
    skin = _skin(source, drift=0.0)
    values = np.array([_read_after(skin, source, 0.1).values for _ in range(200)])
    assert values.std() == pytest.approx(188.0, rel=0.05)
    assert abs(values.mean()) < 20.0


def test_skin_is_silent_when_frames_stay_out_too_long():
    source, lost = ScriptedWorld(), []
    skin = _skin(source, disturb=lambda counts: None if lost else counts)
    skin.read()
    lost.append(True)
    assert _read_after(skin, source, 0.35).stamp == 0.0
    with pytest.raises(SkinSilentError, match=r"0\.360 s > 0\.350 s"):
        _read_after(skin, source, 0.01)


def spoil(counts):
    counts[1, 7] = ERROR_COUNT
    return counts


@pytest.mark.parametrize(
    ("keys", "masked", "modules"),
    [({"disturb": spoil}, 1, 0), ({"dead_taxels": 3}, 3, 0), ({"dead_modules": 1}, 10, 1)],
)
def test_taxels_in_error_and_dead_ones_are_masked_the_same_with_each_seed(keys, masked, modules):
    one, other = (_skin(ScriptedWorld(), seed=5, **keys).read() for _ in range(2))
    assert np.count_nonzero(~one.trusted) == masked
    assert len(dead_groups(~one.trusted, module_of("parallelogram"))) == modules
    assert (one.values == other.values).all()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_touch_peaks_as_real_recordings_do(layout):
    config = SimSkinConfig(kind="sim", layout=layout)
    pads = Pads(config.pad, layout)
    peaks = [config.sensitivity * pads.pressure(held_peg(theta)).max() for theta in np.linspace(-1.4, 1.4, 15)]
    assert 7600.0 < np.median(peaks) < 20_000.0


def test_part_of_the_answer_creeps_in_and_overload_stops_at_the_rail():
    config = SimSkinConfig(kind="sim", noise=0.0, drift=0.0, gain_spread=0.0)
    taxels = Taxels(config, np.random.default_rng(0))
    pressure = np.full((2, 20), 2e5)
    readings = [float(taxels.measure(pressure, elapsed)[0, 0]) - 5000.0 for elapsed in (0.0, 5.0, 100.0)]
    assert readings == pytest.approx([9500.0, 10_000.0 - 500.0 / np.e, 10_000.0], abs=1.0)
    assert taxels.measure(np.full((2, 20), 1e8), 0.1).max() == config.health.saturation


def _true_skin(source, seed=0, **differs):
    truth = replace(as_believed("parallelogram"), **differs)
    skin = SimSkin(SimSkinConfig(kind="sim"), source, np.random.default_rng(seed), truth=truth)
    skin.open()
    return skin


def test_a_frame_is_delivered_at_its_age_and_bears_the_time_it_was_measured_at():
    source = ScriptedWorld()
    skin = _true_skin(source, age=0.035)
    first = {}
    for _ in range(60):
        frame = skin.read()
        first.setdefault(frame.sequence, (frame.stamp, source.time))
        source.time += 0.01
    assert [first[n][0] for n in range(1, 5)] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert all(0.03 <= first[n][1] - first[n][0] <= 0.06 for n in range(1, 5))


def test_each_taxel_hisses_as_loud_as_its_own_noise():
    levels = np.linspace(0.2, 4.0, 40).reshape(2, 20)
    taxels = Taxels(
        SimSkinConfig(kind="sim", drift=0.0),
        np.random.default_rng(3),
        replace(as_believed("parallelogram"), noise_level=levels),
    )
    readings = np.array([taxels.measure(np.zeros((2, 20)), 0.1) for _ in range(600)], dtype=float)
    expected = 188.0 * levels
    assert readings.std(axis=0) == pytest.approx(expected, rel=0.15)


def test_a_taxel_that_sits_elsewhere_feels_what_is_there():
    load = held_peg(0.0)
    moved = np.zeros((2, 20, 2))
    moved[..., 1] = 2e-3
    believed, misplaced = (
        Pads(SimSkinConfig(kind="sim").pad, "parallelogram", m).pressure(load) for m in (None, moved)
    )
    assert np.abs(misplaced - believed).max() > 0.1 * believed.max()


def test_a_taxel_that_died_reads_zero_like_one_that_the_config_asks_for():
    dead = np.zeros((2, 20), dtype=bool)
    dead[1, 7] = True
    taxels = Taxels(
        SimSkinConfig(kind="sim"), np.random.default_rng(3), replace(as_believed("parallelogram"), dead=dead)
    )
    reading = taxels.measure(np.zeros((2, 20)), 0.1)
    assert reading[1, 7] == 0
    assert np.count_nonzero(reading == 0) == 1
