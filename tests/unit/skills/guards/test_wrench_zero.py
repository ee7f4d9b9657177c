"""The wrench is zeroed by what is read in free air, and what its noise may do to a threshold is known."""

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import WrenchOffsetError, WrenchReversedError
from drivers.quantities import Wrench
from skills.guards.wrench_zero import GUARD, SCANS, WrenchConfig, WrenchZero, zero_of
from skills.search.feel import Bearing
from tests.fakes import FakeArm, FakeClock, FakeGripper, context_of

CONFIG = WrenchConfig()
PUSH = 6.0
TOUCHED = 0.5
"""Share of the push above which the plate counts as bearing it."""


def readings(offset, noise=0.0, seed=1, drift=0.0):
    """Return what an arm reports at rest, with a force along z that comes on in the second half."""
    rng = np.random.default_rng(seed)
    late = [np.array([0.0, 0.0, drift if k >= SCANS // 2 else 0.0]) for k in range(SCANS)]
    return [Wrench(np.array(offset) + more + noise * rng.standard_normal(3), np.ones(3)) for more in late]


def test_offset_and_noise_are_those_of_the_readings():
    zero = zero_of(readings([4.0, -5.0, 3.0], noise=2.0), CONFIG)
    np.testing.assert_allclose(zero.force, [4.0, -5.0, 3.0], atol=3.0 * 2.0 / np.sqrt(SCANS))
    assert zero.noise == pytest.approx(2.0, rel=0.3)


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (readings([0.0, 0.0, CONFIG.offset + 0.1]), r"35 N reported in free air; wrench\.offset = 35 N allowed"),
        (readings([0.0, 0.0, 0.0], noise=2.0 * CONFIG.noise), "force scatters by"),
        (readings([1.0, 0.0, 0.0], noise=0.5, drift=6.0), "something touches it"),
    ],
    ids=["offset", "noise", "touch meanwhile"],
)
def test_what_no_arm_reports_in_free_air_is_refused(told, words):
    with pytest.raises(WrenchOffsetError, match=words):
        zero_of(told, CONFIG)


def test_offsets_up_to_the_limit_and_noise_are_borne():
    zero_of(readings([0.0, 0.0, CONFIG.offset - 0.1]), CONFIG)
    for seed in range(300):
        zero_of(readings([1.0, 0.0, 0.0], noise=2.0, seed=seed), CONFIG)


def test_a_zeroed_cell_reads_only_what_touches_later():
    arm = FakeArm(FakeClock())
    ctx = context_of(load().cell, arm, FakeGripper(0.008))
    arm.force = np.array([3.0, -4.0, 5.0])
    for _ in ctx.scan(0.3):
        pass
    ctx.wrench.set_zero()
    np.testing.assert_allclose(ctx.observe().arm.wrench.force, 0.0, atol=1e-12)
    arm.force = np.array([3.0, -4.0, 11.0])
    np.testing.assert_allclose(ctx.observe().arm.wrench.force, [0.0, 0.0, 6.0], atol=1e-12)


def borne(forces, noise=0.0):
    """Return whether the plate was taken to bear the push at any of these forces along z, N, one a scan."""
    bearing = Bearing(TOUCHED, WrenchZero(noise=noise), 0.01)
    return max([bearing.after(force, PUSH) for force in forces])


def test_a_push_is_felt_through_noise_and_noise_alone_is_no_push():
    for seed in range(200):
        hiss = 2.0 * np.random.default_rng(seed).standard_normal(40)
        assert borne(PUSH + hiss, noise=2.0)
        assert not borne(hiss, noise=2.0)


def test_a_blow_is_no_push():
    assert not borne([0.0] * 5 + [20.0] + [0.0] * 20)
    assert borne([0.0] * 5 + [1.1 * TOUCHED * PUSH] * 10)


def test_only_a_force_along_the_push_is_a_reversed_one():
    zero = WrenchZero(noise=0.5)
    zero.require_sense([-0.99 * PUSH] * 10, PUSH)
    zero.require_sense([PUSH] * 10, PUSH)
    with pytest.raises(WrenchReversedError, match="reports 6 N downwards while it presses down"):
        zero.require_sense([-1.01 * PUSH] * 10, PUSH)


def test_the_guard_holds_a_threshold_above_what_noise_alone_reaches():
    zero = WrenchZero(noise=3.0)
    assert zero.guarded(1.0, 9) == pytest.approx(GUARD)
    assert zero.guarded(10.0, 9) == 10.0
