"""Recordings of a real skin, [cyskin], through the code that the live skin goes through."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from drivers.quantities import TaxelFrame
from drivers.recorded_skin import RecordedSkin, Recording
from drivers.skin_health import ERROR_COUNT, SkinHealth, SkinHealthConfig, dead_groups
from drivers.skin_layout import LAYOUTS
from sim.config import SimSkinConfig
from sim.pads import PadLoad, Pads
from skills.tactile.image import ImageEstimator, ImageParams
from tests.skins import ScriptedWorld

RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
UNTOUCHED = ["cyskin_0_finger_01.txt", "cyskin_0_finger_02.txt"]
TOUCHED = [f"cyskin_{fingers}_finger_0{number}.txt" for fingers in (1, 2) for number in (1, 2)]

pytestmark = pytest.mark.skipif(not RECORDINGS.is_dir(), reason=f"no recordings at {RECORDINGS}")


@lru_cache
def _recording(name):
    """Return module of each taxel, and frames of taxels, counts; temperature channels (name 0) left out."""
    lines = (RECORDINGS / name).read_text().splitlines()
    uid = np.array(lines[0].split(), dtype=np.int64)
    frames = np.array([line.split()[2:] for line in lines[1:] if line.strip()], dtype=float)
    is_taxel = uid & 15 > 0
    return uid[is_taxel] >> 4, frames[:, is_taxel].astype(np.uint16)


def _patch_health():
    """Return the health of the patch that was recorded in 60 frames without a touch."""
    return SkinHealth(SkinHealthConfig(), np.concatenate([_recording(name)[1] for name in UNTOUCHED]))


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
    assert dead_groups(SkinHealth(SkinHealthConfig(), frames[:50]).dead, module) == silent


@pytest.mark.parametrize("name", TOUCHED)
def test_injected_error_counts_are_masked_and_nothing_else_is(name):
    _, frames = _recording(name)
    rng = np.random.default_rng(0)
    raw = frames[10].copy()
    health, clean = _patch_health(), _patch_health()
    _, before = clean.update(raw, 1.0)
    spoiled = rng.choice(np.flatnonzero(before), 20, replace=False)
    raw[spoiled] = rng.integers(ERROR_COUNT, 65536, spoiled.size)
    values, trusted = health.update(raw, 1.0)
    assert np.flatnonzero(before & ~trusted).tolist() == sorted(spoiled.tolist())
    assert values.max() < ERROR_COUNT


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", TOUCHED)
def test_touched_recording_gives_finite_poses(name, layout):
    module, frames = _recording(name)
    health, estimator = _patch_health(), ImageEstimator(ImageParams(), layout)
    for number, raw in enumerate(frames):
        pose = estimator.estimate(_fingers(module, *health.update(raw, 0.1 * number)))
        assert np.isfinite([pose.theta, pose.offset, pose.sigma, pose.residual]).all()


def test_touch_is_seen_in_the_touched_recordings_and_not_in_the_untouched():
    estimator = ImageEstimator(ImageParams(least_elongation=1.0, most_residual=1.0), "parallelogram")

    def brightest(name):
        module, frames = _recording(name)
        health = _patch_health()
        return max(estimator.image(_fingers(module, *health.update(raw, 0.0))).max() for raw in frames)

    assert max(map(brightest, UNTOUCHED)) < min(map(brightest, TOUCHED))


@pytest.mark.parametrize("name", [*UNTOUCHED, *TOUCHED, "cyskin_quiet_patch.txt"])
def test_recording_plays_as_a_skin_from_its_first_frame_to_its_last(name):
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
