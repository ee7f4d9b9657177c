"""Every setpoint and every reading at the gate, at its limit and one beyond it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers import setpoint_words
from drivers.errors import ArmSilentError, NotFiniteError, SetpointError, TrackingError
from drivers.frames import end_point
from drivers.quantities import ArmState, ImpedanceSetpoint, InHandTip, Pose, TaxelFrame, Twist, Wrench
from skills.guards.limits import Limits
from skills.guards.scan_guards import require_finite_skin, require_finite_theta
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
from skills.tactile.pose import NO_PEG
from tests.fakes import HAND_DOWN, FakeArm, FakeClock

LIMITS = Limits(force=60.0, low=(0.2, -0.5, 0.05), high=(0.8, 0.45, 0.8))
SPEED, STIFF, PERIOD = 3.0, 1500.0, 0.01
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
UP = np.array([0.0, 0.0, 1.0])


def arm_at(position=HERE, stamp=0.0):
    return ArmState(
        stamp, np.zeros(7), np.zeros(7), Pose(position, HAND_DOWN), Wrench(np.zeros(3), np.zeros(3)), 2, 0.0
    )


def setpoint(tip=HERE, **changes):
    made = ImpedanceSetpoint(1, tip, UP, np.array([STIFF] * 3 + [40.0] * 3), np.ones(6), 0.1)
    return replace(made, **changes)


def judge(asked, arm=None, before=None, bounds=BOUNDS):
    arm, last = arm or arm_at(), NOTHING if before is None else setpoint_words.pack(*before)
    require_sound(setpoint_words.pack(asked, arm.stamp), pack_state(arm), last, pack_bounds(bounds, LIMITS))


def off(size):
    return HERE + np.array([size, 0.0, 0.0])


def test_where_the_arm_is_it_may_stay():
    judge(setpoint())


@pytest.mark.parametrize("share", [0.999, -0.999])
def test_a_setpoint_may_press_up_to_the_force_limit(share):
    asked = setpoint(off(share * LIMITS.force / STIFF))
    judge(asked, before=(asked, 0.0))


def test_a_step_of_90_mm_is_refused_with_the_force_that_it_would_press_with():
    with pytest.raises(SetpointError, match=r"90 mm away presses with 135 N; limits\.force = 60 N allowed"):
        judge(setpoint(off(0.09)))


def test_the_force_is_that_at_the_end_of_the_peg_in_the_hand():
    in_hand = InHandTip(0.0, 0.05, 0.0)
    judge(setpoint(HERE - 0.05 * UP, in_hand=in_hand))
    with pytest.raises(SetpointError, match="50 mm away"):
        judge(setpoint(HERE, in_hand=in_hand))


def test_an_arm_that_stays_behind_its_setpoint_is_blocked():
    before = (setpoint(off(0.039)), 0.0)
    with pytest.raises(TrackingError, match="blocked"):
        judge(setpoint(off(0.041)), arm_at(stamp=PERIOD), before)


@pytest.mark.parametrize(("beyond", "is_sound"), [(-1e-4, True), (1e-4, False)])
def test_a_soft_arm_may_lag_behind_its_setpoint_by_100_mm(beyond, is_sound):
    asked = setpoint(off(TRACKING_LIMIT + beyond), stiffness=np.array([100.0] * 3 + [40.0] * 3))
    if is_sound:
        judge(asked, before=(asked, 0.0))
        return
    with pytest.raises(TrackingError, match=r"blocked.*100 mm from the controlled point; at most 100 mm allowed"):
        judge(asked, before=(asked, 0.0))


@pytest.mark.parametrize(("beyond", "is_sound"), [(-1e-4, True), (1e-4, False)])
def test_a_setpoint_moves_no_faster_than_the_arm_s_tool(beyond, is_sound):
    step = SPEED * PERIOD + STEP_SLACK + beyond
    soft = np.array([100.0] * 3 + [40.0] * 3)
    before = (setpoint(HERE, stiffness=soft), 0.0)
    asked = setpoint(off(step), stiffness=soft)
    if is_sound:
        judge(asked, arm_at(stamp=PERIOD), before)
        return
    with pytest.raises(SetpointError, match="step of 31 mm; at most 31 mm allowed"):
        judge(asked, arm_at(stamp=PERIOD), before)


@pytest.mark.parametrize(("speed", "is_sound"), [(SPEED, True), (1.01 * SPEED, False)])
def test_no_faster_twist_is_fed_forward(speed, is_sound):
    asked = setpoint(twist=Twist(np.array([0.0, speed, 0.0]), np.zeros(3)))
    if is_sound:
        judge(asked)
        return
    with pytest.raises(SetpointError, match=r"speed 3\.03 m/s"):
        judge(asked)


@pytest.mark.parametrize(("askew", "is_sound"), [(MOST_ASKEW - 0.01, True), (MOST_ASKEW + 0.01, False)])
def test_no_setpoint_turns_the_hand_away_at_once(askew, is_sound):
    asked = setpoint(axis=np.array([math.sin(askew), 0.0, math.cos(askew)]))
    if is_sound:
        judge(asked)
        return
    with pytest.raises(SetpointError, match=r"axis 1\.01 rad"):
        judge(asked)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", ["low", "high"])
def test_the_hand_is_asked_to_stay_in_the_workspace(axis, side):
    edge = np.array(getattr(LIMITS, side))
    outward = 1.0 if side == "high" else -1.0
    place = HERE.copy()
    place[axis] = edge[axis] + outward * 0.0009
    hand = place.copy()
    hand[axis] = edge[axis] - outward * 0.01
    judge(setpoint(place), arm_at(hand))
    place[axis] += outward * 0.0002
    with pytest.raises(SetpointError, match=f"{'xyz'[axis]} = "):
        judge(setpoint(place), arm_at(hand))


@pytest.mark.parametrize(
    ("height", "is_sound"), [(LIMITS.low[2], True), (LIMITS.high[2] - 0.001, True), (LIMITS.high[2] + 0.01, False)]
)
def test_with_a_peg_in_it_the_hand_stays_in_the_workspace_and_not_the_end_of_the_peg(height, is_sound):
    in_hand, here = InHandTip(0.0, 0.05, 0.0), np.array([0.5, 0.0, min(height, LIMITS.high[2])])
    asked = setpoint(np.array([0.5, 0.0, height]) - 0.05 * UP, in_hand=in_hand)
    if is_sound:
        judge(asked, arm_at(here))
        return
    with pytest.raises(SetpointError, match=r"hand at z = 0\.810 m"):
        judge(asked, arm_at(here))


def test_a_hand_outside_the_workspace_is_led_back_and_no_further_out():
    outside = np.array([LIMITS.high[0] + 0.02, 0.0, 0.3])
    judge(setpoint(outside - np.array([0.005, 0.0, 0.0])), arm_at(outside))
    with pytest.raises(SetpointError, match=r"x = 0\.825"):
        judge(setpoint(outside + np.array([0.005, 0.0, 0.0])), arm_at(outside))


NO_NUMBERS = {
    "tip 2 of 3": {"tip": np.array([0.5, math.nan, 0.3])},
    "axis 1 of 3": {"axis": np.array([math.nan, 0.0, 1.0])},
    "stiffness 6 of 6": {"stiffness": np.array([1.0, 1.0, 1.0, 1.0, 1.0, math.inf])},
    "damping ratio 1 of 6": {"damping_ratio": np.array([math.nan, 1.0, 1.0, 1.0, 1.0, 1.0])},
    "integral 1 of 2": {"integral_gain": math.nan},
    "theta and length in the hand 1 of 2": {"in_hand": InHandTip(math.nan, 0.05, 0.0)},
    "roll 3 of 3": {"roll": np.array([0.0, 1.0, math.nan])},
    "twist 4 of 6": {"twist": Twist(np.zeros(3), np.array([math.nan, 0.0, 0.0]))},
    "posture 7 of 7": {"posture": np.array([0.0] * 6 + [math.nan])},
    "valid_until": {"valid_until": math.nan},
    "axis of length 2.000": {"axis": 2.0 * UP},
    "negative stiffness": {"stiffness": np.full(6, -1.0)},
    "negative stiffness or damping ratio": {"damping_ratio": np.full(6, -1.0)},
}


@pytest.mark.parametrize("named", NO_NUMBERS)
def test_what_is_no_number_or_no_setpoint_is_named(named):
    with pytest.raises(SetpointError, match=f"setpoint: {named}"):
        judge(setpoint(**NO_NUMBERS[named]))


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
        (
            "force 3 of 3: 1e\\+308; a number from -10000 to 10000",
            {"wrench": Wrench(np.array([0, 0, 1e308]), np.zeros(3))},
        ),
        ("unexplained torque 1 of 7", {"unexplained": np.full(7, math.inf)}),
    ],
)
def test_a_reading_of_the_arm_that_no_sensor_can_give_is_named(named, changes):
    with pytest.raises(NotFiniteError, match=f"arm: {named}"):
        require_readings(pack_state(replace(arm_at(), **changes)))


def test_a_trusted_taxel_that_is_no_number_is_named_and_an_untrusted_one_is_borne():
    values, trusted = np.zeros((2, 20)), np.ones((2, 20), dtype=bool)
    for wrong in (math.nan, -math.inf, 65536.0):
        values[1, 7] = wrong
        with pytest.raises(NotFiniteError, match=f"skin: right taxel 7: {wrong}"):
            require_finite_skin(TaxelFrame(values, trusted, 0.0, 1))
    trusted[1, 7] = False
    require_finite_skin(TaxelFrame(values, trusted, 0.0, 1))


def test_a_healthy_theta_that_is_no_number_is_a_fault():
    require_finite_theta(replace(NO_PEG, theta=math.nan))
    with pytest.raises(NotFiniteError, match="theta: nan"):
        require_finite_theta(replace(NO_PEG, theta=math.nan, healthy=True))


def test_whoever_is_refused_leaves_the_arm_halted_and_what_it_held_untouched():
    arm = FakeArm(FakeClock())
    gated = GatedArm(arm, BOUNDS, LIMITS)
    before = arm.tcp
    with pytest.raises(SetpointError):
        gated.follow(setpoint(arm.tcp.position + np.array([0.0, 0.0, 0.09])))
    assert arm.is_halted
    assert arm.tcp is before


def test_an_arm_that_tells_no_number_is_halted_once_and_not_at_every_reading():
    """Halted at every scan it would sink by what its model of gravity lacks, as long as the cell stands aborted."""
    arm = FakeArm(FakeClock())
    gated, halts, halt = GatedArm(arm, BOUNDS, LIMITS), [], arm.halt
    arm.halt = lambda: (halts.append(1), halt())
    gated.follow(setpoint(arm.tcp.position.copy()))
    arm.q[2] = math.nan
    for _ in range(3):
        with pytest.raises(NotFiniteError):
            gated.read()
    assert len(halts) == 1


def led(arm, steps, step):
    """Lead an arm through the gate by a step in each scan of 10 ms; return the time at which it is a fault, s."""
    gated = GatedArm(arm, BOUNDS, LIMITS)
    start = arm.tcp.position.copy()
    for scan in range(steps):
        gated.follow(
            setpoint(start + scan * np.array([0.0, 0.0, step]), valid_until=arm.clock.time + 0.1, stiffness=SOFT)
        )
        arm.clock.time += PERIOD
        try:
            gated.read()
        except ArmSilentError:
            return arm.clock.time if arm.is_halted else None
    return None


def test_readings_that_stand_still_are_a_fault_within_a_fifth_of_a_second():
    arm = FakeArm(FakeClock())
    arm.is_blocked = True
    assert led(arm, 100, -5e-5) is None  # its readings have noise
    arm.is_frozen = True
    began = arm.clock.time
    assert led(arm, 100, -5e-5) - began <= 0.2


def test_readings_that_stand_still_for_less_are_borne():
    arm = FakeArm(FakeClock())
    arm.is_frozen = arm.is_blocked = True
    assert led(arm, 15, -5e-5) is None


@pytest.mark.parametrize(("way", "is_fault"), [(0.0, False), (0.999 * MOVED, False), (1.001 * MOVED, True)])
def test_an_arm_at_exact_rest_is_a_fault_only_once_its_setpoint_has_moved(way, is_fault):
    arm = FakeArm(FakeClock())
    arm.is_frozen = arm.is_blocked = True
    scans = 100
    assert (led(arm, scans, -way / (scans - 1)) is not None) == is_fault


@pytest.mark.parametrize(("angle", "is_fault"), [(0.999 * TURNED, False), (1.001 * TURNED, True)])
def test_an_arm_at_exact_rest_is_a_fault_only_once_its_axis_has_turned(angle, is_fault):
    arm = FakeArm(FakeClock())
    gated, place = GatedArm(arm, BOUNDS, LIMITS), arm.tcp.position.copy()
    arm.is_frozen = arm.is_blocked = True
    gated.follow(setpoint(place))
    gated.read()
    arm.clock.time += 0.09
    gated.read()
    half = 2.0 * math.asin(angle / 2.0)  # the angle whose chord is compared
    gated.follow(setpoint(place, axis=np.array([math.sin(half), 0.0, math.cos(half)]), valid_until=0.2))
    arm.clock.time += 0.09
    if is_fault:
        with pytest.raises(ArmSilentError):
            gated.read()
    else:
        gated.read()


def test_after_a_halt_a_setpoint_is_judged_from_where_the_arm_is():
    arm = FakeArm(FakeClock())
    gated = GatedArm(arm, BOUNDS, LIMITS)
    gated.follow(setpoint(arm.tcp.position.copy()))
    gated.halt()
    arm.tcp = Pose(np.array([0.6, 0.1, 0.3]), HAND_DOWN)
    gated.read()
    gated.follow(setpoint(arm.tcp.position.copy()))
    assert not arm.is_halted


def test_a_setpoint_is_judged_by_the_state_that_the_scan_has_read_and_by_a_fresh_one_before_the_first(monkeypatch):
    arm = FakeArm(FakeClock())
    gated, reads, read = GatedArm(arm, BOUNDS, LIMITS), [], arm.read
    monkeypatch.setattr(arm, "read", lambda: reads.append(1) or read())
    gated.follow(setpoint(arm.tcp.position.copy()))
    gated.follow(setpoint(arm.tcp.position.copy()))
    gated.read()
    gated.follow(setpoint(arm.tcp.position.copy()))
    assert len(reads) == 2


def test_an_arm_that_takes_no_setpoint_is_told_and_halted_and_one_that_lags_is_not():
    clock = FakeClock()
    arm = FakeArm(clock)
    gated, follow, tip = GatedArm(arm, BOUNDS, LIMITS), arm.follow, arm.tcp.position.copy()
    arm.is_blocked = True  # it takes its setpoints and stays where it is
    for _ in range(100):
        gated.read()
        gated.follow(setpoint(tip - 0.015 * UP, valid_until=clock.now() + 0.1))
        clock.wait_until(clock.now() + PERIOD)
    arm.follow = lambda asked: None
    began = clock.now()

    def go_on():
        while clock.now() < began + 1.0:
            gated.read()
            gated.follow(setpoint(tip - 0.015 * UP, valid_until=clock.now() + 0.1))
            clock.wait_until(clock.now() + PERIOD)

    with pytest.raises(TrackingError, match=r"arm: takes no setpoint for 0\.2\d s; 0\.2 s allowed"):
        go_on()
    assert clock.now() - began < 0.25
    assert arm.is_halted
    arm.follow = follow
    gated.read()  # halted, it is asked for nothing


def test_a_setpoint_whose_time_is_over_need_not_be_followed():
    clock = FakeClock()
    gated = GatedArm(FakeArm(clock), BOUNDS, LIMITS)
    gated.read()
    gated.follow(setpoint(gated.read().tcp.position, valid_until=0.1))
    for _ in range(100):
        clock.wait_until(clock.now() + PERIOD)
        gated.read()


# Exactly at a limit, with lengths that no number rounds.

SOFT = np.array([100.0] * 3 + [40.0] * 3)


def test_a_setpoint_may_press_with_exactly_the_force_limit():
    asked = setpoint(off(0.0625), stiffness=np.array([LIMITS.force / 0.0625] * 3 + [40.0] * 3))
    judge(asked, before=(asked, 0.0))


def test_a_setpoint_may_step_by_exactly_what_the_time_since_the_last_one_allows():
    aside = HERE + np.array([0.0, STEP_SLACK, 0.0])
    judge(setpoint(aside), before=(setpoint(), 0.0))


def test_a_setpoint_may_be_without_stiffness_along_an_axis():
    judge(setpoint(stiffness=np.array([STIFF, STIFF, 0.0, 40.0, 40.0, 40.0])))


# A motion and the one before it.


def test_a_step_is_judged_by_the_time_since_the_last_setpoint_however_long_the_cell_runs():
    before = (setpoint(stiffness=SOFT), 3600.0)
    with pytest.raises(SetpointError, match="step of 100 mm; at most 31 mm allowed"):
        judge(setpoint(off(0.1), stiffness=SOFT), arm_at(stamp=3600.0 + PERIOD), before)


def test_a_new_motion_begins_where_the_arm_is_and_not_where_the_last_one_was():
    judge(setpoint(id=2), arm_at(stamp=PERIOD), (setpoint(off(0.2)), 0.0))


def test_a_motion_that_takes_the_peg_for_its_point_makes_no_step():
    in_hand = InHandTip(0.0, 0.05, 0.0)
    judge(setpoint(HERE - 0.05 * UP, in_hand=in_hand), arm_at(stamp=PERIOD), (setpoint(), 0.0))


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", range(3))
def test_a_hand_outside_the_workspace_is_led_back_on_every_side(axis, side):
    outside = HERE.copy()
    outside[axis] = (LIMITS.high if side > 0.0 else LIMITS.low)[axis] + side * 0.02
    inward = outside.copy()
    inward[axis] -= side * 0.005
    judge(setpoint(inward), arm_at(outside))


def test_the_gate_of_an_arm_remembers_the_last_setpoint_until_it_is_reset():
    arm = FakeArm(FakeClock())
    gated, tip = GatedArm(arm, BOUNDS, LIMITS), arm.tcp.position.copy()
    aside = setpoint(tip + np.array([0.0, 0.015, 0.0]), stiffness=SOFT)
    gated.follow(setpoint(tip, stiffness=SOFT))
    with pytest.raises(SetpointError, match="step of 15 mm"):
        gated.follow(aside)
    gated.reset()
    gated.follow(aside)
    assert not arm.is_halted


# Messages.


def test_lengths_are_told_to_a_millimetre():
    far, near = np.array([0.5, 0.4, 0.3]), np.array([0.5, -0.45, 0.3])
    with pytest.raises(SetpointError, match="850 mm away presses with 85 N"):
        judge(setpoint(far, stiffness=SOFT), arm_at(near))
    before = (setpoint(near, stiffness=SOFT), 0.0)
    with pytest.raises(SetpointError, match="step of 850 mm; at most 601 mm allowed"):
        judge(setpoint(far, stiffness=SOFT), arm_at(stamp=1.0), before, replace(BOUNDS, speed=6.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"valid_until": math.nan}, "valid_until nan; a number allowed"),
        ({"stiffness": np.full(6, -1.0)}, "negative stiffness or damping ratio; at least 0 allowed"),
    ],
)
def test_what_is_wrong_is_told_with_what_is_allowed(changes, words):
    with pytest.raises(SetpointError, match=f"^setpoint: {words}$"):
        judge(setpoint(**changes))


# Permitted setpoints, at each bound and beyond it.


def turning(rate):
    return {"twist": Twist(np.zeros(3), np.array([0.0, 0.0, rate]))}


def in_hand(theta, length):
    """Return the changes of a setpoint that stays where the hand is, with such a peg in it."""
    axis = np.array([math.sin(theta), 0.0, math.cos(theta)])
    return {"in_hand": InHandTip(theta, length, 0.0), "tip": HERE - length * axis, "axis": axis}


AT_AND_BEYOND = {
    "turning rate 2.51 rad/s; 0 to 2.5 allowed": (turning(2.5), turning(2.51)),
    "stiffness 3001 N/m; 0 to 3000 allowed": (
        {"stiffness": np.array([1.0, 1.0, 3000.0, 1.0, 1.0, 1.0])},
        {"stiffness": np.array([1.0, 3001.0, 1.0, 1.0, 1.0, 1.0])},
    ),
    "rotational stiffness 301 N·m/rad; 0 to 300 allowed": (
        {"stiffness": np.array([1.0, 1.0, 1.0, 300.0, 1.0, 1.0])},
        {"stiffness": np.array([1.0, 1.0, 1.0, 1.0, 1.0, 301.0])},
    ),
    "rotational stiffness 3500 N·m/rad; 0 to 300 allowed": (
        {"stiffness": np.array([1.0, 1.0, 1.0, 1.0, 1.0, 300.0])},
        {"stiffness": np.array([1.0, 1.0, 1.0, 3500.0, 1.0, 1.0])},
    ),
    "damping ratio 10.01; 0 to 10 allowed": (
        {"damping_ratio": np.array([1.0, 1.0, 1.0, 1.0, 1.0, MOST_DAMPING_RATIO])},
        {"damping_ratio": np.array([MOST_DAMPING_RATIO + 0.01, 1.0, 1.0, 1.0, 1.0, 1.0])},
    ),
    "integral_limit 12.01 N·m; 0 to 12 allowed": ({"integral_limit": 12.0}, {"integral_limit": 12.01}),
    "integral_limit -0.01 N·m; 0 to 12 allowed": ({"integral_limit": 0.0}, {"integral_limit": -0.01}),
    r"integral_gain 1001 N·m/\(rad·s\); 0 to 1000 allowed": ({"integral_gain": 1000.0}, {"integral_gain": 1001.0}),
    r"integral_gain -1 N·m/\(rad·s\); 0 to 1000 allowed": ({"integral_gain": 0.0}, {"integral_gain": -1.0}),
    r"theta in the hand 3\.143 rad": ({}, in_hand(MOST_THETA + 0.001, 0.0)),
    r"theta in the hand -3\.143 rad": ({}, in_hand(-MOST_THETA - 0.001, 0.0)),
    r"length in the hand 0\.501 m; 0 to 0\.5 allowed": ({}, in_hand(0.0, MOST_LENGTH + 0.001)),
    r"length in the hand -0\.001 m; 0 to 0\.5 allowed": (in_hand(0.0, 0.0), in_hand(0.0, -0.001)),
    r"valid_until 1\.01 s ahead; at most 1 s allowed": (
        {"valid_until": LONGEST_VALIDITY},
        {"valid_until": LONGEST_VALIDITY + 0.01},
    ),
    "valid_until inf s ahead": ({"valid_until": LONGEST_VALIDITY + 0.9 * AGE_SLACK}, {"valid_until": math.inf}),
}


@pytest.mark.parametrize("told", AT_AND_BEYOND)
def test_what_the_arm_may_not_be_asked_for_is_told_with_what_is_allowed(told):
    at, beyond = AT_AND_BEYOND[told]
    judge(setpoint(**at))
    with pytest.raises(SetpointError, match=f"^setpoint: {told}"):
        judge(setpoint(**beyond))


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_peg_may_lie_at_any_angle_in_the_hand(sense):
    here = arm_at()
    tip, axis = end_point(here.tcp, sense * MOST_THETA, 0.05)
    judge(setpoint(tip, axis=axis, in_hand=InHandTip(sense * MOST_THETA, 0.05, 0.0)), here)


@pytest.mark.parametrize("length", [0.0, MOST_LENGTH])
def test_a_peg_may_reach_as_far_out_of_the_hand_as_a_job_may_say(length):
    judge(setpoint(HERE - length * UP, in_hand=InHandTip(0.0, length, 0.0)))


def test_a_setpoint_is_valid_for_so_long_from_the_arm_s_state_on():
    judge(setpoint(valid_until=60.0 + LONGEST_VALIDITY), arm_at(stamp=60.0))
    with pytest.raises(SetpointError, match="valid_until 60"):
        judge(setpoint(valid_until=60.5))


def rolled(angle):
    """Return the closing axis, turned about the hand's axis, rad."""
    return np.array([math.sin(angle), -math.cos(angle), 0.0])


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_no_roll_turns_the_hand_away_at_once(sense):
    judge(setpoint(roll=rolled(sense * (MOST_ASKEW - 0.01))))
    judge(setpoint(roll=2.0 * rolled(0.5) + 3.0 * UP))
    with pytest.raises(SetpointError, match=r"roll 1\.01 rad from the closing axis; at most 1\.0 rad allowed"):
        judge(setpoint(roll=rolled(sense * (MOST_ASKEW + 0.01))))


@pytest.mark.parametrize("stiff", [3, 4, 5])
@pytest.mark.parametrize(("askew", "angle"), [(0.5, 0.0), (0.0, 0.5), (0.3, 0.4)])
def test_no_setpoint_turns_with_more_torque_than_a_joint_has(askew, angle, stiff):
    """At 0.5 rad askew in all, 174 N·m/rad are 87 N·m."""
    axis = np.array([math.sin(askew), 0.0, math.cos(askew)])
    roll = rolled(angle)

    def asked(stiffness):
        return setpoint(axis=axis, roll=roll, stiffness=np.where(np.arange(6) == stiff, stiffness, 1.0))

    judge(asked(173.9))
    with pytest.raises(SetpointError, match=r"0\.50 rad askew turns with 87 N·m; at most 87 N·m allowed"):
        judge(asked(174.2))


# A motion that begins.


@pytest.mark.parametrize("before", [None, (setpoint(off(-0.05), id=7), 0.0)])
def test_a_motion_begins_no_further_than_its_lead_from_where_the_arm_is(before):
    judge(setpoint(off(LEAD - 1e-6), stiffness=SOFT), arm_at(stamp=PERIOD), before)
    with pytest.raises(SetpointError, match=r"begins 21 mm from where the arm is.*; at most 20 mm "):
        judge(setpoint(off(LEAD + 0.001), stiffness=SOFT), arm_at(stamp=PERIOD), before)


def test_how_far_a_motion_begins_from_the_arm_is_told_to_a_millimetre():
    near, far = np.array([0.5, -0.4, 0.3]), np.array([0.5, 0.4, 0.3])
    with pytest.raises(SetpointError, match=r"begins 800 mm from where the arm is; at most 20 mm allowed$"):
        judge(setpoint(far, stiffness=np.ones(6)), arm_at(near))
    with pytest.raises(SetpointError, match=r"begins 800 mm .* and a step of 800 mm; at most 20 mm or 301 mm allowed$"):
        judge(setpoint(far, stiffness=np.ones(6)), arm_at(near, stamp=1.0), (setpoint(near, id=7), 0.0))


def test_a_motion_with_a_new_id_may_go_on_from_the_setpoint_before_it_at_the_arm_s_speed():
    before = (setpoint(off(0.05), stiffness=SOFT, id=7), 0.0)
    judge(setpoint(off(0.05 + SPEED * PERIOD + STEP_SLACK), stiffness=SOFT), arm_at(stamp=PERIOD), before)
    with pytest.raises(
        SetpointError, match=r"begins 82 mm from where the arm is, and a step of 32 mm; at most 20 mm or 31"
    ):
        judge(setpoint(off(0.051 + SPEED * PERIOD + STEP_SLACK), stiffness=SOFT), arm_at(stamp=PERIOD), before)


def test_a_motion_that_takes_the_peg_for_its_point_goes_on_where_the_hand_was_asked_to_be():
    before = (setpoint(off(0.05), stiffness=SOFT), 0.0)
    asked = setpoint(off(0.05) - 0.05 * UP, in_hand=InHandTip(0.0, 0.05, 0.0), stiffness=SOFT)
    judge(asked, arm_at(stamp=PERIOD), before)
    with pytest.raises(SetpointError, match="a step of 50 mm"):
        judge(replace(asked, tip=off(0.05)), arm_at(off(0.02), stamp=PERIOD), before)


def test_a_skill_that_gives_every_setpoint_a_new_id_cannot_make_the_arm_jump():
    arm = FakeArm(FakeClock())
    arm.is_blocked = True
    gated, here = GatedArm(arm, BOUNDS, LIMITS), arm.tcp.position.copy()
    gated.follow(setpoint(here, id=1, stiffness=np.array([800.0] * 3 + [40.0] * 3)))
    with pytest.raises(SetpointError, match="begins 72 mm from where the arm is"):
        gated.follow(setpoint(here + np.array([0.0, 0.072, 0.0]), id=2, stiffness=np.array([800.0] * 3 + [40.0] * 3)))
    assert arm.is_halted


# The posture.


def posed(*turned, q=0.0):
    """Return a posture with joints turned from `q`, rad."""
    posture = np.full(7, q)
    for joint, angle in turned:
        posture[joint] += angle
    return posture


@pytest.mark.parametrize("joint", range(7))
def test_a_posture_lies_within_the_range_of_every_joint(joint):
    for end, sense in ((-2.0, -1.0), (2.5, 1.0)):
        last = (setpoint(posture=posed((joint, end))), 0.0)
        judge(setpoint(posture=posed((joint, end))), before=last)
        match = rf"posture of joint {joint + 1} = {end + 0.01 * sense:.3f} rad; -2 to 2\.5 allowed"
        with pytest.raises(SetpointError, match=match):
            judge(setpoint(posture=posed((joint, end + 0.01 * sense))), before=last)


@pytest.mark.parametrize("end", [-2.0, 2.5])
def test_a_joint_outside_its_range_is_drawn_back_and_no_further_out(end):
    outside = replace(arm_at(), q=np.full(7, end + 0.1 * np.sign(end)))
    judge(setpoint(posture=outside.q.copy()), outside)
    judge(setpoint(posture=outside.q - 0.01 * np.sign(end)), outside)
    with pytest.raises(SetpointError, match="posture of joint 1 = "):
        judge(setpoint(posture=outside.q + 0.01 * np.sign(end)), outside)


@pytest.mark.parametrize("sense", [-1.0, 1.0])
@pytest.mark.parametrize(("joint", "speed"), [(0, 2.0), (2, 2.0), (6, 3.0)])
def test_a_posture_moves_no_faster_than_the_joint_may(joint, speed, sense):
    step = speed * PERIOD + POSTURE_SLACK
    last = (setpoint(posture=posed((joint, 0.5))), 0.0)
    judge(setpoint(posture=posed((joint, 0.5 + sense * (step - 1e-4)))), arm_at(stamp=PERIOD), last)
    with pytest.raises(SetpointError, match=rf"posture of joint {joint + 1} moves by {step + 1e-3:.3f} rad; at most"):
        judge(setpoint(posture=posed((joint, 0.5 + sense * (step + 1e-3)))), arm_at(stamp=PERIOD), last)


@pytest.mark.parametrize("last", [None, (setpoint(id=7), 0.0), (setpoint(id=7, posture=posed((0, 1.0))), 0.0)])
def test_the_posture_of_a_motion_begins_near_the_joints_but_for_the_elbow(last):
    judge(setpoint(posture=posed((0, POSTURE_LEAD), (2, 1.5))), arm_at(stamp=PERIOD), last)
    with pytest.raises(SetpointError, match=r"posture of joint [13] moves by"):
        judge(setpoint(posture=posed((0, POSTURE_LEAD + 0.001), (2, 1.5))), arm_at(stamp=PERIOD), last)


def test_the_posture_of_a_new_motion_may_go_on_from_the_one_before():
    last = (setpoint(id=7, posture=posed((0, 1.0), (2, 0.5))), 0.0)
    judge(setpoint(posture=posed((0, 1.0 + 2.0 * PERIOD), (2, 0.5))), arm_at(stamp=PERIOD), last)


def test_joint_targets_that_run_away_under_new_ids_are_told():
    still, turned = (setpoint(id=scan, posture=posed((3, 10.0 * PERIOD * scan))) for scan in (2, 3))
    judge(still)
    with pytest.raises(SetpointError, match=r"posture of joint 4 moves by 0\.100 rad; at most 0\.040 rad allowed"):
        judge(turned, arm_at(stamp=PERIOD), (still, 0.0))
