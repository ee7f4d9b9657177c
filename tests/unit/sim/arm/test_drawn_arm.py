"""The simulated arm moves with its drawn errors."""

import math

import numpy as np
import pytest

from cell.config.files import ERRORS_FILE
from cell.config.files import SHIPPED as SHIPPED_FILES
from cell.config.load import load
from sim.arm.arm_truth import ideal
from sim.arm.drawn_arm import drawn_arm
from sim.config import RealityConfig
from sim.world.reality import AS_BELIEVED, read

PANDA = load().cell.arm_model()


def test_an_arm_without_errors_is_the_ideal_one():
    assert drawn_arm(PANDA, AS_BELIEVED) == ideal(PANDA)


def test_lag_and_transport_become_a_low_pass_and_control_cycles():
    drawn = {"arm.torque_lag": np.array(1.0 / (2.0 * math.pi * 100.0)), "arm.transport": np.array(0.002)}
    path = drawn_arm(PANDA, {**AS_BELIEVED, **drawn}).path
    assert (path.cutoff, path.delay) == (pytest.approx(100.0), 2)


def test_the_published_curve_takes_the_place_of_dry_friction_and_each_joint_has_its_own_level():
    level = np.linspace(0.5, 2.0, 7)
    drawn = {**AS_BELIEVED, "arm.sigmoid_friction": np.array(1.0), "arm.friction_level": level}
    friction = drawn_arm(PANDA, drawn).friction
    curve = PANDA.joints.smooth_friction
    assert curve is not None
    assert friction.dry == (0.0,) * 7
    assert friction.span == pytest.approx(level * np.array(curve.span))


def test_an_arm_with_errors_at_scale_1_differs_in_everything_that_is_drawn_of_it():
    truth, believed = drawn_arm(PANDA, read(SHIPPED_FILES / ERRORS_FILE).draw(8, RealityConfig())), ideal(PANDA)
    for name in ("friction", "rotor_inertia", "path", "reading", "wrench", "gravity", "tcp_offset"):
        assert getattr(truth, name) != getattr(believed, name)
