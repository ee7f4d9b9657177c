"""Readings, guards and endings of one scan of a skill; every limit at it and one beyond it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import ArmSilentError, NotFiniteError, NotPassiveError, SkinUntrustedError
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, SwitchState, TaxelFrame, Wrench
from skills.catalogue import RECOVER
from skills.contract import (
    LATEST_STATE,
    LEAST_TRUSTED,
    LONGEST_BLIND,
    Interrupted,
    Reason,
    Request,
)
from skills.guards.passivity import INERTIA, MASS, SOFTEN, STOP
from skills.guards.scan_guards import RESUME_TIME
from skills.guards.wrench_zero import SCANS
from skills.held_peg import HeldPeg
from skills.motion import Goal, move
from tests.fakes import PERIOD, FakeArm, FakeClock, FakeGripper, context_of

CONFIG = load().cell
SOFT = np.array([800.0, 800.0, 800.0, 40.0, 40.0, 40.0])  # N/m, N·m/rad
FORCE = CONFIG.limits.force


class AgedArm(FakeArm):
    """Reports a state that is so old, s."""

    age = 0.0

    def read(self):
        state = super().read()
        return replace(state, stamp=state.stamp - self.age)


@pytest.fixture
def ctx():
    """Return the context of a fake cell whose hand holds a peg in the middle of the workspace."""
    clock = FakeClock()
    arm, hand = AgedArm(clock), FakeGripper(CONFIG.peg.part.thickness)
    hand.grip(30.0)
    return context_of(CONFIG, arm, hand)


def here(ctx, number=1, stiffness=SOFT):
    """Return a setpoint where the hand is."""
    hand = ctx.devices.arm.tcp
    return ImpedanceSetpoint(number, hand.position, -hand.rotation[:, 0], stiffness, np.ones(6), 1e9)


def scanned(ctx, times=3, **how):
    """Return the observations of so many scans."""
    return list(ctx.scan((times - 0.5) * PERIOD, **how))


def at(ctx, scan, act):
    """Do something when so many scans have passed."""
    ctx.devices.clock.at.append((ctx.devices.clock.now() + (scan - 0.5) * PERIOD, act))


# Readings of one scan.


def test_no_two_motions_have_the_same_number_and_none_that_of_an_arm_before_its_first(ctx):
    assert [ctx.new_id() for _ in range(3)] == [1, 2, 3]


def test_the_peg_ends_its_length_before_the_hand_and_as_much_further_as_its_touch_told(ctx):
    tcp, length = ctx.devices.arm.tcp.position, ctx.job.peg.length
    np.testing.assert_allclose(ctx.observe().tip, tcp - length * UP)
    assert not ctx.peg.is_length_known
    ctx.peg = HeldPeg(measured=0.004)
    np.testing.assert_allclose(ctx.observe().tip, tcp - (length + 0.004) * UP)
    assert (ctx.peg.is_length_known, ctx.in_hand().length) == (True, pytest.approx(length + 0.004))
    ctx.peg = ctx.peg.grasped_anew()
    assert (ctx.peg.is_length_known, ctx.length) == (False, length)


def test_each_slip_halves_the_grip_that_is_counted_on_until_the_hand_grasps_anew(ctx):
    ctx.note_slip()
    ctx.note_slip()
    assert ctx.peg.grip_share == 0.25
    assert ctx.peg.grasped_anew().grip_share == 1.0


def test_the_angle_of_the_skin_is_that_of_the_peg_in_the_hand(ctx):
    ctx.perception.estimator.theta = 0.2
    seen = ctx.observe()
    assert (seen.peg.theta, ctx.in_hand().theta, ctx.in_hand().stamp) == (0.2, 0.2, 0.0)
    assert seen.axis @ UP == pytest.approx(np.cos(0.2))


def test_every_device_is_in_the_observation(ctx):
    ctx.devices.switch.state = SwitchState.CLOSED
    seen = ctx.observe(1.0, 0.01, 2.0)
    assert (seen.elapsed, seen.step, seen.running) == (1.0, 0.01, 2.0)
    assert (seen.switch, seen.gripper.is_gripping) == (SwitchState.CLOSED, True)
    assert (seen.stamp, seen.frame.sequence) == (ctx.devices.clock.now(), 0)


def test_a_frame_is_new_once_and_looked_at_once(ctx):
    seen = scanned(ctx, 21)
    assert [each.is_new_frame for each in seen] == [number % 10 == 0 for number in range(21)]
    assert ctx.perception.estimator.frames == 3


def test_what_the_arm_reports_in_free_air_is_taken_from_its_wrench(ctx):
    ctx.devices.arm.force[:] = [3.0, -4.0, 12.0]
    scanned(ctx, SCANS)
    ctx.wrench.set_zero()
    ctx.devices.arm.force[:] += [0.0, 0.0, 7.0]
    np.testing.assert_allclose(ctx.observe().arm.wrench.force, [0.0, 0.0, 7.0], atol=1e-12)


def test_an_arm_that_tells_an_old_state_counts_as_silent(ctx):
    ctx.devices.arm.age = LATEST_STATE
    ctx.observe()
    ctx.devices.arm.age = LATEST_STATE + 0.011
    with pytest.raises(ArmSilentError, match=r"newest state 0\.11 s old > 0\.1 s limit"):
        ctx.observe()


def test_half_of_the_taxels_are_enough_and_one_less_is_not(ctx):
    ctx.devices.skin.trusted.flat[round(LEAST_TRUSTED * ctx.devices.skin.trusted.size) :] = False
    ctx.observe()
    ctx.devices.clock.time = 0.2
    ctx.devices.skin.trusted.flat[0] = False
    with pytest.raises(SkinUntrustedError, match="19 of 40 taxels trusted; 20 needed"):
        ctx.observe()


def test_a_taxel_that_tells_no_number_is_named_unless_nobody_trusts_it(ctx, monkeypatch):
    values = np.zeros((2, 20))
    values[1, 7] = np.nan
    monkeypatch.setattr(ctx.devices.skin, "read", lambda: TaxelFrame(values, ctx.devices.skin.trusted, 0.0, 5))
    with pytest.raises(NotFiniteError, match="right taxel 7: nan"):
        ctx.observe()
    ctx.devices.skin.trusted[1, 7] = False
    ctx._sequence = -1
    ctx.observe()


def test_an_angle_that_is_no_number_is_a_fault_where_it_calls_itself_healthy(ctx):
    ctx.perception.estimator.theta, ctx.perception.estimator.is_healthy = np.nan, False
    ctx.observe()
    ctx.perception.estimator.is_healthy, ctx.devices.clock.time = True, 0.2
    with pytest.raises(NotFiniteError, match="theta: nan"):
        ctx.observe()


def test_a_frame_that_shows_no_peg_leaves_the_angle_that_was_known(ctx):
    ctx.perception.estimator.theta = 0.2
    ctx.observe()
    ctx.perception.estimator.theta, ctx.perception.estimator.is_healthy, ctx.devices.clock.time = 0.5, False, 0.2
    seen = ctx.observe()
    assert (seen.peg.theta, seen.peg.stamp) == (0.2, 0.0)


def test_a_look_outside_a_scan_counts_no_time(ctx):
    seen = ctx.observe()
    assert (seen.elapsed, seen.step, seen.running) == (0.0, 0.0, 0.0)


# Endings of a scan.


def test_a_scan_counts_its_time_from_nothing_in_steps_of_its_period(ctx):
    seen = scanned(ctx, 4)
    np.testing.assert_allclose([each.elapsed for each in seen], [0.0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose([each.running for each in seen], [0.0, 0.01, 0.02, 0.03])
    assert [each.step for each in seen] == [PERIOD] * 4
    assert ctx.devices.clock.now() == pytest.approx(4 * PERIOD)


def test_a_scan_begins_a_period_after_the_one_before_and_none_once_its_time_has_passed(ctx):
    ctx.devices.clock.time = 5.0
    np.testing.assert_allclose([seen.stamp for seen in ctx.scan(2 * PERIOD)], [5.0, 5.01])


def test_exactly_the_force_of_the_limit_is_borne(ctx):
    ctx.devices.arm.force[:] = [0.0, FORCE, 0.0]
    assert len(scanned(ctx)) == 3


@pytest.mark.parametrize("force", [(FORCE, 0.0, 0.0), (0.0, 0.6 * FORCE, -0.8 * FORCE)])
def test_a_force_beyond_the_limit_ends_the_skill_with_the_arm_halted(ctx, force):
    ctx.devices.arm.force[:] = np.array(force) * (1.0 - 1e-9)
    scanned(ctx)
    assert not ctx.devices.arm.is_halted
    ctx.devices.arm.force[:] = np.array(force) * 1.001
    with pytest.raises(Interrupted) as ending:
        scanned(ctx)
    assert (ending.value.reason, ctx.devices.arm.is_halted) == (Reason.FORCE_LIMIT, True)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", ["low", "high"])
def test_a_hand_outside_the_workspace_ends_the_skill_with_the_arm_halted(ctx, axis, side):
    bound, outwards = getattr(ctx.limits, side)[axis], -1e-6 if side == "low" else 1e-6
    place = ctx.devices.arm.tcp.position.copy()
    place[axis] = bound
    ctx.devices.arm.tcp = replace(ctx.devices.arm.tcp, position=place.copy())
    scanned(ctx)
    place[axis] = bound + outwards
    ctx.devices.arm.tcp = replace(ctx.devices.arm.tcp, position=place)
    with pytest.raises(Interrupted) as ending:
        scanned(ctx)
    assert (ending.value.reason, ctx.devices.arm.is_halted) == (Reason.WORKSPACE, True)


def test_a_way_out_of_a_violation_may_go_without_the_limits(ctx):
    ctx.devices.arm.force[2] = 2.0 * FORCE
    assert len(scanned(ctx, limited=False)) == 3


def test_the_scan_that_breaks_a_limit_is_on_record(ctx):
    recorded = []
    ctx.callbacks = replace(
        ctx.callbacks, record=lambda seen, setpoint: recorded.append((seen.arm.wrench.force[2], setpoint))
    )
    ctx.follow(here(ctx))
    ctx.devices.arm.force[2] = 2.0 * FORCE
    with pytest.raises(Interrupted):
        scanned(ctx)
    assert recorded == [(2.0 * FORCE, ctx.lead.held)]


def test_a_stop_ends_the_skill_before_its_next_scan_with_the_arm_halted(ctx):
    ctx.callbacks = replace(ctx.callbacks, poll=iter([Request.RUN, Request.STOP]).__next__)
    seen, scan = [], ctx.scan(1.0)
    with pytest.raises(Interrupted) as ending:
        seen.extend(iter(scan.__next__, None))
    assert (ending.value.reason, str(ending.value), ctx.devices.arm.is_halted) == (Reason.STOPPED, "STOPPED", True)


@pytest.mark.parametrize("width", [float("nan"), float("inf")])
def test_a_width_of_the_hand_that_is_no_number_is_a_fault_with_its_name(ctx, width):
    ctx.devices.gripper.width = width
    with pytest.raises(NotFiniteError, match=f"^hand: width: {width}; a number needed$"):
        scanned(ctx)
    with pytest.raises(NotFiniteError, match="hand: width"):
        ctx.read_hand()


# A peg that has to be held.


def test_a_hand_that_lets_go_ends_a_skill_that_needs_the_peg(ctx):
    at(ctx, 2, lambda: setattr(ctx.devices.gripper, "has_peg", False))
    with pytest.raises(Interrupted) as ending:
        scanned(ctx, 9, holding=True)
    assert (ending.value.reason, ctx.devices.arm.is_halted) == (Reason.LOST_GRASP, True)
    assert len(scanned(ctx, 9)) == 9


def test_a_skin_that_sees_nothing_on_a_way_through_free_space_is_not_trusted_within_a_second(ctx):
    transfer, began = CONFIG.params(RECOVER).transfer, ctx.devices.clock.now()
    ctx.perception.estimator.is_healthy = False
    goal = Goal(ctx.observe().tip + 0.2 * UP, UP, ctx.devices.arm.read().tcp.rotation[:, 2])
    with pytest.raises(SkinUntrustedError, match=r"no angle of the peg for 0\.7\d s > 0\.7 s limit"):
        list(move(goal, transfer, ctx, ctx.in_hand(), limited=False))
    assert ctx.devices.clock.now() - began < 1.0


@pytest.mark.parametrize("is_held", [True, False])
def test_a_move_with_a_peg_ends_where_the_hand_has_lost_it_and_one_without_does_not(ctx, is_held):
    transfer = CONFIG.params(RECOVER).transfer
    tip = ctx.observe().tip if is_held else ctx.devices.arm.read().tcp.position
    goal = Goal(tip + 0.02 * UP, UP, ctx.devices.arm.read().tcp.rotation[:, 2])
    at(ctx, 2, lambda: setattr(ctx.devices.gripper, "has_peg", False))
    way = move(goal, transfer, ctx, ctx.in_hand() if is_held else None, limited=False)
    if not is_held:
        assert len(list(way)) > 9
        return
    with pytest.raises(Interrupted) as ending:
        list(way)
    assert ending.value.reason is Reason.LOST_GRASP


def went_on(ctx, healthy, time=2.0):
    """Return how long a skill that needs the peg goes on with a skin that sees it while `healthy` says, s."""
    began = ctx.devices.clock.now()
    ctx.devices.clock.every.append(
        lambda: setattr(ctx.perception.estimator, "is_healthy", healthy(ctx.devices.clock.now()))
    )
    ctx.perception.estimator.is_healthy = healthy(began)
    with pytest.raises(SkinUntrustedError, match=r"no angle of the peg for 0\.7\d s > 0\.7 s limit"):
        for _ in ctx.scan(time, holding=True):
            pass
    return ctx.devices.clock.now() - began


def test_a_skin_that_has_never_seen_the_peg_is_not_trusted_after_the_time_allowed(ctx):
    assert went_on(ctx, lambda now: False) == pytest.approx(LONGEST_BLIND, abs=1.1 * PERIOD)


def test_a_skin_that_sees_the_peg_no_more_is_blind_from_its_last_frame_on(ctx):
    assert went_on(ctx, lambda now: now < 0.35) == pytest.approx(0.3 + LONGEST_BLIND, abs=1.1 * PERIOD)


def test_a_skill_that_needs_no_peg_is_not_blind_and_the_next_one_counts_anew(ctx):
    ctx.perception.estimator.is_healthy = False
    scanned(ctx, 60, holding=True)
    scanned(ctx, 60)
    assert went_on(ctx, lambda now: False) == pytest.approx(LONGEST_BLIND, abs=1.1 * PERIOD)


@pytest.mark.parametrize("is_seen_first", [True, False])
def test_a_skin_may_be_blind_for_exactly_as_long_as_the_limit_says(ctx, is_seen_first):
    ctx.perception.estimator.is_healthy = is_seen_first
    next(ctx.scan(1.0, holding=True))
    ctx.perception.estimator.is_healthy, ctx.devices.clock.time = False, LONGEST_BLIND
    next(ctx.scan(1.0, holding=True))
    ctx.devices.clock.time = LONGEST_BLIND + 0.01
    with pytest.raises(SkinUntrustedError, match=r"no angle of the peg for 0\.71 s > 0\.7 s limit"):
        next(ctx.scan(1.0, holding=True))


def test_an_offset_of_a_finger_ends_a_skill_at_once_unless_it_leads_out_of_a_violation(ctx, monkeypatch):
    read = ctx.devices.skin.read
    monkeypatch.setattr(
        ctx.devices.skin, "read", lambda: replace(read(), values=read().values + np.array([[4000.0], [0.0]]))
    )
    scanned(ctx, limited=False)
    ctx.devices.clock.time = 0.2
    with pytest.raises(SkinUntrustedError, match="left finger: offset"):
        scanned(ctx)


# Hold.


def test_on_hold_the_arm_is_halted_nothing_is_yielded_and_no_time_counts(ctx):
    ctx.follow(here(ctx))
    asked = [Request.RUN] * 3 + [Request.HOLD] * 50 + [Request.RESUME] * 110 + [Request.RUN] * 99
    ctx.callbacks = replace(ctx.callbacks, poll=iter(asked).__next__)
    halts, halt = [], ctx.devices.arm.halt
    ctx.devices.arm.halt = lambda: (halts.append(ctx.devices.clock.now()), halt())
    held = []
    at(ctx, 40, lambda: held.append(ctx.devices.arm.is_halted))
    seen = scanned(ctx, 5)
    np.testing.assert_allclose([each.running for each in seen], [0.0, 0.01, 0.02, 0.03, 0.04])
    assert seen[3].stamp - seen[2].stamp == pytest.approx(161 * PERIOD)
    assert halts == [pytest.approx(3 * PERIOD)]  # one that stands is halted once
    assert (held, ctx.devices.arm.is_halted) == ([True], False)


def test_after_a_hold_the_arm_is_led_back_to_its_setpoint_in_a_second(ctx):
    held = here(ctx)
    ctx.follow(held)
    ctx.callbacks = replace(
        ctx.callbacks, poll=iter([Request.RUN] + [Request.HOLD] * 10 + [Request.RESUME] * 120 + [Request.RUN]).__next__
    )
    pushed = held.tip + np.array([0.0, 0.04, 0.0])
    at(ctx, 5, lambda: setattr(ctx.devices.arm, "tcp", replace(ctx.devices.arm.tcp, position=pushed)))
    way = []
    ctx.callbacks = replace(
        ctx.callbacks, record=lambda seen, setpoint: way.append(seen.arm.tcp.position[1] - held.tip[1])
    )
    scanned(ctx, 2)
    np.testing.assert_allclose(way[7:11], 0.04)
    assert way[11 + round(RESUME_TIME / PERIOD / 2)] == pytest.approx(0.02, abs=0.001)
    assert way[11 + round(RESUME_TIME / PERIOD) + 1] == pytest.approx(0.0, abs=1e-9)


# Energy.


def swung(ctx, share, stiffness=SOFT, number=1):
    """Let the arm swing with this share of the energy at the force limit about a setpoint that stands; return what is held."""
    ctx.devices.arm.is_blocked = True
    speed = FORCE * np.sqrt(share / (MASS * stiffness[0]))
    middle = ctx.devices.arm.tcp.position.copy()
    ctx.follow(here(ctx, number, stiffness))
    for scan, _ in enumerate(ctx.scan(6.5 * PERIOD)):
        side = 0.5 * speed * PERIOD * (-1) ** scan
        ctx.devices.arm.tcp = replace(ctx.devices.arm.tcp, position=middle + np.array([side, 0.0, 0.0]))
        ctx.follow(replace(ctx.lead.held, stiffness=stiffness))
    return ctx.lead.held.stiffness


def test_a_swing_of_much_energy_softens_its_motion_and_no_other(ctx):
    np.testing.assert_allclose(swung(ctx, 0.5 * (SOFTEN + STOP)), 0.5 * SOFT)
    ctx.follow(here(ctx, number=2))
    np.testing.assert_allclose(ctx.lead.held.stiffness, SOFT)
    ctx.follow(here(ctx, number=1, stiffness=0.1 * SOFT))
    np.testing.assert_allclose(ctx.lead.held.stiffness, 0.1 * SOFT)


def test_each_motion_that_swings_is_softened_by_half_of_its_own_stiffness(ctx):
    swung(ctx, 0.5 * (SOFTEN + STOP))
    np.testing.assert_allclose(swung(ctx, 0.5 * (SOFTEN + STOP), 0.6 * SOFT, number=2), 0.3 * SOFT)


def test_an_arm_that_somebody_shakes_on_hold_pumps_nothing(ctx):
    ctx.callbacks = replace(
        ctx.callbacks,
        poll=iter([Request.RUN] + [Request.HOLD] * 9 + [Request.RESUME] * 120 + [Request.RUN] * 9).__next__,
    )
    middle, sides = ctx.devices.arm.tcp.position.copy(), iter([0.01, -0.01] * 4)
    ctx.follow(here(ctx))

    def shake(seen, held):
        ctx.devices.arm.tcp = replace(ctx.devices.arm.tcp, position=middle + np.array([next(sides, 0.0), 0.0, 0.0]))

    ctx.callbacks = replace(ctx.callbacks, record=shake)
    assert len(scanned(ctx)) == 3


def test_a_swing_of_less_energy_is_left_alone(ctx):
    np.testing.assert_allclose(swung(ctx, 0.95 * SOFTEN), SOFT)


def test_a_swing_beyond_the_force_limit_is_a_fault_with_the_arm_halted(ctx):
    assert INERTIA > 0.0
    stiff = np.array([800.0, 700.0, 600.0, 900.0, 50.0, 40.0])
    with pytest.raises(
        NotPassiveError,
        match=r"^skill: 1\.2 times the energy that presses with 60 N, at 800 N/m and 900 N·m/rad; less than 1 allowed$",
    ):
        swung(ctx, 1.2, stiff)
    assert ctx.devices.arm.is_halted


@pytest.mark.parametrize(("is_free", "moment"), [(True, 0.0), (False, 0.3)])
def test_moment_on_the_peg_counts_only_outside_free_space(ctx, is_free, moment):
    felt, closing, read = [], ctx.devices.arm.tcp.rotation[:, 2], ctx.devices.arm.read
    ctx.devices.arm.read = lambda: replace(read(), wrench=Wrench(np.zeros(3), 0.3 * closing))
    follow = ctx.perception.tracker.follow
    ctx.perception = replace(
        ctx.perception,
        tracker=SimpleNamespace(follow=lambda new, stamp, moment: felt.append(moment) or follow(new, stamp, moment)),
    )
    ctx.follow(replace(here(ctx), is_free=is_free))
    scanned(ctx)
    assert felt == pytest.approx([moment] * 3)
