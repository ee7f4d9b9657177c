"""The stand-in's skin: its pads, its taxels and its frames."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import DeviceNotOpenedError, SkinSilentError
from drivers.skin.health import ERROR_COUNT, dead_groups
from drivers.skin.layout import LAYOUTS, module_of
from sim.config import PadConfig, SimSkinConfig
from sim.hand.grip_limits import grip_limits
from sim.hand.pads import PadLoad, Pads, contact_span, taxel_weights
from sim.hand.skin import SimSkin, Taxels, as_believed
from tests.skins import ScriptedWorld, held_peg

LENGTH, WIDTH = 0.040, 0.026
AT_REST = PadLoad(0.0, 0.0, 30.0, 0.0, 0.0, 0.05, 0.02, 0.008)
PUSHED = replace(AT_REST, across=5.7, tilting=0.285)


def _sums(load, exponent=1.0):
    """Return load and moment of each pad, integrated along the contact."""
    config = PadConfig(exponent=exponent)
    pads = Pads(config, "parallelogram")
    pressing = pads.press(load)
    s = np.linspace(pressing.low, pressing.high, 4001)
    # Depth of the peg in the left pad and in the right one; load of a pad k t (x^n + x² / (1 - x)), x = depth / t.
    shares = [
        np.maximum(pressing.delta0 + side * (pressing.u + pressing.phi * s), 0.0) / config.thickness for side in (1, -1)
    ]
    loads = [config.stiffness / pads.length * config.thickness * (x**exponent + x**2 / (1.0 - x)) for x in shares]
    return [np.trapezoid(q, s) for q in loads], [np.trapezoid(q * s, s) for q in loads]


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5])
@pytest.mark.parametrize("theta", [-1.2, 0.0, 0.7])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_pads_balance_the_push(exponent, theta, sign):
    load = replace(PUSHED, theta=theta, across=sign * PUSHED.across, tilting=sign * PUSHED.tilting)
    (left, right), (left_moment, right_moment) = _sums(load, exponent)
    assert left - right == pytest.approx(load.across, abs=0.03)
    assert left_moment - right_moment == pytest.approx(load.tilting, rel=0.01)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5])
def test_each_pad_bears_the_grip_by_its_exponent(exponent):
    assert _sums(AT_REST, exponent)[0] == pytest.approx([30.0, 30.0], rel=1e-3)


def test_fingers_held_at_their_width_bear_more_together_under_a_push():
    sums, _ = _sums(PUSHED)
    assert sum(sums) > 63.0


@pytest.mark.parametrize("exponent", [0.5, 1.5])
def test_taxels_under_a_pad_of_another_law_see_the_whole_grip(exponent):
    seen = [Pads(PadConfig(exponent=law), "parallelogram").pressure(AT_REST).sum() for law in (exponent, 1.0)]
    assert seen[0] == pytest.approx(seen[1], rel=0.1)


def test_pads_do_not_pull():
    pressing = Pads(PadConfig(), "parallelogram").press(replace(AT_REST, grip_force=4.0, tilting=0.15))
    right = [pressing.delta0 - pressing.u - pressing.phi * s for s in (pressing.low, pressing.high)]
    assert min(right) < 0.0 < max(right)


def test_a_peg_beside_the_pad_presses_nothing_and_an_endless_push_finitely():
    pads = Pads(PadConfig(), "base_to_base")
    assert not pads.pressure(replace(AT_REST, offset=0.05)).any()
    assert np.isfinite(pads.pressure(replace(AT_REST, across=500.0, tilting=-90.0))).all()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_mirroring_the_load_about_the_finger_axis_swaps_the_fingers(layout):
    load = replace(PUSHED, theta=0.5, offset=1e-3)
    mirrored = replace(load, theta=-0.5, offset=-1e-3, across=-load.across, tilting=-load.tilting)
    pads = Pads(PadConfig(), layout)
    assert pads.pressure(mirrored) == pytest.approx(pads.pressure(load)[::-1], rel=1e-6, abs=1.0)


def test_wide_flat_pressure_reaches_a_taxel_undiminished():
    _, weights = taxel_weights("base_to_base", 1.2e-3, 4e-3)
    assert weights.sum(axis=-1).max() == pytest.approx(1.0, abs=0.01)


def breakaway_torque(load, friction):
    """Return the torque about the closing axis above which the peg turns in the pads, N·m."""
    ends, pad = (load.reach_tip, load.reach_back), (LENGTH / 2, WIDTH / 2)
    width = load.width if load.is_flat else 0.0
    return grip_limits(load.theta, load.offset, load.grip_force, ends, pad, friction, width).torque


@pytest.mark.parametrize("theta", [0.0, 0.6, 1.5])
@pytest.mark.parametrize("offset", [0.0, 2e-3])
def test_breakaway_torque_is_the_mean_lever_about_the_middle_of_the_contact(theta, offset):
    load = replace(AT_REST, theta=theta, offset=offset, reach_back=0.008)
    s = np.linspace(*contact_span(load, LENGTH, WIDTH), 20001)
    lever = np.trapezoid(np.abs(s - s.mean()), s) / (s[-1] - s[0])
    assert breakaway_torque(load, 0.8) == pytest.approx(2 * 0.8 * 30.0 * lever, rel=1e-4)


ACROSS = WIDTH / 2 / math.sin(math.radians(75.0))
"""Half of the length of a line across the pad at 75 degrees, m."""


@pytest.mark.parametrize(
    ("load", "low", "high"),
    [(replace(AT_REST, theta=math.radians(75.0)), -ACROSS, ACROSS), (replace(AT_REST, reach_back=0.005), -0.005, 0.02)],
    ids=["sides of the pad", "end of the peg"],
)
def test_contact_ends_with_the_pad_or_the_peg(load, low, high):
    assert contact_span(load, LENGTH, WIDTH) == pytest.approx((low, high))


def test_a_flat_face_presses_evenly_with_the_grip():
    pads = Pads(PadConfig(), "parallelogram")
    flat = replace(AT_REST, theta=0.4, reach_tip=0.012, reach_back=0.012, is_flat=True)
    round_ = replace(flat, is_flat=False)
    # What all taxels see together is the load, where none of it lies at the pad's edge.
    assert pads.pressure(flat).sum(axis=1) == pytest.approx(pads.pressure(round_).sum(axis=1), rel=0.12)
    assert pads.pressure(flat).max() < 0.8 * pads.pressure(round_).max()


@pytest.mark.parametrize("theta", [0.0, 0.5, 1.2])
def test_a_flat_face_turns_in_the_pads_where_friction_over_it_says(theta):
    flat = replace(AT_REST, theta=theta, is_flat=True)
    x, y = np.meshgrid(np.linspace(-LENGTH / 2, LENGTH / 2, 801), np.linspace(-WIDTH / 2, WIDTH / 2, 521))
    along, beside = x * math.cos(theta) + y * math.sin(theta), y * math.cos(theta) - x * math.sin(theta)
    under = (np.abs(beside) < 0.004) & (along < flat.reach_tip) & (along > -flat.reach_back)
    expected = 2.0 * 0.5 * flat.grip_force * np.hypot(x, y)[under].mean()
    assert breakaway_torque(flat, 0.5) == pytest.approx(expected, rel=0.02)


COMPILED = """
from sim.config import PadConfig
from sim.hand.pad_solver import lie, spread
from sim.hand.pads import PadLoad, Pads
pads = Pads(PadConfig(), "parallelogram")
before = len(lie.signatures), len(spread.signatures)
pads.pressure(PadLoad(0.3, 1e-3, 30.0, 5.7, 0.285, 0.05, 0.02, 0.008, is_flat=True))
print(before == (len(lie.signatures), len(spread.signatures)) and min(before) > 0)
"""


def test_pads_are_compiled_before_they_are_touched():
    """Otherwise a cell stands still for seconds in the middle of its first run, and takes its PLC for lost."""
    command = [sys.executable, "-c", COMPILED]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "True"


BELIEVED = as_believed("parallelogram")


def _skin(source, seed=0, disturb=lambda counts: counts, truth=None, **keys):
    skin = SimSkin(SimSkinConfig(kind="sim", **keys), source, np.random.default_rng(seed), disturb, truth=truth)
    skin.open()
    return skin


def _read_after(skin, source, seconds):
    source.time += seconds
    return skin.read()


def test_reading_before_opening_is_a_fault():
    with pytest.raises(DeviceNotOpenedError):
        SimSkin(SimSkinConfig(kind="sim"), ScriptedWorld(), np.random.default_rng(0)).read()


def test_an_unplugged_board_is_silent_until_it_is_plugged_in():
    source = ScriptedWorld()
    skin = _skin(source)
    skin.read()
    skin.is_unplugged = True
    assert _read_after(skin, source, 0.3).sequence == 0
    with pytest.raises(SkinSilentError):
        _read_after(skin, source, 0.1)
    skin.is_unplugged = False
    assert _read_after(skin, source, 0.1).sequence == 5


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


DIED = replace(BELIEVED, dead=np.arange(40).reshape(2, 20) == 27)


@pytest.mark.parametrize(
    ("keys", "masked", "modules"),
    [({"disturb": spoil}, 1, 0), ({"dead_taxels": 3}, 3, 0), ({"dead_modules": 1}, 10, 1), ({"truth": DIED}, 1, 0)],
)
def test_taxels_in_error_and_dead_ones_are_masked(keys, masked, modules):
    """Another skin from the same seed reads the same."""
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


def test_a_taxel_answers_in_proportion_and_overload_stops_at_the_rail():
    config = SimSkinConfig(kind="sim", noise=0.0, drift=0.0, gain_spread=0.0)
    taxels = Taxels(config, np.random.default_rng(0))
    readings = [float(taxels.measure(np.full((2, 20), pressure), 0.1)[0, 0]) - 5000.0 for pressure in (1e5, 2e5)]
    assert readings == pytest.approx([5000.0, 10_000.0])
    assert taxels.measure(np.full((2, 20), 1e8), 0.1).max() == config.health.saturation


def test_a_frame_comes_at_its_age_with_its_time_of_measurement():
    source = ScriptedWorld()
    skin = _skin(source, truth=replace(BELIEVED, age=0.035))
    first = {}
    for _ in range(60):
        frame = skin.read()
        first.setdefault(frame.sequence, (frame.stamp, source.time))
        source.time += 0.01
    assert [first[n][0] for n in range(1, 5)] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert all(0.03 <= first[n][1] - first[n][0] <= 0.06 for n in range(1, 5))


def test_each_taxel_hisses_as_loud_as_its_own_noise():
    levels = np.linspace(0.2, 4.0, 40).reshape(2, 20)
    config, truth = SimSkinConfig(kind="sim", drift=0.0), replace(BELIEVED, noise_level=levels)
    taxels = Taxels(config, np.random.default_rng(3), truth)
    readings = np.array([taxels.measure(np.zeros((2, 20)), 0.1) for _ in range(600)], dtype=float)
    assert readings.std(axis=0) == pytest.approx(188.0 * levels, rel=0.15)


def test_a_taxel_that_sits_elsewhere_feels_what_is_there():
    load = held_peg(0.0)
    moved = np.zeros((2, 20, 2))
    moved[..., 1] = 2e-3
    believed, misplaced = (Pads(PadConfig(), "parallelogram", places).pressure(load) for places in (None, moved))
    assert np.abs(misplaced - believed).max() > 0.1 * believed.max()
