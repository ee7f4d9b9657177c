"""Gains are held against torques that act late, behind a low-pass, on joints that may be light."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.checks import require_steady
from cell.config.load import load
from cell.config.margins import MARGIN
from cell.config.sampled_loop import radius
from cell.config.torque_path import is_steady, largest, one_cycle
from drivers.arm.inertia import joint_inertia
from drivers.impedance import ROTOR_RANGE, most_learnt
from skills.catalogue import GRASP
from skills.motion import DampedGains, Gains

CELL = load().cell
ARM = CELL.arm_model()


def arm_with(rotors=(0.05,) * 7, **path):
    """Return the arm with these rotors, kg·m², of which all shows unless the path says so, and this torque path."""
    joints = ARM.joints.model_copy(update={"rotor_inertia": rotors})
    return ARM.model_copy(
        update={"joints": joints, "torque_path": ARM.torque_path.model_copy(update={"rotor_share": 1.0, **path})}
    )


def swing(arm, damping_ratio, factor=1.0):
    """Return how fast a swing about the stiffness of free motion grows in one control cycle, if the law's figures are correct."""
    gains = DampedGains(translation=1500.0, rotation=60.0, damping_ratio=damping_ratio)
    return radius(one_cycle(arm, np.array(arm.home), 0.0, gains, factor))


def held_swing(arm, factor=1.0):
    """Return how fast a swing of an arm that holds still grows in one control cycle."""
    return radius(one_cycle(arm, np.array(arm.home), 0.0, None, factor))


@pytest.mark.parametrize(("damping_ratio", "share", "swings"), [(1.0, 0.0, False), (5.0, 0.0, True), (5.0, 2.0, False)])
def test_an_arm_damped_for_too_much_inertia_swings(damping_ratio, share, swings):
    light = ARM.model_copy(update={"torque_path": ARM.torque_path.model_copy(update={"rotor_share": share})})
    assert (swing(light, damping_ratio) > 1.0) == swings


@pytest.mark.parametrize(("times", "share", "swings"), [(1.0, 0.0, False), (10.0, 0.0, True), (10.0, 0.4, False)])
def test_a_halted_arm_swings_in_theory_as_in_physics(times, share, swings):
    """The three cases are those of tests/line/test_arm_truth.py: believed rotors of so many times the shipped ones, and the share that shows."""
    rotors = tuple(times * rotor for rotor in ARM.joints.rotor_inertia)
    assert (held_swing(arm_with(rotors, rotor_share=share)) > 1.0) == swings


@pytest.mark.parametrize("model", ["panda", "fr3"])
def test_a_hold_bears_the_range_of_rotor_inertia(model):
    """Then it bears its path, whatever was learnt of the rotors, where a joint bears it that has so many times less inertia."""
    arm = load(sets=[f"arm.model={model}"]).cell.arm_model()
    q, rotors = np.array(arm.home), np.diag(arm.joints.rotor_inertia)
    links = joint_inertia(arm, q)
    least, most = links + arm.torque_path.rotor_share * rotors, links + rotors + np.diag(most_learnt(arm))
    ratio = np.linalg.eigvals(np.linalg.solve(least, most)).real.max()
    assert 1.0 < ratio <= ROTOR_RANGE
    single = arm.model_copy(update={"joints": arm.joints.model_copy(update={"rotor_inertia": (1e4,) * 7})})
    single = single.model_copy(
        update={"torque_path": arm.torque_path.model_copy(update={"rotor_share": 1 / ROTOR_RANGE})}
    )
    assert held_swing(single, MARGIN) < 1.0


def test_an_arm_with_torques_too_late_to_hold_is_refused():
    place = CELL.place()
    late = replace(place, arm=arm_with(transport=0.01, cutoff=20.0))
    assert is_steady(None, place)
    with pytest.raises(ValueError, match=r"^arm: if halted, oscillates from 0\.\d+ times the torques with 10 ms"):
        require_steady({}, late)


def test_later_and_slower_torques_swing_more():
    grown = [
        swing(arm_with(transport=transport, cutoff=cutoff), 1.0, factor=6.0)
        for transport, cutoff in ((0.001, 1e4), (0.002, 100.0), (0.004, 30.0))
    ]
    assert grown == sorted(grown)
    assert grown[0] < 1.0 < grown[-1]


def test_the_limit_is_where_the_swing_begins():
    gains, place = CELL.steered()["insert.gains"], CELL.place()
    for share, swings in ((0.99, False), (1.03, True)):
        factor = share * largest(gains, place)
        grown = [radius(one_cycle(place.arm, q, place.length, gains, factor)) for q in place.postures()]
        assert (max(grown) > 1.0) == swings


@pytest.mark.parametrize("model", ["panda", "fr3"])
@pytest.mark.parametrize("preset", ["", "careful", "paper"])
def test_every_shipped_gain_bears_the_path_of_every_shipped_arm(model, preset):
    cell = load(preset=preset, sets=[f"arm.model={model}"]).cell
    assert min(largest(gains, cell.place()) for gains in cell.followed().values()) > MARGIN


class OnItsWay(Gains):
    """Gains of the arm's first move."""

    def stiffness(self):
        return CELL.params(GRASP).transfer.stiffness()


@pytest.mark.parametrize(("kind", "swings"), [(Gains, True), (OnItsWay, False)])
def test_an_upright_hand_in_transfer_bears_late_torques_without_rotors(kind, swings):
    """Its damping is meant for rotors; the hand's own axis has the least inertia beside them."""
    path = ARM.torque_path.model_copy(update={"rotor_share": 0.0, "transport": 2 * 0.002, "cutoff": 1e4})
    bare = ARM.model_copy(update={"torque_path": path})
    gains = kind(**CELL.params(GRASP).transfer.gains.model_dump())
    _, upright = CELL.place().postures()
    assert (radius(one_cycle(bare, upright, 0.0, gains, 1.0)) > 1.0) == swings
