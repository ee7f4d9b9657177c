from dataclasses import replace

import numpy as np
import pytest

from cell.config.files import arm_file
from drivers.arm.model import read_arm
from drivers.errors import ConfigError
from sim.arm import arm_senses, joint_drive
from sim.arm.arm_truth import JointFriction, Payload, StateReading, TorquePath, WrenchReading, every, ideal

PANDA = read_arm(arm_file("panda"))
TRUTH = ideal(PANDA)


def test_the_ideal_arm_is_what_the_cell_believes():
    assert TRUTH.model is PANDA
    assert TRUTH.friction == JointFriction(dry=PANDA.joints.friction)
    assert joint_drive.words_of(TRUTH, 1e-3, (5e-4, 1e-3))[joint_drive.IS_IDEAL] == 1.0
    assert arm_senses.words_of(TRUTH, 1e-3)[arm_senses.IS_IDEAL] == 1.0


@pytest.mark.parametrize(
    ("departure", "is_felt_by", "is_read_by"),
    [
        ({"path": TorquePath(delay=1)}, True, False),
        ({"path": TorquePath(cutoff=100.0)}, True, False),
        ({"path": TorquePath(rate=900.0)}, True, False),
        ({"friction": JointFriction(viscous=every(0.1))}, True, False),
        ({"gravity": every(0.1)}, True, True),
        ({"payload": Payload(0.2)}, True, True),
        ({"reading": StateReading(delay=1)}, False, True),
        ({"reading": StateReading(zero=every(1e-3))}, False, True),
        ({"reading": StateReading(rate_noise=every(1e-3))}, False, True),
        ({"wrench": WrenchReading(force=(0.0, 0.0, 1.0))}, False, True),
        ({"wrench": WrenchReading(cutoff=30.0)}, False, True),
        ({"rotor_inertia": every(0.1)}, False, False),
        ({"friction": JointFriction(dry=every(0.1))}, False, False),
    ],
)
def test_every_departure_is_known_to_what_it_concerns(departure, is_felt_by, is_read_by):
    truth = replace(TRUTH, **departure)
    drive = joint_drive.words_of(truth, 1e-3, (5e-4, 1e-3))
    assert drive[joint_drive.IS_IDEAL] == (not is_felt_by)
    assert arm_senses.words_of(truth, 1e-3)[arm_senses.IS_IDEAL] == (not is_read_by)


@pytest.mark.parametrize(
    "wrong",
    [
        {"path": TorquePath(delay=-1)},
        {"path": TorquePath(delay=51)},
        {"path": TorquePath(cutoff=0.0)},
        {"reading": StateReading(delay=51)},
        {"reading": StateReading(noise=-1e-5)},
        {"rotor_inertia": (0.1, 0.1, -0.1, 0.1, 0.1, 0.1, 0.1)},
        {"friction": JointFriction(dry=every(-0.1))},
        {"payload": Payload(-1.0)},
    ],
)
def test_what_no_arm_can_be_is_refused_in_one_line(wrong):
    with pytest.raises(ConfigError, match=r"^arm truth: [^\n]+ allowed$"):
        replace(TRUTH, **wrong)


def test_a_payload_makes_the_hand_heavier_about_a_common_centre():
    mass, at = 0.5, np.array([0.02, -0.01, 0.1])
    hand, loaded = PANDA.hand.body, replace(TRUTH, payload=Payload(mass, tuple(at))).hand_body(PANDA.hand.body.mass)
    assert loaded.mass == pytest.approx(hand.mass + mass)
    np.testing.assert_allclose(loaded.mass * np.array(loaded.com), hand.mass * np.array(hand.com) + mass * at)

    def about_the_flange(body):
        c = np.array(body.com)
        return body.tensor() + body.mass * (c @ c * np.eye(3) - np.outer(c, c))

    point = mass * (at @ at * np.eye(3) - np.outer(at, at))
    np.testing.assert_allclose(about_the_flange(loaded), about_the_flange(hand) + point)
