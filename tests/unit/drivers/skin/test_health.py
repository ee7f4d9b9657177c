"""Taxels that measure nothing are masked, and the baseline follows drift, not touch."""

import numpy as np
import pytest

from drivers.errors import SkinUntrustedError
from drivers.quantities import TaxelFrame
from drivers.skin.health import ERROR_COUNT, SkinHealth, SkinHealthConfig, require_trust

CONFIG = SkinHealthConfig().model_copy(update={"stuck_frames": 10, "drift_time": 10.0})
TAXELS = 8
FULL_SCALE = 20_000.0


def _still(seed=0, frames=50, noise=300.0, taxels=TAXELS):
    rng = np.random.default_rng(seed)
    return np.rint(5000.0 + noise * rng.standard_normal((frames, taxels))).astype(np.uint16)


def _health(still=None):
    return SkinHealth(CONFIG, _still() if still is None else still, FULL_SCALE)


def test_too_short_a_baseline_is_refused():
    with pytest.raises(ValueError, match="49 frames < 50 frames"):
        _health(_still(frames=49))


def test_dead_and_stuck_taxels_are_masked_from_the_start():
    still = _still()
    still[:, 3], still[:, 4], still[:, 2] = 0, 1, 4711
    health = _health(still)
    assert (np.flatnonzero(health.dead).tolist(), np.flatnonzero(health.stuck).tolist()) == ([3], [2, 4])
    assert np.flatnonzero(~health.update(_still(1)[0], 0.1)[1]).tolist() == [2, 3, 4]


@pytest.mark.parametrize(
    ("count", "is_trusted"),
    [(CONFIG.saturation - 1, True), (CONFIG.saturation, False), (ERROR_COUNT, False), (65535, False)],
)
def test_a_reading_is_masked_from_the_rail_on(count, is_trusted):
    raw = _still(1)[0]
    raw[5] = count
    values, trusted = _health().update(raw, 0.1)
    assert trusted[5] == is_trusted
    assert (values[5] == 0.0) != is_trusted


@pytest.mark.parametrize(("is_of_baseline", "limit"), [(False, CONFIG.stuck_frames), (True, CONFIG.stuck_frames - 1)])
def test_a_taxel_that_stands_still_while_running_is_masked_at_the_limit(is_of_baseline, limit):
    """Equal readings count from the last frame of the baseline on."""
    still, told = _still(), []
    health = _health(still)
    for raw in _still(1)[:limit]:
        raw[4] = still[-1, 4] if is_of_baseline else 9000
        told.append(bool(health.update(raw, 0.1)[1][4]))
    assert told == [True] * (limit - 1) + [False]


@pytest.mark.parametrize(("frames", "is_trusted"), [(CONFIG.frozen_frames - 1, True), (CONFIG.frozen_frames, False)])
def test_no_taxel_of_a_frozen_frame_is_trusted_at_the_limit(frames, is_trusted):
    health, frozen = _health(), _still(1)[0]
    for _ in range(frames):
        _, trusted = health.update(frozen, 0.1)
    assert trusted.any() == trusted.all() == is_trusted


@pytest.mark.parametrize(("count", "frames"), [(5000, 8), (ERROR_COUNT, 1)], ids=["frozen", "in error"])
def test_a_skin_is_trusted_again_once_it_measures(count, frames):
    health, (wrong, fresh) = _health(), _still(1)[:2]
    wrong[5] = count
    for raw in [wrong] * frames + [fresh]:
        _, trusted = health.update(raw, 0.1)
    assert trusted.all()


def test_the_baseline_follows_drift_between_long_grips():
    """Forty parts, each in the hand for 20 s, with 5 s of an open hand before the next; noise and drift as in [cyskin]."""
    rng, noise, period = np.random.default_rng(7), 200.0, 0.1
    offset, stamp = np.full(TAXELS, 5000.0), 0.0
    health = SkinHealth(SkinHealthConfig(), _still(noise=noise), FULL_SCALE)
    behind = []
    for _ in range(40):
        for load in [8000.0] * 200 + [0.0] * 50:
            stamp += period
            offset += 0.11 * noise * np.sqrt(period) * rng.standard_normal(TAXELS)
            raw = np.rint(offset + load + noise * rng.standard_normal(TAXELS))
            health.update(raw.astype(np.uint16), stamp)
        behind.append(health.baseline - offset)
    assert np.std(behind[10:]) < 0.4 * noise


def test_drift_during_a_grip_does_not_stop_the_baseline():
    rng, still = np.random.default_rng(1), _still()
    still[:, 0] = 5000 + rng.integers(-20, 21, len(still))
    health = _health(still)
    for frame in range(1000):
        raw = 5000 + 300 * rng.standard_normal(TAXELS)
        raw[0] = 5200 + rng.integers(-20, 21)
        raw[1] += 8000 * (frame < 200)  # for 20 s a peg is in the hand
        health.update(np.rint(raw).astype(np.uint16), 0.1 * frame)
    assert health.baseline[0] == pytest.approx(5200.0, abs=20.0)


def test_a_skin_that_is_wholly_trusted_is_given_back():
    frame = TaxelFrame(np.zeros((2, 20)), np.ones((2, 20), dtype=bool), 0.0, 1)
    assert require_trust(frame, "parallelogram") is frame


def test_dead_modules_and_single_taxels_are_named():
    trusted = np.ones((2, 20), dtype=bool)
    trusted[1, 10:] = trusted[0, [3, 7]] = False
    with pytest.raises(SkinUntrustedError) as told:
        require_trust(TaxelFrame(np.zeros((2, 20)), trusted, 0.0, 1), "parallelogram")
    assert str(told.value) == (
        "skin: right finger, module 1 (taxels 10 to 19): dead; check its plug, or change the finger; "
        "left finger, taxels 3, 7: dead, stuck, saturated or in error"
    )


@pytest.mark.parametrize(
    ("at_rail", "is_usable"),
    [(slice(24), True), (slice(25), False), (slice(0, None, 3), True), (slice(1, None), False), (slice(50), False)],
    ids=["less than half", "half", "every third", "all but one", "all"],
)
def test_readings_at_the_rail_are_left_out_of_the_baseline(at_rail, is_usable):
    still = _still()
    before = still[:, 2].astype(float)
    still[at_rail, 2] = CONFIG.saturation
    valid = before[still[:, 2] < CONFIG.saturation]
    health = _health(still)
    assert health.usable[2] == is_usable
    expected = (valid.mean(), valid.std()) if valid.size else (0.0, 0.0)
    assert (health.baseline[2], health.noise[2]) == pytest.approx(expected, abs=1e-6)


def test_the_baseline_does_not_follow_a_faint_print():
    """A third of the taxels at three times their noise is the print of a grip of 10 N."""
    health, pressed = _health(_still(taxels=40)), 900.0 * (np.arange(40) % 3 == 0)
    before = health.baseline.copy()
    for number, raw in enumerate(_still(1, frames=100, taxels=40)):
        health.update((raw + pressed).astype(np.uint16), 0.1 * number)
    assert np.abs(health.baseline - before).max() < 100.0


@pytest.mark.parametrize(
    ("later", "share"),
    [(100.0, 0.0), (100.5, 0.05), (200.0, 1.0), (99.0, 0.0)],
    ids=["at once", "soon", "late", "older"],
)
def test_the_baseline_follows_by_the_share_of_the_time_that_has_passed(later, share):
    health = _health()
    before, (first, second) = health.baseline.copy(), _still(1)[:2]
    health.update(first, 100.0)
    health.update(second, later)
    assert health.baseline == pytest.approx(before + share * (second - before))


def even(level):
    """Return the health of four taxels that read a count above and below `level` in turn; a touch of each is 50 counts."""
    still = np.full((50, 4), level - 1, dtype=np.uint16)
    still[::2] += 2
    return SkinHealth(SkinHealthConfig(), still, FULL_SCALE)


def follows(health, above):
    """Return True if the baseline follows a skin that reads so many counts above it."""
    before = health.baseline.copy()
    for stamp in (10.0, 11.0):
        health.update(np.rint(before + np.array(above)).astype(np.uint16), stamp)
    return bool((health.baseline != before).any())


@pytest.mark.parametrize(
    ("level", "raw", "trusted"),
    [
        (5000, (5001, 0, 4000, 5000), [True, False, True, True]),
        (50, (0, 49, 51, 50), [True] * 4),
        (51, (0, 50, 52, 51), [False, True, True, True]),
        (1, (0, 0, 0, 0), [True] * 4),
    ],
)
def test_zero_is_a_measurement_only_within_a_touch_of_the_baseline(level, raw, trusted):
    """Recordings have their baseline removed already."""
    assert even(level).update(np.array(raw, dtype=np.uint16), 1.0)[1].tolist() == trusted


@pytest.mark.parametrize(
    ("above", "is_followed"),
    [
        ((50, -50, 0, 0), True),
        ((51, -50, 0, 0), False),
        ((50, -51, 0, 0), False),
        ((0, 38, 0, 38), True),
        ((0, 39, 0, 38), False),
        ((10, 38, 10, 38), True),
        ((10, 39, 10, 38), False),
    ],
)
def test_the_baseline_follows_up_to_a_touch_of_one_or_all_taxels(above, is_followed):
    assert follows(even(5000), above) is is_followed


def test_untrusted_taxels_do_not_hide_a_print_of_the_others():
    still = _still(taxels=40)
    still[:, 10:] = 0
    health = _health(still)
    assert not follows(health, 4.0 * health.noise * (np.arange(40) % 2))
