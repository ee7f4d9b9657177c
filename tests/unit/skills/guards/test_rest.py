"""The way to rest: braked for a moment, then held; rest is reported after all joints have been slow for a while."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import ArmRestlessError, ArmSilentError
from skills.guards.rest import BRAKE_SPEED, BRAKE_TIME, LONGEST, PLACE_TIME, REST_SCANS, REST_SPEED, REST_TIME, Rest
from tests.fakes import FakeArm, FakeClock

PERIOD = 0.01  # s


@pytest.fixture
def arm():
    """Return an arm that counts its halts."""
    made = FakeArm(FakeClock())
    halt, made.halts = made.halt, 0

    def counted():
        made.halts += 1
        halt()

    made.halt = counted
    return made


def taken(rest, arm, speeds):
    """Return the state after each scan with these speeds of the fastest joint, rad/s."""
    state = arm.read()
    return [
        rest.take(replace(state, dq=np.array([0.0, -speed, 0.0, 0.0, 0.0, 0.0, 0.0])), PERIOD * scan)
        for scan, speed in enumerate(speeds, 1)
    ]


def test_rest_is_told_after_so_many_slow_scans_in_a_row(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    slow = 0.99 * REST_SPEED
    told = taken(rest, arm, [slow] * (REST_SCANS - 1) + [1.01 * REST_SPEED] + [slow] * REST_SCANS)
    assert told == [False] * (2 * REST_SCANS - 1) + [True]


def test_a_moving_arm_is_halted_anew_while_it_brakes_and_then_held(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    taken(rest, arm, [0.5] * round(2 * BRAKE_TIME / PERIOD))
    assert arm.halts == 1 + round(BRAKE_TIME / PERIOD)


@pytest.mark.parametrize(("share", "is_halted_anew"), [(0.99, False), (1.01, True)])
def test_an_arm_is_halted_anew_only_while_it_is_faster_than_a_held_place_stops_it(arm, share, is_halted_anew):
    rest = Rest(arm)
    rest.seek(0.0)
    taken(rest, arm, [share * BRAKE_SPEED] * 3)
    assert (arm.halts > 1) == is_halted_anew


def test_an_arm_whose_state_cannot_be_read_is_braked_without_it(arm):
    def silent():
        raise ArmSilentError("arm: no state")

    arm.read = silent
    with pytest.raises(ArmSilentError):
        Rest(arm).wait(arm.clock, PERIOD)
    assert arm.halts == pytest.approx(1 + BRAKE_TIME / PERIOD, abs=2)
    assert arm.clock.now() == pytest.approx(BRAKE_TIME, abs=2 * PERIOD)


def test_an_arm_that_is_silent_for_a_moment_is_still_brought_to_rest(arm):
    read, missed = arm.read, []

    def silent_first():
        if len(missed) < 3:
            missed.append(0)
            raise ArmSilentError("arm: no state")
        return read()

    arm.read = silent_first
    rest = Rest(arm)
    rest.wait(arm.clock, PERIOD)
    assert rest.is_reached


def test_an_arm_that_stands_is_halted_once(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    taken(rest, arm, [0.0] * 50)
    assert arm.halts == 1


def test_an_arm_whose_speed_never_reads_zero_is_at_rest_in_time(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    told = taken(rest, arm, [2.0 * REST_SPEED] * round(REST_TIME / PERIOD + 1))
    assert told[-2:] == [False, True]


def creeping(rest, arm, speed, scans):
    """Return the state after each scan of an arm that moves on at this speed, rad/s, and reads twice as much."""
    told = []
    for scan in range(1, scans + 1):
        arm.clock.time, arm.q[2] = PERIOD * scan, speed * PERIOD * scan
        told.append(rest.take(replace(arm.read(), dq=np.full(7, 2.0 * REST_SPEED)), arm.clock.time))
    return told


@pytest.mark.parametrize(("share", "is_at_rest"), [(0.99, True), (1.01, False)])
def test_an_arm_that_creeps_is_not_told_to_rest(arm, share, is_at_rest):
    rest = Rest(arm)
    rest.seek(0.0)
    assert any(creeping(rest, arm, share * REST_SPEED, round(LONGEST / PERIOD))) == is_at_rest


def test_an_arm_that_goes_on_moving_is_a_fault(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    with pytest.raises(ArmRestlessError, match=r"joint 1 moves at 0\.020 rad/s 3\.0 s after the halt"):
        creeping(rest, arm, 0.5, round(LONGEST / PERIOD) + 1)


def test_rest_is_left_where_the_arm_is_to_move(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    taken(rest, arm, [0.0] * REST_SCANS)
    assert rest.is_reached
    rest.leave()
    assert not rest.is_sought
    assert not rest.is_reached


def test_waiting_brings_a_moving_arm_to_rest(arm):
    clock, meanwhile = FakeClock(), []
    arm.dq[3] = 1.0

    def calm():
        meanwhile.append(clock.now())
        arm.dq[3] *= 0.5

    Rest(arm).wait(clock, PERIOD, calm)
    assert len(meanwhile) == 7 + REST_SCANS - 1  # 0.5 to the power of 7 is below the limit


def test_an_arm_that_nobody_has_halted_is_not_at_rest(arm):
    rest = Rest(arm)
    assert (rest.is_reached, rest.is_sought, rest.take(arm.read(), 0.0)) == (False, False, False)


def test_an_arm_whose_encoders_jitter_is_in_place_whenever_it_was_halted(arm):
    rest, state = Rest(arm), arm.read()
    rest.seek(100.0)
    scans = range(1, round(1.3 * REST_TIME / PERIOD))
    jitter = [replace(state, q=np.full(7, 3e-4 * (n % 2)), dq=np.full(7, 2.0 * REST_SPEED)) for n in scans]
    told = [rest.take(each, 100.0 + PERIOD * n) for n, each in zip(scans, jitter, strict=True)]
    assert told.index(True) == pytest.approx(REST_TIME / PERIOD, abs=2)


# Exactly at a limit.


def take_at(rest, arm, now, speed, place=0.0):
    """Take a scan at this time, s, of an arm whose joints have this speed, rad/s, and place, rad."""
    return rest.take(replace(arm.read(), q=np.full(7, place), dq=np.full(7, speed)), now)


def test_an_arm_at_exactly_the_speed_of_rest_is_not_at_rest_and_one_at_that_of_the_brake_is_held(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    assert not any(taken(rest, arm, [REST_SPEED] * 50))
    taken(rest, arm, [BRAKE_SPEED] * 3)
    assert arm.halts == 1


def test_an_arm_is_halted_anew_until_exactly_the_end_of_the_braking(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    take_at(rest, arm, BRAKE_TIME, 0.5)
    take_at(rest, arm, BRAKE_TIME + 1e-9, 0.5)
    assert arm.halts == 2


def test_an_arm_that_moved_exactly_as_far_as_it_may_stays_in_place(arm):
    rest = Rest(arm)
    rest.seek(-2.0 * REST_TIME)
    assert not take_at(rest, arm, 0.0, 0.5)
    assert take_at(rest, arm, PLACE_TIME, 0.5, REST_SPEED * PLACE_TIME)


def test_an_arm_in_place_is_at_rest_after_exactly_its_time(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    told = [take_at(rest, arm, now, 0.02) for now in (0.0, 0.5, REST_TIME, REST_TIME + 1e-9)]
    assert told == [False, False, False, True]


def test_an_arm_may_move_until_exactly_the_longest_time(arm):
    rest = Rest(arm)
    rest.seek(0.0)
    assert not take_at(rest, arm, LONGEST, 0.5)
    with pytest.raises(ArmRestlessError, match=r"^arm: joint 1 moves at 0\.500 rad/s 3\.0 s .*; 0\.01 rad/s allowed$"):
        take_at(rest, arm, LONGEST + 1e-9, 0.5)


def test_an_arm_is_taken_for_silent_exactly_at_the_end_of_its_braking(arm):
    def silent():
        raise ArmSilentError("arm: no state")

    rest, arm.read = Rest(arm), silent
    rest.seek(0.0)
    assert not rest._take_newest(BRAKE_TIME)
    with pytest.raises(ArmSilentError):
        rest._take_newest(BRAKE_TIME + 1e-9)
