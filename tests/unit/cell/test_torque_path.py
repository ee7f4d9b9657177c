"""Gains are held against torques that act late, behind a low-pass, on joints that may be light."""

import numpy as np
import pytest

from cell.config import load
from cell.margins import MARGIN
from cell.sampled_loop import radius
from cell.torque_path import is_steady, largest, one_cycle
from drivers.errors import ConfigError
from drivers.impedance import HALT_STIFFNESS
from skills.motion import Gains

CELL = load().cell
ARM = CELL.arm_model()


def arm_with(rotors=0.05, **path):
    """Return the arm with these rotors, kg·m², of which all shows, and this torque path."""
    joints = ARM.joints.model_copy(update={"rotor_inertia": (rotors,) * 7})
    return ARM.model_copy(
        update={"joints": joints, "torque_path": ARM.torque_path.model_copy(update={"rotor_share": 1.0, **path})}
    )


def halted(damping_ratio):
    return Gains(translation=HALT_STIFFNESS[0], rotation=HALT_STIFFNESS[3], damping_ratio=damping_ratio)


def swing(arm, damping_ratio, factor=1.0):
    """Return how fast a swing of the halted arm grows in one control cycle, with a law that believes its figures."""
    return radius(one_cycle(arm, np.array(arm.home), 0.0, halted(damping_ratio), factor))


@pytest.mark.parametrize(("damping_ratio", "share", "swings"), [(1.0, 0.0, False), (5.0, 0.0, True), (5.0, 2.0, False)])
def test_an_arm_swings_in_theory_where_it_does_in_the_whole_physics(damping_ratio, share, swings):
    """The three cases are those of tests/line/test_arm_truth.py: no rotors, and rotors of twice the shipped figures, which the law believes."""
    light = ARM.model_copy(update={"torque_path": ARM.torque_path.model_copy(update={"rotor_share": share})})
    assert (swing(light, damping_ratio) > 1.0) == swings


def test_the_later_torques_act_and_the_lower_the_filter_the_less_they_may_be():
    grown = [
        swing(arm_with(transport=transport, cutoff=cutoff), 1.0, factor=6.0)
        for transport, cutoff in ((0.001, 1e4), (0.002, 100.0), (0.004, 30.0))
    ]
    assert grown == sorted(grown)
    assert grown[0] < 1.0 < grown[-1]


def test_the_limit_is_where_the_swing_begins():
    gains, place = CELL.steered()["insert.gains"], CELL.place()
    limit = largest(gains, place)
    assert is_steady(gains, place, 0.99 * limit)
    assert not is_steady(gains, place, 1.03 * limit)


@pytest.mark.parametrize("model", ["panda", "fr3"])
@pytest.mark.parametrize("preset", ["balanced", "fast", "careful", "paper"])
def test_every_shipped_gain_bears_the_path_of_every_shipped_arm(model, preset):
    cell = load(preset=preset, sets=[f"arm.model={model}"]).cell
    assert min(largest(gains, cell.place()) for gains in cell.followed().values()) > MARGIN


@pytest.mark.parametrize("key", ["insert.gains", "search.transfer.gains"])
def test_gains_that_would_swing_are_refused_in_one_line(key):
    with pytest.raises(
        ConfigError, match=rf"{key}: swings from \d\.\d+ times these torques where they act 2 ms late"
    ) as told:
        load(sets=[f"{key}.damping_ratio=6"])
    assert "\n" not in str(told.value)
