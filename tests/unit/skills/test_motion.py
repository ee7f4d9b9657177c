"""What the setpoints of several skills have in common."""

import numpy as np
import pytest

from cell.config import load
from skills.catalogue import GRASP
from skills.motion import STRAY, Goal, anchored, move
from tests.fakes import FakeArm, FakeClock, FakeGripper, context_of

CONFIG = load().cell


def test_a_hand_on_its_way_is_held_half_as_firmly_about_the_vertical():
    clock, transfer = FakeClock(), CONFIG.params(GRASP).transfer
    ctx = context_of(CONFIG, FakeArm(clock), FakeGripper(0.008))
    tcp = ctx.arm.tcp
    next(
        iter(
            move(
                Goal(tcp.position + np.array([0.0, 0.06, 0.0]), -tcp.rotation[:, 0], tcp.rotation[:, 2]),
                transfer,
                ctx,
                None,
            )
        )
    )
    gains = transfer.gains
    assert ctx.held.stiffness.tolist() == [gains.translation] * 3 + [gains.rotation] * 2 + [gains.rotation / 2.0]


@pytest.mark.parametrize(("breadth", "stray"), [(0.004, STRAY), (0.008, STRAY), (0.02, 0.01)])
def test_a_setpoint_follows_the_tip_as_far_as_a_leaning_peg_s_end_goes_while_it_is_turned_upright(breadth, stray):
    found = np.array([0.5, 0.1, 0.08])
    for way, kept in ((0.5 * stray, 0.5 * stray), (3.0 * stray, stray)):
        tip = anchored(found + np.array([0.6 * way, -0.8 * way, -0.01]), found, breadth)
        assert tip == pytest.approx(found + np.array([0.6 * kept, -0.8 * kept, -0.01]))
