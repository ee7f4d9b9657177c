"""Every setpoint and every reading at the gate, at its limit and one beyond it."""

import itertools
import math
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from drivers import setpoint_words
from drivers.errors import ArmSilentError, NotFiniteError, SetpointError, TrackingError
from drivers.frames import UP, end_point
from drivers.quantities import ArmState, ImpedanceSetpoint, InHandTip, Pose, Twist, Wrench
from skills.guards.limits import Limits
from skills.guards.setpoint_bounds import (
    AGE_SLACK,
    LEAD,
    LONGEST_VALIDITY,
    MOST_ASKEW,
    MOST_DAMPING_RATIO,
    MOST_LENGTH,
    MOST_THETA,
    POSTURE_LEAD,
    POSTURE_SLACK,
    STEP_SLACK,
    TRACKING_LIMIT,
    ArmBounds,
)
from skills.guards.setpoint_gate import MOVED, NOTHING, TURNED, GatedArm, pack_bounds, require_readings, require_sound
from skills.guards.setpoint_rules import pack_state
from tests.fakes import HAND_DOWN, FakeClock
from tests.unit.skills.guards.test_rest import CountedArm

LIMITS = Limits(force=60.0, low=(0.2, -0.5, 0.05), high=(0.8, 0.45, 0.8))
SPEED, PERIOD = 3.0, 0.01
BOUNDS = ArmBounds(
    speed=SPEED,
    turn_speed=2.5,
    stiffness=3000.0,
    turn_stiffness=300.0,
    torques=(87.0,) * 4 + (12.0,) * 3,
    torque_rate=1000.0,
    q_min=(-2.0,) * 7,
    q_max=(2.5,) * 7,
    joint_speeds=(2.0,) * 4 + (3.0,) * 3,
)
HERE = np.array([0.5, 0.0, 0.3])
STIFF, SOFT = (np.array([along] * 3 + [40.0] * 3) for along in (1500.0, 100.0))
IN_HAND = InHandTip(0.0, 0.05)
STEP = SPEED * PERIOD + STEP_SLACK
"""Longest step of a setpoint within a scan, m."""


def arm_at(position=HERE, stamp=0.0):
    return ArmState(
        stamp, np.zeros(7), np.zeros(7), Pose(position, HAND_DOWN), Wrench(np.zeros(3), np.zeros(3)), 2, 0.0
    )


LATER = arm_at(stamp=PERIOD)


def setpoint(tip=HERE, **changes):
    return replace(ImpedanceSetpoint(1, tip, UP, STIFF, np.ones(6), 0.1), **changes)


def judge(arm=LATER, before=None, at=0.0, bounds=BOUNDS, **asked):
    """Check a setpoint that follows another, sent at a time, s, or begins a motion."""
    last = NOTHING if before is None else setpoint_words.pack(before, at)
    require_sound(setpoint_words.pack(setpoint(**asked), arm.stamp), pack_state(arm), last, pack_bounds(bounds, LIMITS))


def off(size):
    return HERE + np.array([size, 0.0, 0.0])


def going_on(tip, last, **asked):
    """Return a soft setpoint that goes on from another with its tip at `last`."""
    return {"tip": tip, "stiffness": SOFT, "before": setpoint(last, stiffness=SOFT), **asked}


def at_edge(axis, side, place, hand):
    """Return a setpoint so far outside the workspace, m, of a hand that is so far outside."""
    sense, asked, arm = 1.0 if side == "high" else -1.0, HERE.copy(), HERE.copy()
    asked[axis], arm[axis] = (getattr(LIMITS, side)[axis] + sense * beyond for beyond in (place, hand))
    return {"tip": asked, "arm": arm_at(arm)}


def with_peg(height):
    """Return a setpoint of a hand with a peg at this height, m."""
    hand = np.array([0.5, 0.0, height])
    near = np.clip(hand, LIMITS.low, LIMITS.high)
    return {"tip": hand - 0.05 * UP, "in_hand": IN_HAND, "arm": arm_at(near)}


def pressing(share):
    """Return a setpoint that goes on and presses with this share of the force limit."""
    stiffness = np.array([share * LIMITS.force / 0.0625] * 3 + [40.0] * 3)
    return going_on(off(0.0625), off(0.0625), stiffness=stiffness)


def leaning(angle):
    return {"axis": np.array([math.sin(angle), 0.0, math.cos(angle)])}


def rolled(angle):
    """Return the closing axis, turned about the hand's axis, rad."""
    return np.array([math.sin(angle), -math.cos(angle), 0.0])


def twisting(along=0.0, about=0.0):
    return {"twist": Twist(np.array([0.0, along, 0.0]), np.array([0.0, 0.0, about]))}


def begun(away, stiffness=SOFT, before=None):
    return {"tip": off(away), "stiffness": stiffness, "before": before}


def valid(until, now=0.0):
    return {"valid_until": until, "arm": arm_at(stamp=now)}


def stiff(place, value):
    return {"stiffness": np.where(np.arange(6) == place, value, 1.0)}


def damped(place, value):
    return {"damping_ratio": np.where(np.arange(6) == place, value, 1.0)}


def in_hand(theta, length):
    """Return a setpoint that stays where the hand is, with such a peg in it."""
    axis = np.array([math.sin(theta), 0.0, math.cos(theta)])
    return {"in_hand": InHandTip(theta, length), "tip": HERE - length * axis, "axis": axis}


def lying(theta):
    """Return the setpoint of a peg that lies so in the hand."""
    tip, axis = end_point(arm_at().tcp, theta, 0.05)
    return {"tip": tip, "axis": axis, "in_hand": InHandTip(theta, 0.05)}


def turned(place, askew, stiffness):
    return {**leaning(askew[0]), "roll": rolled(askew[1]), **stiff(place, stiffness)}


def posed(*turns):
    """Return a posture with joints turned by angles, rad."""
    posture = np.zeros(7)
    for joint, angle in turns:
        posture[joint] += angle
    return posture


def posing(posture, last):
    return {"posture": posture, "before": setpoint(posture=last)}


def outside(end, further):
    """Return a posture beside joints that are 0.1 rad outside their ranges, rad."""
    sense = math.copysign(1.0, end)
    q = np.full(7, end + 0.1 * sense)
    return {"arm": replace(arm_at(), q=q), "posture": q + further * sense}


NEAR, FAR = np.array([0.5, -0.4, 0.3]), np.array([0.5, 0.4, 0.3])
LAST, HOUR = setpoint(off(0.05), id=7, stiffness=SOFT), {"arm": arm_at(stamp=3600.0 + PERIOD), "at": 3600.0}
FAST = {"arm": arm_at(stamp=1.0), "bounds": replace(BOUNDS, speed=6.0)}
BEGINS_AND_STEPS = r"a motion that begins {} mm .*, and a step of {} mm; at most 20 mm or 31 mm allowed$"
ROWS = {
    "force of a motion": (pressing(1.0), pressing(1.001), "^arm: blocked, .* a setpoint 62 mm away presses with 60 N"),
    "force": (begun(0.0199, 2 * STIFF), begun(-0.0202, 2 * STIFF), r"20 mm .* 61 N; limits\.force = 60 N allowed$"),
    "lag": (
        *(going_on(place, place) for place in (off(TRACKING_LIMIT - 1e-4), off(TRACKING_LIMIT + 1e-4))),
        "^arm: blocked.* 100 mm from the controlled point; at most 100 mm allowed",
    ),
    "force far away": ({}, {"tip": FAR, "stiffness": SOFT, "arm": arm_at(NEAR)}, "800 mm away presses with 80 N"),
    "force at the end of the peg": ({"tip": HERE - 0.05 * UP, "in_hand": IN_HAND}, {"in_hand": IN_HAND}, "50 mm away"),
    "step": (*(going_on(off(STEP + more), HERE) for more in (-1e-4, 1e-4)), "step of 31 mm; at most 31 mm allowed$"),
    "step of no time": (
        {"tip": np.array([0.5, STEP_SLACK, 0.3]), "at": PERIOD, "before": setpoint()},
        going_on(off(0.1), HERE),
        "step of 100 mm",
    ),
    "long step": ({}, going_on(FAR, NEAR, **FAST), "step of 800 mm; at most 601 mm allowed"),
    "step after an hour": (*(going_on(off(way), HERE, **HOUR) for way in (0.031, 0.1)), "step of 100 mm; .* 31"),
    "axis": (leaning(MOST_ASKEW - 0.01), leaning(MOST_ASKEW + 0.01), r"axis 1\.01 rad .* at most 1\.0 rad allowed"),
    "high hand with a peg": (with_peg(0.799), with_peg(0.81), r"hand at z = 0\.810 m; limits: 0\.05 to 0\.8 m allowed"),
    "low hand with a peg": (with_peg(0.05), with_peg(0.01), r"hand at z = 0\.010 m"),
    "speed": (twisting(SPEED), twisting(1.01 * SPEED), r"speed 3\.03 m/s; 0 to 3 allowed"),
    "turning rate": (twisting(about=2.5), twisting(about=2.51), "turning rate 2.51 rad/s; 0 to 2.5 allowed"),
    "stiffness": (stiff(2, 3000.0), stiff(1, 3001.0), "stiffness 3001 N/m; 0 to 3000 allowed"),
    "turning": (stiff(3, 300.0), stiff(5, 301.0), "rotational stiffness 301 N·m/rad; 0 to 300 allowed"),
    "turning beyond stiffness": (stiff(5, 300.0), stiff(3, 3500.0), "rotational stiffness 3500 N·m/rad"),
    "damping": (damped(5, MOST_DAMPING_RATIO), damped(0, MOST_DAMPING_RATIO + 0.01), "ratio 10.01; 0 to 10 allowed"),
    "no stiffness": (stiff(2, 0.0), stiff(2, -1.0), "negative stiffness or damping ratio; at least 0 allowed$"),
    "no damping": (damped(4, 0.0), damped(4, -1.0), "negative stiffness or damping ratio"),
    "integral": ({"integral_limit": 12.0}, {"integral_limit": 12.01}, "integral_limit 12.01 N·m; 0 to 12 allowed"),
    "no integral": ({"integral_limit": 0.0}, {"integral_limit": -0.01}, "integral_limit -0.01 N·m; 0 to 12 allowed"),
    "gain": ({"integral_gain": 1e3}, {"integral_gain": 1001.0}, r"gain 1001 N·m/\(rad·s\); 0 to 1000 allowed"),
    "no gain": ({"integral_gain": 0.0}, {"integral_gain": -1.0}, r"gain -1 N·m/\(rad·s\); 0 to 1000 allowed"),
    "theta": (lying(MOST_THETA), in_hand(MOST_THETA + 0.001, 0.0), r"theta in the hand 3\.143 rad"),
    "-theta": (lying(-MOST_THETA), in_hand(-MOST_THETA - 0.001, 0.0), r"theta in the hand -3\.143 rad"),
    "length": (in_hand(0.0, MOST_LENGTH), in_hand(0.0, MOST_LENGTH + 0.001), r"length .* 0\.501 m; 0 to 0\.5 allowed"),
    "no length": (in_hand(0.0, 0.0), in_hand(0.0, -0.001), r"length in the hand -0\.001 m"),
    "validity": (valid(LONGEST_VALIDITY), valid(LONGEST_VALIDITY + 0.01), r"1\.01 s ahead; at most 1 s allowed$"),
    "endless validity": (valid(LONGEST_VALIDITY + 0.9 * AGE_SLACK), valid(math.inf), "valid_until inf s ahead"),
    "validity after a minute": (valid(60.0 + LONGEST_VALIDITY, 60.0), valid(60.5), "valid_until 60"),
    "beginning": (begun(LEAD - 1e-6), begun(LEAD + 0.001), "a motion that begins 21 mm .* is; at most 20 mm allowed$"),
    "beginning after another motion": (
        begun(LEAD - 1e-6, before=setpoint(off(-0.2), id=7)),
        begun(LEAD + 0.001, before=setpoint(off(-0.2), id=7)),
        BEGINS_AND_STEPS.format(21, 221),
    ),
    "new id": (begun(0.05 + STEP, before=LAST), begun(0.051 + STEP, before=LAST), BEGINS_AND_STEPS.format(82, 32)),
    "motion that takes the peg for its point": (
        going_on(off(0.05) - 0.05 * UP, off(0.05), in_hand=IN_HAND),
        going_on(off(0.05), off(0.05), in_hand=IN_HAND, arm=arm_at(off(0.02), PERIOD)),
        "a step of 50 mm",
    ),
    "joint above its range": (outside(2.5, 0.0), outside(2.5, 0.01), "posture of joint 1 = "),
    "joint below its range": (outside(-2.0, 0.0), outside(-2.0, 0.01), "posture of joint 1 = "),
    "posture under new ids": (
        {"posture": posed((3, 0.2)), "id": 2},
        {"posture": posed((3, 0.3)), "id": 3, "before": setpoint(id=2, posture=posed((3, 0.2)))},
        r"posture of joint 4 moves by 0\.100 rad; at most 0\.040 rad allowed",
    ),
}
for k, side in itertools.product(range(3), ("low", "high")):
    hand, words = f"{side} {'xyz'[k]}", f"hand at {'xyz'[k]} = "
    ROWS[f"hand at {hand}"] = at_edge(k, side, 0.9e-3, -0.01), at_edge(k, side, 1.1e-3, -0.01), words
    ROWS[f"hand beyond {hand}"] = at_edge(k, side, 0.015, 0.02), at_edge(k, side, 0.025, 0.02), words
for k, askew in itertools.product((3, 4, 5), ((0.5, 0.0), (0.0, 0.5), (0.3, 0.4))):
    # At 0.5 rad askew in all, 174 N·m/rad are 87 N·m.
    words = r"0\.50 rad askew turns with 87 N·m; at most 87 N·m allowed"
    ROWS[f"torque {k} at {askew}"] = turned(k, askew, 173.9), turned(k, askew, 174.2), words
for sense in (-1.0, 1.0):
    # A roll need be neither of unit length nor square to the axis.
    within, beyond = ({"roll": 2.0 * rolled(sense * (MOST_ASKEW + more)) + 3.0 * UP} for more in (-0.01, 0.01))
    ROWS[f"roll {sense}"] = within, beyond, r"roll 1\.01 rad .* 1\.0 rad allowed"
    for j, speed in ((0, 2.0), (2, 2.0), (6, 3.0)):
        start, step = posed((j, 0.5)), speed * PERIOD + POSTURE_SLACK
        slow, fast = (posing(start + sense * posed((j, step + more)), start) for more in (-1e-4, 1e-3))
        ROWS[f"speed {sense} of joint {j}"] = slow, fast, f"joint {j + 1} moves by {step + 1e-3:.3f} rad; at most"
    for j, end in itertools.product(range(7), (2.5 if sense > 0.0 else -2.0,)):
        inside, beyond = (posing(posed((j, end + more)), posed((j, end))) for more in (0.0, 0.01 * sense))
        words = rf"posture of joint {j + 1} = {end + 0.01 * sense:.3f} rad; -2 to 2\.5 allowed"
        ROWS[f"joint {j} at {end}"] = inside, beyond, words
for last in (None, setpoint(id=7), setpoint(id=7, posture=posed((0, 1.0)))):
    near, far = (
        posing(posed((0, lead), (2, 1.5)), None) | {"before": last} for lead in (POSTURE_LEAD, POSTURE_LEAD + 1e-3)
    )
    ROWS[f"posture after {len(ROWS)}"] = near, far, r"posture of joint [13] moves by"


@pytest.mark.parametrize(("at", "beyond", "words"), ROWS.values(), ids=ROWS)
def test_a_setpoint_is_permitted_at_each_bound_and_refused_beyond(at, beyond, words):
    judge(**at)
    with pytest.raises((SetpointError, TrackingError), match=words):
        judge(**beyond)


NO_NUMBERS = {
    "tip 2 of 3": {"tip": np.array([0.5, math.nan, 0.3])},
    "axis 1 of 3": {"axis": np.array([math.nan, 0.0, 1.0])},
    "stiffness 6 of 6": {"stiffness": np.array([1.0, 1.0, 1.0, 1.0, 1.0, math.inf])},
    "damping ratio 1 of 6": {"damping_ratio": np.array([math.nan, 1.0, 1.0, 1.0, 1.0, 1.0])},
    "integral 1 of 2": {"integral_gain": math.nan},
    "theta and length in the hand 1 of 2": {"in_hand": InHandTip(math.nan, 0.05)},
    "roll 3 of 3": {"roll": np.array([0.0, 1.0, math.nan])},
    "twist 4 of 6": {"twist": Twist(np.zeros(3), np.array([math.nan, 0.0, 0.0]))},
    "posture 7 of 7": {"posture": np.array([0.0] * 6 + [math.nan])},
    "valid_until nan; a number allowed$": {"valid_until": math.nan},
    "axis of length 2.000": {"axis": 2.0 * UP},
}


@pytest.mark.parametrize("named", NO_NUMBERS)
def test_what_is_no_number_or_no_setpoint_is_named(named):
    with pytest.raises(SetpointError, match=f"^setpoint: {named}"):
        judge(**NO_NUMBERS[named])


@pytest.mark.parametrize(
    ("named", "changes"),
    [
        ("joint position 3 of 7", {"q": np.array([0.0, 0.0, math.nan, 0.0, 0.0, 0.0, 0.0])}),
        ("joint velocity 1 of 7", {"dq": np.full(7, math.inf)}),
        ("force 2 of 3", {"wrench": Wrench(np.array([0.0, math.nan, 0.0]), np.zeros(3))}),
        ("torque 1 of 3", {"wrench": Wrench(np.zeros(3), np.full(3, math.nan))}),
        ("TCP position 1 of 3", {"tcp": Pose(np.full(3, math.nan), HAND_DOWN)}),
        ("TCP orientation 1 of 9", {"tcp": Pose(HERE, np.full((3, 3), math.nan))}),
        ("stamp 1 of 1", {"stamp": math.nan}),
        ("joint position 7 of 7", {"q": np.array([0.0] * 6 + [1e3])}),
        (r"force 3 of 3: 1e\+308; .* -10000 to 10000", {"wrench": Wrench(np.array([0, 0, 1e308]), np.zeros(3))}),
        ("unexplained torque 1 of 7", {"unexplained": np.full(7, math.inf)}),
    ],
)
def test_a_reading_of_the_arm_that_no_sensor_can_give_is_named(named, changes):
    with pytest.raises(NotFiniteError, match=f"arm: {named}"):
        require_readings(pack_state(replace(arm_at(), **changes)))


# The gate between the skills and an arm.


@pytest.fixture
def arm():
    return CountedArm(FakeClock())


@pytest.fixture
def gated(arm):
    return GatedArm(arm, BOUNDS, LIMITS)


def beside(arm, *away, **changes):
    """Return a soft setpoint so far from the hand, m, valid for ten scans."""
    tip = arm.tcp.position + np.array(away or (0.0, 0.0, 0.0))
    return setpoint(tip, **{"stiffness": SOFT, "valid_until": arm.clock.now() + 0.1, **changes})


@pytest.mark.parametrize(("number", "words"), [(1, "step of 72 mm"), (2, "begins 72 mm from where the arm is")])
def test_a_refused_setpoint_leaves_the_arm_halted(arm, gated, number, words):
    gated.follow(beside(arm, id=1))
    before = arm.tcp
    with pytest.raises(SetpointError, match=words):
        gated.follow(beside(arm, 0.0, 0.072, 0.0, id=number))
    assert (arm.is_halted, arm.tcp) == (True, before)


def test_an_arm_whose_readings_are_no_numbers_is_halted_once(arm, gated):
    """If it were halted at every scan, it would sink by the error of its gravity model."""
    gated.follow(beside(arm))
    arm.q[2] = math.nan
    for _ in range(3):
        with pytest.raises(NotFiniteError):
            gated.read()
    assert arm.halts == 1


def led(arm, gated, scans, step=0.0):
    """Lead an arm by a step, m, in each scan of 10 ms."""
    start = arm.tcp.position.copy()
    for scan in range(scans):
        gated.read()
        tip = start + scan * np.array([0.0, 0.0, step])
        gated.follow(setpoint(tip, valid_until=arm.clock.now() + 0.1, stiffness=SOFT))
        arm.clock.wait_until(arm.clock.now() + PERIOD)


def test_readings_that_stand_still_are_a_fault_in_time(arm, gated):
    arm.is_blocked = True
    led(arm, gated, 100, -5e-5)  # its readings have noise
    arm.is_frozen = True
    led(arm, gated, 15, -5e-5)
    with pytest.raises(ArmSilentError):
        led(arm, gated, 6, -5e-5)
    assert arm.is_halted


def test_a_noisy_force_that_stands_still_at_rest_is_a_fault(arm, gated):
    arm.force = np.array([0.0, 0.0, -5.0])
    led(arm, gated, 2)
    gated.halt()
    arm.is_frozen = True
    for step in [PERIOD] * 15 + [2.0 * PERIOD] * 3:
        arm.clock.wait_until(arm.clock.now() + step)
        with pytest.raises(ArmSilentError) if step > PERIOD else nullcontext():
            gated.read()
    assert arm.halts == 1
    arm.is_frozen = False
    gated.read()


@pytest.mark.parametrize(("noise", "is_fault"), [(1e-9, True), (0.0, False)])
def test_a_noisy_force_that_stands_still_in_motion_is_a_fault(gated, arm, noise, is_fault):
    forces, read = itertools.chain([0.2 + noise], itertools.repeat(0.2)), arm.read
    arm.read = lambda: replace(read(), wrench=Wrench(np.array([0.0, 0.0, next(forces)]), np.zeros(3)))
    led(arm, gated, 16, -5e-5)
    with pytest.raises(ArmSilentError) if is_fault else nullcontext():
        led(arm, gated, 5, -5e-5)


@pytest.mark.parametrize(("way", "is_fault"), [(0.0, False), (0.999 * MOVED, False), (1.001 * MOVED, True)])
def test_an_arm_at_exact_rest_is_a_fault_once_its_setpoint_moves(arm, gated, way, is_fault):
    arm.is_frozen = arm.is_blocked = True
    with pytest.raises(ArmSilentError) if is_fault else nullcontext():
        led(arm, gated, 100, -way / 99)
        gated.read()


@pytest.mark.parametrize(("angle", "is_fault"), [(0.999 * TURNED, False), (1.001 * TURNED, True)])
def test_an_arm_at_exact_rest_is_a_fault_once_its_axis_turns(arm, gated, angle, is_fault):
    arm.is_frozen = arm.is_blocked = True
    gated.follow(beside(arm))
    gated.read()
    arm.clock.time += 0.09
    gated.read()
    half = 2.0 * math.asin(angle / 2.0)  # the angle whose chord is compared
    gated.follow(beside(arm, **leaning(half)))
    arm.clock.time += 0.09
    with pytest.raises(ArmSilentError) if is_fault else nullcontext():
        gated.read()


def test_after_a_halt_or_reset_a_setpoint_begins_a_motion(arm, gated):
    gated.follow(beside(arm))
    gated.halt()
    arm.tcp = Pose(np.array([0.6, 0.1, 0.3]), HAND_DOWN)
    gated.read()
    gated.follow(beside(arm))
    assert not arm.is_halted
    with pytest.raises(SetpointError, match="step of 15 mm"):
        gated.follow(beside(arm, 0.0, 0.015, 0.0))
    gated.reset()
    gated.follow(beside(arm, 0.0, 0.015, 0.0))
    assert not arm.is_halted


def test_a_setpoint_is_judged_by_the_newest_state(arm, gated):
    gated.follow(beside(arm))
    gated.follow(beside(arm))
    gated.read()
    gated.follow(beside(arm))
    assert arm.reads == 2


def test_an_arm_is_halted_if_it_adopts_no_setpoint(arm, gated):
    follow, arm.is_blocked = arm.follow, True  # it takes its setpoints and stays where it is
    led(arm, gated, 100)
    arm.follow = lambda asked: None
    began = arm.clock.now()
    with pytest.raises(TrackingError, match=r"arm: adopted no setpoint for 0\.2\d s; 0\.2 s allowed"):
        led(arm, gated, 100)
    assert arm.clock.now() - began < 0.25
    assert arm.is_halted
    arm.follow = follow
    gated.read()  # halted, it is asked for nothing


def test_a_setpoint_whose_time_is_over_need_not_be_followed(arm, gated):
    gated.follow(beside(arm))
    for _ in range(100):
        arm.clock.wait_until(arm.clock.now() + PERIOD)
        gated.read()
