"""Readings, guards and endings of one scan of a skill; every limit at it and one beyond it."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import ArmSilentError, NotFiniteError, NotPassiveError, SkinUntrustedError
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, SwitchState, TaxelFrame, Wrench
from skills.contract import LATEST_STATE, LEAST_TRUSTED, LONGEST_BLIND, Interrupted, Reason, Request
from skills.guards.deviation import MASS
from skills.guards.passivity import SOFTEN, STOP
from skills.guards.scan_guards import RESUME_TIME
from skills.held_peg import HeldPeg
from tests.fakes import PERIOD, FakeClock
from tests.unit.skills.benches import watched

CONFIG = load().cell
SOFT = np.array([800.0, 800.0, 800.0, 40.0, 40.0, 40.0])  # N/m, N·m/rad
FORCE = CONFIG.limits.force


@pytest.fixture
def ctx():
    """Return the context of a fake cell whose hand holds a peg in the middle of the workspace."""
    return watched(CONFIG)


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


def ended(ctx, times=3, **how):
    """Return why scans end, with the arm halted."""
    with pytest.raises(Interrupted) as ending:
        scanned(ctx, times, **how)
    assert ctx.devices.arm.is_halted
    return ending.value.reason


def place(ctx, position, aside=(0.0, 0.0)):
    """Put the hand beside a place, m, in the plane."""
    ctx.devices.arm.tcp = replace(ctx.devices.arm.tcp, position=position + np.array([*aside, 0.0]))


def answer(ctx, *requests):
    """Let the PLC request these, one at each scan; each is a request and its number of scans."""
    polled = (request for request, scans in requests for _ in range(scans))
    ctx.callbacks = replace(ctx.callbacks, poll=polled.__next__)


# Readings of one scan.


def test_length_and_grip_are_known_until_the_next_grasp(ctx):
    tcp, length = ctx.devices.arm.tcp.position, ctx.job.peg.length
    np.testing.assert_allclose(ctx.observe().tip, tcp - length * UP)
    assert not ctx.peg.is_length_known
    for excess in (0.004, -0.0029, 0.005, -0.0031, -0.0031):
        ctx.note_touch(excess)
    np.testing.assert_allclose(ctx.observe().tip, tcp - (length - 1e-4) * UP)
    assert (ctx.peg.is_length_known, ctx.peg.grip_share) == (True, 0.25)
    assert ctx.in_hand().length == pytest.approx(length - 1e-4)
    ctx.peg = HeldPeg()
    assert (ctx.peg.is_length_known, ctx.peg.grip_share, ctx.length) == (False, 1.0, length)


def test_every_device_is_in_the_observation(ctx):
    ctx.devices.switch.state, ctx.perception.estimator.theta = SwitchState.CLOSED, 0.2
    seen = ctx.observe()
    assert (seen.switch, seen.gripper.is_gripping) == (SwitchState.CLOSED, True)
    assert (seen.stamp, seen.frame.sequence) == (ctx.devices.clock.now(), 0)
    assert (seen.peg.theta, ctx.in_hand().theta) == (0.2, 0.2)
    assert seen.axis @ UP == pytest.approx(np.cos(0.2))


def test_each_frame_is_new_and_estimated_once(ctx):
    seen = scanned(ctx, 21)
    assert [each.is_new_frame for each in seen] == [number % 10 == 0 for number in range(21)]
    assert ctx.perception.estimator.frames == 3


def test_a_state_of_the_arm_that_is_too_old_counts_as_silence(ctx):
    ctx.devices.arm.clock = FakeClock()  # its state keeps the stamp 0 s
    ctx.devices.clock.time = LATEST_STATE
    ctx.observe()
    ctx.devices.clock.time = LATEST_STATE + 0.011
    with pytest.raises(ArmSilentError, match=r"newest state 0\.11 s old > 0\.1 s limit"):
        ctx.observe()


def test_half_of_the_taxels_suffice_and_one_less_does_not(ctx):
    trusted, least = ctx.devices.skin.trusted, round(LEAST_TRUSTED * ctx.devices.skin.trusted.size)
    trusted.flat[least:] = False
    ctx.observe()
    ctx.devices.clock.time = 0.2
    trusted.flat[0] = False
    with pytest.raises(SkinUntrustedError, match="19 of 40 taxels trusted; 20 needed"):
        ctx.observe()


@pytest.mark.parametrize("wrong", [np.nan, -np.inf, 65536.0])
def test_a_trusted_taxel_that_reads_no_possible_number_is_a_fault(ctx, wrong):
    skin, frames = ctx.devices.skin, itertools.count()
    values = np.where(np.arange(40).reshape(2, 20) == 27, wrong, 0.0)
    skin.read = lambda: TaxelFrame(values, skin.trusted, 0.0, next(frames))
    with pytest.raises(NotFiniteError, match=f"^skin: right taxel 7: {wrong}"):
        ctx.observe()
    skin.trusted[1, 7] = False
    ctx.observe()


@pytest.mark.parametrize("width", [np.nan, np.inf])
def test_an_impossible_width_of_the_hand_is_a_fault(ctx, width):
    ctx.devices.gripper.width = width
    for read in (ctx.observe, ctx.read_hand):
        with pytest.raises(NotFiniteError, match=f"^hand: width: {width}; a number needed$"):
            read()


def test_an_angle_counts_only_if_its_frame_shows_a_peg(ctx):
    estimator, clock = ctx.perception.estimator, ctx.devices.clock
    estimator.theta = 0.2
    ctx.observe()
    estimator.theta, estimator.is_healthy, clock.time = np.nan, False, 0.2
    seen = ctx.observe()
    assert (seen.peg.theta, seen.peg.stamp) == (0.2, 0.0)
    estimator.is_healthy, clock.time = True, 0.4
    with pytest.raises(NotFiniteError, match="theta: nan"):
        ctx.observe()


# Endings of a scan.


def test_scans_count_their_time_from_zero_in_steps_of_a_period(ctx):
    ctx.devices.clock.time = 5.0
    told = np.array([(each.elapsed, each.running, each.stamp - 5.0, each.step) for each in scanned(ctx, 4)])
    np.testing.assert_allclose(told, [[n * PERIOD] * 3 + [PERIOD] for n in range(4)])
    assert len(list(ctx.scan(2 * PERIOD))) == 2
    assert ctx.devices.clock.now() == pytest.approx(5.0 + 6 * PERIOD)


@pytest.mark.parametrize(
    ("direction", "borne"), [((0.0, 1.0, 0.0), 1.0), ((1.0, 0.0, 0.0), 1.0), ((0.0, 0.6, -0.8), 1.0 - 1e-9)]
)
def test_a_force_beyond_the_limit_ends_the_skill(ctx, direction, borne):
    ctx.devices.arm.force[:] = borne * FORCE * np.array(direction)
    scanned(ctx)
    ctx.devices.arm.force[:] = 1.001 * FORCE * np.array(direction)
    assert len(scanned(ctx, limited=False)) == 3
    assert not ctx.devices.arm.is_halted
    recorded = []
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, setpoint: recorded.append(setpoint))
    ctx.follow(here(ctx))
    assert ended(ctx) is Reason.FORCE_LIMIT
    assert recorded == [ctx.lead.held]  # the scan that breaks the limit


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(("side", "outwards"), [("low", -1e-6), ("high", 1e-6)])
def test_a_hand_outside_the_workspace_ends_the_skill(ctx, axis, side, outwards):
    there = ctx.devices.arm.tcp.position.copy()
    there[axis] = getattr(ctx.limits, side)[axis]
    place(ctx, there)
    scanned(ctx)
    there[axis] += outwards
    place(ctx, there)
    assert ended(ctx) is Reason.WORKSPACE


def test_a_stop_ends_the_skill_before_its_next_scan(ctx):
    answer(ctx, (Request.RUN, 1), (Request.STOP, 1))
    assert ended(ctx) is Reason.STOPPED


# A peg that has to be held.


@pytest.mark.parametrize("is_seen_first", [True, False])
def test_a_skin_may_be_blind_up_to_the_limit(ctx, is_seen_first):
    ctx.perception.estimator.is_healthy = is_seen_first
    next(ctx.scan(1.0, holding=True))
    ctx.perception.estimator.is_healthy, ctx.devices.clock.time = False, LONGEST_BLIND
    next(ctx.scan(1.0, holding=True))
    ctx.devices.clock.time = LONGEST_BLIND + 0.01
    with pytest.raises(SkinUntrustedError, match=r"no angle of the peg for 0\.71 s > 0\.7 s limit"):
        next(ctx.scan(1.0, holding=True))


def test_time_blind_counts_anew_after_a_skill_without_a_peg(ctx):
    ctx.perception.estimator.is_healthy = False
    scanned(ctx, 60, holding=True)
    scanned(ctx, 60)
    began = ctx.devices.clock.now()
    with pytest.raises(SkinUntrustedError, match="no angle of the peg"):
        scanned(ctx, 99, holding=True)
    assert ctx.devices.clock.now() - began == pytest.approx(LONGEST_BLIND, abs=1.1 * PERIOD)


def test_an_offset_of_a_finger_ends_a_skill_with_limits(ctx):
    read, offset = ctx.devices.skin.read, np.array([[4000.0], [0.0]])
    ctx.devices.skin.read = lambda: replace(read(), values=read().values + offset)
    scanned(ctx, limited=False)
    ctx.devices.clock.time = 0.2
    with pytest.raises(SkinUntrustedError, match="left finger: offset"):
        scanned(ctx)


# Hold.


def test_on_hold_the_arm_is_halted_and_no_time_counts(ctx):
    ctx.follow(here(ctx))
    answer(ctx, (Request.RUN, 3), (Request.HOLD, 50), (Request.RESUME, 110), (Request.RUN, 99))
    halts, halt = [], ctx.devices.arm.halt
    ctx.devices.arm.halt = lambda: (halts.append(ctx.devices.clock.now()), halt())
    held = []
    at(ctx, 40, lambda: held.append(ctx.devices.arm.is_halted))
    seen = scanned(ctx, 5)
    np.testing.assert_allclose([each.running for each in seen], [0.0, 0.01, 0.02, 0.03, 0.04])
    assert seen[3].stamp - seen[2].stamp == pytest.approx(161 * PERIOD)
    assert halts == [pytest.approx(3 * PERIOD)]  # an arm at rest is halted once
    assert (held, ctx.devices.arm.is_halted) == ([True], False)


def test_after_a_hold_the_arm_goes_back_in_a_second(ctx):
    held, way = here(ctx), []
    ctx.follow(held)
    answer(ctx, (Request.RUN, 1), (Request.HOLD, 10), (Request.RESUME, 120), (Request.RUN, 1))
    at(ctx, 5, lambda: place(ctx, held.tip, (0.0, 0.04)))
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
        place(ctx, middle, (0.5 * speed * PERIOD * (-1) ** scan, 0.0))
        ctx.follow(replace(ctx.lead.held, stiffness=stiffness))
    return ctx.lead.held.stiffness


def test_a_swing_of_high_energy_softens_its_own_motion(ctx):
    np.testing.assert_allclose(swung(ctx, 0.95 * SOFTEN, number=7), SOFT)
    np.testing.assert_allclose(swung(ctx, 0.5 * (SOFTEN + STOP)), 0.5 * SOFT)
    ctx.follow(here(ctx, number=2))
    np.testing.assert_allclose(ctx.lead.held.stiffness, SOFT)
    ctx.follow(here(ctx, number=1, stiffness=0.1 * SOFT))
    np.testing.assert_allclose(ctx.lead.held.stiffness, 0.1 * SOFT)
    np.testing.assert_allclose(swung(ctx, 0.5 * (SOFTEN + STOP), 0.6 * SOFT, number=2), 0.3 * SOFT)


def test_a_swing_beyond_the_force_limit_is_a_fault(ctx):
    words = r"1\.2 times the energy that presses with 60 N, at 800 N/m and 900 N·m/rad; less than 1 allowed"
    with pytest.raises(NotPassiveError, match=f"^skill: {words}$"):
        swung(ctx, 1.2, np.array([800.0, 700.0, 600.0, 900.0, 50.0, 40.0]))
    assert ctx.devices.arm.is_halted


def test_an_arm_shaken_on_hold_is_no_fault(ctx):
    answer(ctx, (Request.RUN, 1), (Request.HOLD, 9), (Request.RESUME, 120), (Request.RUN, 9))
    middle, sides = ctx.devices.arm.tcp.position.copy(), iter([0.01, -0.01] * 4)
    ctx.follow(here(ctx))
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, held: place(ctx, middle, (next(sides, 0.0), 0.0)))
    assert len(scanned(ctx)) == 3


@pytest.mark.parametrize(("is_free", "moment"), [(True, 0.0), (False, 0.3)])
def test_moment_on_the_peg_counts_only_in_contact(ctx, is_free, moment):
    felt, closing, read = [], ctx.devices.arm.tcp.rotation[:, 2], ctx.devices.arm.read
    ctx.devices.arm.read = lambda: replace(read(), wrench=Wrench(np.zeros(3), 0.3 * closing))
    follow = ctx.perception.tracker.follow
    tracker = SimpleNamespace(follow=lambda new, stamp, moment: felt.append(moment) or follow(new, stamp, moment))
    ctx.perception = replace(ctx.perception, tracker=tracker)
    ctx.follow(replace(here(ctx), is_free=is_free))
    scanned(ctx)
    assert felt == pytest.approx([moment] * 3)
