"""A scan that comes late slows the path of a skill, and ends the run only beyond the limits."""

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import ScanOverrunError
from skills.guards.scan_guards import LONGEST_STEP, ScanLimits
from skills.motion import Goal, Transfer, move
from tests.fakes import PERIOD, FakeArm, FakeClock, FakeGripper, context_of

CONFIG = load().cell


def late_cell(lateness, **limits):
    """Return the context of a fake cell in which the wait of the n-th scan ends `lateness(n)` seconds late."""
    clock = FakeClock()
    scans = iter(range(10**6))
    clock.every.append(lambda: setattr(clock, "lag", lateness(next(scans))))
    return context_of(CONFIG, FakeArm(clock), FakeGripper(0.008), ScanLimits(**limits))


def moved(ctx):
    """Move the hand by 60 mm; return what every scan saw, and the setpoints."""
    goal = Goal(
        ctx.devices.arm.tcp.position + np.array([0.0, 0.06, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    )
    return [(seen, ctx.lead.held.tip.copy()) for seen in move(goal, Transfer(), ctx, None)], goal


@pytest.mark.parametrize("mean", [0.003, 0.01])
def test_a_path_on_a_busy_computer_ends_at_its_goal_in_about_its_time(mean):
    rng = np.random.default_rng(3)
    ctx = late_cell(lambda n: rng.exponential(mean))
    punctual, goal = moved(late_cell(lambda n: 0.0))
    seen, _ = moved(ctx)
    np.testing.assert_allclose(ctx.lead.held.tip, goal.tip, atol=1e-9)
    assert seen[-1][0].running == pytest.approx(punctual[-1][0].running, rel=0.12)


def test_no_setpoint_steps_further_than_the_path_may_in_one_scan():
    ways, _ = moved(late_cell(lambda n: 0.09 if n % 7 == 0 else 0.0))
    tips = np.array([tip for _, tip in ways])
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() <= 0.25 * LONGEST_STEP * PERIOD * 1.001


def test_a_timeout_is_counted_on_the_cells_clock():
    ctx = late_cell(lambda n: 0.04)
    began = ctx.devices.clock.now()
    seen = list(ctx.scan(1.0))
    assert ctx.devices.clock.now() - began == pytest.approx(1.0, abs=0.05)
    assert seen[-1].elapsed == pytest.approx(seen[-1].running * LONGEST_STEP / 5.0, rel=0.05)


@pytest.mark.parametrize(("lateness", "limits"), [(0.011, {"late": 0.5}), (0.3, {})])
def test_beyond_the_limits_the_run_ends_with_a_fault(lateness, limits):
    with pytest.raises(ScanOverrunError):
        list(late_cell(lambda n: lateness, **limits).scan(5.0))
