"""A scan that comes late slows the path of a skill, and ends the run only beyond the limits."""

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import ScanOverrunError
from drivers.frames import UP
from skills.guards.scan_guards import LONGEST_STEP, ScanLimits
from skills.motion import Goal, Transfer, move
from tests.fakes import PERIOD, FakeArm, FakeClock, FakeGripper, context_of

CONFIG = load().cell


def late_cell(lateness, **limits):
    """Return the context of a fake cell in which the wait of the n-th scan ends `lateness(n)` seconds late."""
    clock, scans = FakeClock(), iter(range(10**6))
    clock.every.append(lambda: setattr(clock, "lag", lateness(next(scans))))
    return context_of(CONFIG, FakeArm(clock), FakeGripper(0.008), ScanLimits(**limits))


def moved(ctx):
    """Move the hand by 60 mm; return the time that it took on the path, s, each tip of a setpoint, and the goal."""
    goal = Goal(ctx.devices.arm.tcp.position + np.array([0.0, 0.06, 0.0]), UP, np.array([0.0, -1.0, 0.0]))
    ways = [(seen.running, ctx.lead.held.tip.copy()) for seen in move(goal, Transfer(), ctx, None)]
    return ways[-1][0], np.array([tip for _, tip in ways]), goal.tip


@pytest.mark.parametrize("mean", [0.003, 0.01])
def test_a_path_on_a_busy_computer_ends_at_its_goal_in_about_its_time(mean):
    rng = np.random.default_rng(3)
    punctual, _, _ = moved(late_cell(lambda n: 0.0))
    time, tips, goal = moved(late_cell(lambda n: rng.exponential(mean)))
    np.testing.assert_allclose(tips[-1], goal, atol=1e-4)
    assert time == pytest.approx(punctual, rel=0.12)


def test_no_setpoint_steps_further_than_the_path_may_in_one_scan():
    _, tips, _ = moved(late_cell(lambda n: 0.09 if n % 7 == 0 else 0.0))
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() <= 0.25 * LONGEST_STEP * PERIOD * 1.001


def test_a_timeout_is_counted_on_the_cells_clock():
    ctx = late_cell(lambda n: 0.04)
    seen = list(ctx.scan(1.0))
    assert ctx.devices.clock.now() == pytest.approx(1.0, abs=0.05)
    assert seen[-1].elapsed == pytest.approx(seen[-1].running * LONGEST_STEP / 5.0, rel=0.05)


@pytest.mark.parametrize(("lateness", "limits"), [(0.011, {"late": 0.5}), (0.3, {})])
def test_beyond_the_limits_the_run_ends_with_a_fault(lateness, limits):
    with pytest.raises(ScanOverrunError):
        list(late_cell(lambda n: lateness, **limits).scan(5.0))
