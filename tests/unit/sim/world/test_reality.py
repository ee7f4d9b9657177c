"""The errors of a trial's cell are drawn from its seed, by name, with the distributions in the file."""

from pathlib import Path

import numpy as np
import pytest

from cell.config.files import ERRORS_FILE
from cell.config.files import SHIPPED as SHIPPED_FILES
from drivers.errors import ConfigError
from sim.config import RealityConfig
from sim.world.reality import KINDS, Reality, read, recorded

SHIPPED = read(SHIPPED_FILES / ERRORS_FILE)
ONE = """
[arm.gravity]
about = "Torque by which the compensation errs"
unit = "N·m"
distribution = "normal"
sigma = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
basis = "assumed"
source = "A test that needs a figure"
"""


def many(name: str, **config: object) -> np.ndarray:
    return np.array([SHIPPED.draw(seed, RealityConfig(alone=name, **config))[name] for seed in range(400)])


def test_scale_0_is_ideal_and_a_seed_draws_one_cell():
    believed, one, other = (SHIPPED.draw(11, RealityConfig(scale=scale)) for scale in (0.0, 1.0, 1.0))
    assert all(np.all(believed[name] == kind.ideal) for name, kind in KINDS.items())
    assert all(np.array_equal(one[name], other[name]) for name in KINDS)


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if not kind.part_of])
def test_an_error_alone_is_drawn_as_among_the_others(name):
    drawn, together = SHIPPED.draw(5, RealityConfig(alone=name)), SHIPPED.draw(5, RealityConfig())
    assert np.array_equal(drawn[name], together[name])
    others = [other for other in KINDS if name not in (other, KINDS[other].part_of)]
    assert all(np.all(drawn[other] == KINDS[other].ideal) for other in others)


def test_late_scans_alone_are_drawn_with_their_delay():
    drawn = SHIPPED.draw(5, RealityConfig(alone="scan.late"))
    assert min(drawn["scan.late"], drawn["scan.delay"]) > 0.0


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"alone": "scan.delay"}, "alone = 'scan.delay': does nothing without scan.late; scan.late allowed"),
        ({"without": ("arm.mood",)}, "without = 'arm.mood': no such error; arm.rotor_inertia, "),
        ({"alone": "arm.mood"}, "alone = 'arm.mood': no such error; arm.rotor_inertia, "),
    ],
)
def test_an_error_that_cannot_be_chosen_is_refused(keys, words):
    with pytest.raises(ConfigError, match=f"reality.{words}"):
        SHIPPED.draw(1, RealityConfig(**keys))


def test_an_error_that_is_left_out_is_ideal_and_shifts_no_other():
    name = "arm.gravity"
    drawn, together = SHIPPED.draw(5, RealityConfig(without=(name,))), SHIPPED.draw(5, RealityConfig())
    assert np.all(drawn[name] == KINDS[name].ideal)
    assert np.any(together[name] != KINDS[name].ideal)
    assert all(np.array_equal(drawn[other], together[other]) for other in KINDS if other != name)


def test_an_offset_grows_with_the_scale_and_a_factor_as_its_power():
    once, twice = (SHIPPED.draw(3, RealityConfig(scale=scale)) for scale in (1.0, 2.0))
    assert twice["arm.gravity"] == pytest.approx(2.0 * once["arm.gravity"])
    assert twice["arm.friction_level"] == pytest.approx(once["arm.friction_level"] ** 2)


def test_noise_of_taxels_is_that_of_the_recordings():
    levels = many("skin.noise_level")
    counts = 188.0 * many("skin.module_noise")[:, :2, None] * levels[:, 0].reshape(-1, 2, 10)
    assert np.percentile(counts, [50, 95]) == pytest.approx([160, 456], rel=0.1)
    low, high = np.percentile(levels[:, 0, :10], [10, 90], axis=1)
    assert np.median(high / low) == pytest.approx(3.3, rel=0.1)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_the_pads_shear_never_leaves_its_assumed_range(scale: float):
    drawn = many("grip.shear_stiffness", scale=scale)
    assert np.percentile(drawn, [0, 50, 100]) == pytest.approx([0.1, 0.32, 1.0], rel=0.15)


def test_joints_have_figures_of_their_own():
    spread = many("arm.gravity").std(axis=0)
    assert spread == pytest.approx([0.05, 0.5, 0.2, 0.5, 0.1, 0.1, 0.03], rel=0.15)


def test_a_row_holds_what_was_drawn_except_single_taxels():
    told = recorded(SHIPPED.draw(1, RealityConfig()))
    assert len(told["reality.arm.gravity"].split()) == 7
    assert not any("taxel" in name for name in told)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ONE.replace('source = "A test that needs a figure"\n', ""), r"arm\.gravity\.source: Field required"),
        (ONE.replace("normal", "gamma"), r"arm\.gravity\.distribution: .*'normal', 'uniform'"),
        (ONE.replace("0.6, 0.7", "0.6"), r"arm\.gravity\.sigma: 6 figures; one, or one for each joint, allowed"),
        (ONE.replace("0.1,", "-0.1,"), r"arm\.gravity\.sigma: Input should be greater than or equal to 0"),
        (ONE.replace("arm.gravity", "arm.mood"), r"arm\.mood: no such error; arm\.rotor_inertia, "),
        (
            ONE.replace('"normal"', '"quantiles"').replace("sigma =", "shares = [0.1, 0.9]\nvalues ="),
            r"arm\.gravity\.distribution: values = .*: as many as shares, both in ascending order, allowed",
        ),
        ("arm = 1", r"arm: not a table"),
        ("[arm", r"not TOML"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused_in_one_line(tmp_path: Path, text: str, said: str):
    shipped = (Path(__file__).parents[4] / "config" / "reality.toml").read_text(encoding="utf-8")
    before, after = shipped.index("[arm.gravity]"), shipped.index("[arm.velocity_noise]")
    file = tmp_path / "reality.toml"
    file.write_text(shipped[:before] + text + shipped[after:] if text.startswith("\n[arm") else text, encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"\A[^\n]*{said}[^\n]*\Z"):
        read(file)


def test_an_error_that_is_missing_is_named(tmp_path: Path):
    file = tmp_path / "reality.toml"
    file.write_text(ONE, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"arm\.rotor_inertia: missing"):
        read(file)


def test_a_draw_cannot_be_changed_afterwards():
    drawn = Reality(SHIPPED.errors).draw(2, RealityConfig())
    with pytest.raises(ValueError, match="read-only"):
        drawn["arm.gravity"][0] = 1.0
