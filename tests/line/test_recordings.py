"""Recordings of a real skin, [cyskin], through the code that the live skin goes through."""

import math
from copy import copy
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from cell.config.files import ERRORS_FILE, SHIPPED
from cell.config.load import load
from drivers.quantities import TaxelFrame
from drivers.skin.health import ERROR_COUNT, SkinHealth, SkinHealthConfig, dead_groups
from drivers.skin.layout import LAYOUTS, MODULE_TAXELS
from drivers.skin.recording import RecordedSkin, Recording
from sim.config import RealityConfig, SimSkinConfig
from sim.hand.pads import PadLoad, Pads
from sim.hand.skin import Taxels, skin_truth
from sim.world.reality import read
from skills.tactile.image import ImageEstimator, ImageParams
from skills.tactile.picture import Projector
from skills.tactile.robust import RobustEstimator, RobustParams
from tests.skins import ScriptedWorld

FULL_SCALE = LAYOUTS["parallelogram"].full_scale
RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
UNTOUCHED = ["cyskin_0_finger_01.txt", "cyskin_0_finger_02.txt"]
TOUCHED = [f"cyskin_{fingers}_finger_0{number}.txt" for fingers in (1, 2) for number in (1, 2)]

pytestmark = pytest.mark.skipif(not RECORDINGS.is_dir(), reason=f"no recordings at {RECORDINGS}")


@lru_cache
def _recording(name):
    """Return module of each taxel, and frames of taxels, counts."""
    recording = Recording(RECORDINGS / name)
    return recording.module, recording.counts


def _patch_health():
    """Return the health of the patch that was recorded in 60 frames without a touch."""
    return SkinHealth(SkinHealthConfig(), np.concatenate([_recording(name)[1] for name in UNTOUCHED]), FULL_SCALE)


def _fingers(module, values, trusted):
    """Return a frame of two fingers out of the four most touched modules with ten taxels or more."""
    whole = [number for number in np.unique(module) if (module == number).sum() >= 10]
    touched = sorted(whole, key=lambda number: values[module == number].max())[-4:]
    channel = np.concatenate([np.flatnonzero(module == number)[:10] for number in touched])
    return TaxelFrame(values[channel].reshape(2, 20), trusted[channel].reshape(2, 20), 0.0, 0)


def test_dead_module_of_the_quiet_patch_is_found():
    module, frames = _recording("cyskin_quiet_patch.txt")
    silent = [number for number in np.unique(module) if not frames[:, module == number].any()]
    assert len(silent) == 1
    assert dead_groups(SkinHealth(SkinHealthConfig(), frames[:50], FULL_SCALE).dead, module) == silent


@pytest.mark.parametrize("name", TOUCHED)
def test_injected_error_counts_are_masked_and_nothing_else_is(name):
    rng, raw = np.random.default_rng(0), _recording(name)[1][10].copy()
    health, clean = _patch_health(), _patch_health()
    _, before = clean.update(raw, 1.0)
    spoiled = rng.choice(np.flatnonzero(before), 20, replace=False)
    raw[spoiled] = rng.integers(ERROR_COUNT, 65536, spoiled.size)
    values, trusted = health.update(raw, 1.0)
    assert np.flatnonzero(before & ~trusted).tolist() == sorted(spoiled.tolist())
    assert values.max() < ERROR_COUNT


@pytest.mark.parametrize("layout", LAYOUTS)
def test_touched_recordings_give_finite_poses(layout):
    for estimator in (ImageEstimator(ImageParams(), layout), RobustEstimator(RobustParams(), layout, load().cell.peg)):
        for name in TOUCHED:
            module, frames = _recording(name)
            health, made = _patch_health(), copy(estimator)
            for number, raw in enumerate(frames):
                pose = made.estimate(_fingers(module, *health.update(raw, 0.1 * number)))
                assert np.isfinite([pose.theta, pose.offset, pose.sigma, pose.residual]).all()


def test_touch_is_seen_in_the_touched_recordings_alone():
    projector = Projector("parallelogram", ImageParams().pixel, LAYOUTS["parallelogram"].full_scale)

    def brightest(name):
        module, frames = _recording(name)
        health = _patch_health()
        shown = (_fingers(module, *health.update(raw, 0.0)) for raw in frames)
        return max(projector.image(frame.values, frame.trusted).max() for frame in shown)

    assert max(map(brightest, UNTOUCHED)) < min(map(brightest, TOUCHED))


@pytest.mark.parametrize("name", [*UNTOUCHED, *TOUCHED, "cyskin_quiet_patch.txt"])
def test_a_recording_plays_as_a_skin_to_its_end(name):
    clock = ScriptedWorld()
    skin = RecordedSkin(RECORDINGS / name, clock)
    skin.open()
    times, seen = Recording(RECORDINGS / name).times, set()
    while clock.time <= times[-1] + 0.05:
        frame = skin.read()
        seen.add(frame.sequence)
        assert np.isfinite(frame.values).all()
        clock.time += 0.05
    assert len(seen) == len(times)


def test_noise_of_the_simulated_skin_lies_within_what_real_skin_shows():
    untouched = np.concatenate([_recording(name)[1] for name in UNTOUCHED]).astype(float)
    noise = np.diff(untouched, axis=0).std(axis=0) / 2**0.5
    peaks = [_recording(name)[1].max() for name in TOUCHED]
    low, high = np.median(noise) / max(peaks), np.percentile(noise, 95) / min(peaks)
    skin = SimSkinConfig(kind="sim")
    pads = Pads(skin.pad, skin.layout)
    touch = [
        skin.sensitivity * pads.pressure(PadLoad(theta, 0.0, 30.0, 0.0, 0.0, 0.05, 0.012, 0.008)).max()
        for theta in np.linspace(-1.4, 1.4, 15)
    ]
    assert low < skin.noise * skin.full_scale / np.median(touch) < high


def _hiss(name):
    """Return untouched frames of taxels that were not clipped at zero, their means taken away, counts."""
    _, frames = _recording(name)
    frames = frames[:, (frames > 0).mean(axis=0) > 0.9].astype(float)
    return frames - frames.mean(axis=0)


def _simulated_hiss(count):
    taxels, rest = Taxels(SimSkinConfig(kind="sim"), np.random.default_rng(5)), np.zeros((2, 20))
    frames = np.array([taxels.measure(rest, 0.1).ravel() for _ in range(count)], dtype=float)
    return frames - frames.mean(axis=0)


def _lag_one(frames):
    """Return the median correlation of neighbouring frames; of n white ones it is -1/n."""
    return float(np.median((frames[1:] * frames[:-1]).mean(axis=0) / (frames**2).mean(axis=0)))


def _between(frames):
    """Return the RMS correlation of two taxels over that of white ones."""
    table = np.corrcoef(frames.T)[np.triu_indices(frames.shape[1], 1)]
    return float(np.sqrt(np.mean(table**2)) * math.sqrt(len(frames)))


@pytest.mark.parametrize("name", UNTOUCHED)
def test_noise_of_both_skins_is_white_in_time_and_space(name):
    real = _hiss(name)
    simulated = _simulated_hiss(len(real))
    for frames in (real, simulated):
        assert abs(_lag_one(frames)) < 0.12
        assert 0.9 < _between(frames) < 1.15


def test_offsets_walk_as_far_in_a_hundred_seconds_as_real_ones():
    def grown(frames):
        """Return the change in 100 s over that from frame to frame, median taxel."""
        near, far = (np.sqrt(np.mean((frames[lag:] - frames[:-lag]) ** 2, axis=0)) for lag in (1, 1000))
        return float(np.median(far / near))

    _, frames = _recording("cyskin_quiet_patch.txt")
    real = frames[:, frames.mean(axis=0) > 3.0].astype(float)
    assert grown(_simulated_hiss(len(real))) == pytest.approx(grown(real), rel=0.25)


def _deviation(counts):
    """Return the standard deviation of a taxel whose recorder clips at zero, by maximum likelihood; NaN if it was nearly always clipped."""
    seen = counts[counts > 0]
    if seen.size < 6:
        return math.nan

    def unlikely(at):
        middle, deviation = at[0], math.exp(at[1])
        clipped = norm.logcdf((0.5 - middle) / deviation) * (counts.size - seen.size)
        return -norm.logpdf(seen, middle, deviation).sum() - clipped

    found = minimize(unlikely, [seen.mean(), math.log(seen.std() + 1.0)], method="Nelder-Mead")
    return math.exp(found.x[1])


@pytest.mark.parametrize("name", UNTOUCHED)
def test_drawn_noise_of_taxels_is_that_of_the_recording(name):
    module, frames = _recording(name)
    some = np.isin(module, np.unique(module)[::6])  # enough of them, and quick
    module, frames = module[some], frames[:, some]
    real = np.array([_deviation(counts) for counts in frames.T.astype(float)])
    skin, reality = SimSkinConfig(kind="sim"), read(SHIPPED / ERRORS_FILE)
    drawn = [
        skin_truth(reality.draw(seed, RealityConfig(), "parallelogram"), "parallelogram").noise_level
        for seed in range(100)
    ]
    levels = skin.noise * skin.full_scale * np.array(drawn)
    quantiles = np.nanpercentile(real, [25, 50, 75, 95])
    assert np.percentile(levels, [25, 50, 75, 95]) == pytest.approx(quantiles, rel=0.3)
    modules = [real[module == number] for number in np.unique(module)]
    within, simulated = (
        np.median([np.nanpercentile(each, 90) / np.nanpercentile(each, 10) for each in several])
        for several in ([each for each in modules if np.isfinite(each).sum() >= 8], levels.reshape(-1, MODULE_TAXELS))
    )
    assert simulated == pytest.approx(within, rel=0.2)
