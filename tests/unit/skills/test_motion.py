"""What the setpoints of several skills have in common."""

import numpy as np
import pytest

from skills.motion import STRAY, anchored


@pytest.mark.parametrize(("breadth", "stray"), [(0.004, STRAY), (0.008, STRAY), (0.02, 0.01)])
def test_a_setpoint_follows_the_tip_as_far_as_a_leaning_peg_s_end_goes_while_it_is_turned_upright(breadth, stray):
    found = np.array([0.5, 0.1, 0.08])
    for way, kept in ((0.5 * stray, 0.5 * stray), (3.0 * stray, stray)):
        tip = anchored(found + np.array([0.6 * way, -0.8 * way, -0.01]), found, breadth)
        assert tip == pytest.approx(found + np.array([0.6 * kept, -0.8 * kept, -0.01]))
