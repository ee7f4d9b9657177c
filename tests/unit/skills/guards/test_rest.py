"""The way to rest: braked for a moment, then held; rest is reported after all joints have been slow for a while."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import ArmRestlessError, ArmSilentError
from skills.guards.rest import BRAKE_SPEED, BRAKE_TIME, LONGEST, PLACE_TIME, REST_SCANS, REST_SPEED, REST_TIME, Rest
from tests.fakes import FakeArm, FakeClock

PERIOD = 0.01  # s


class CountedArm(FakeArm):
    """An arm that counts its halts and readings, and is silent for some of them."""

    halts = reads = silent = 0

    def halt(self):
        self.halts += 1
        super().halt()

    def read(self):
        self.reads += 1
        if self.silent > 0:
            self.silent -= 1
            raise ArmSilentError("arm: no state")
        return super().read()


@pytest.fixture
def arm():
    return CountedArm(FakeClock())


@pytest.fixture
def rest(arm):
    """Return the way to rest of an arm that was halted at 0 s."""
    made = Rest(arm)
    made.seek(0.0)
    return made


def take_at(rest, arm, now, speed, place=0.0):
    """Take a scan at this time, s, of an arm whose joints have this speed, rad/s, and place, rad."""
    return rest.take(replace(arm.read(), q=np.full(7, place), dq=np.full(7, -speed)), now)


def taken(rest, arm, speeds, place=lambda n: 0.0):
    """Return the state after each scan with these speeds of the joints, rad/s, and places, rad, by the number of the scan."""
    return [take_at(rest, arm, PERIOD * n, speed, place(n)) for n, speed in enumerate(speeds, 1)]


def test_rest_is_reached_after_some_slow_scans_in_a_row_and_left(arm, rest):
    slow = 0.99 * REST_SPEED
    told = taken(rest, arm, [slow] * (REST_SCANS - 1) + [REST_SPEED] + [slow] * REST_SCANS)
    assert told == [False] * (2 * REST_SCANS - 1) + [True]
    assert rest.is_reached
    rest.leave()
    assert (rest.is_sought, rest.is_reached, take_at(rest, arm, 1.0, 0.0)) == (False, False, False)


@pytest.mark.parametrize(
    ("speed", "halts"), [(0.0, 1), (BRAKE_SPEED, 1), (1.01 * BRAKE_SPEED, 1 + round(BRAKE_TIME / PERIOD))]
)
def test_an_arm_is_halted_anew_while_it_is_fast_and_brakes(arm, rest, speed, halts):
    taken(rest, arm, [speed] * round(2 * BRAKE_TIME / PERIOD))
    assert arm.halts == halts


def test_an_arm_is_halted_anew_until_exactly_the_end_of_the_braking(arm, rest):
    for now in (BRAKE_TIME, BRAKE_TIME + 1e-9):
        take_at(rest, arm, now, 0.5)
        assert arm.halts == 2


def test_an_arm_whose_state_cannot_be_read_is_braked_without_it(arm):
    arm.silent = 99
    with pytest.raises(ArmSilentError):
        Rest(arm).wait(arm.clock, PERIOD)
    assert arm.halts == pytest.approx(1 + BRAKE_TIME / PERIOD, abs=2)
    assert arm.clock.now() == pytest.approx(BRAKE_TIME, abs=2 * PERIOD)


def test_waiting_brings_a_moving_and_briefly_silent_arm_to_rest(arm):
    meanwhile, arm.silent, arm.dq[3] = [], 3, 1.0

    def calm():
        meanwhile.append(arm.clock.now())
        arm.dq[3] *= 0.5

    rest = Rest(arm)
    assert (rest.is_reached, rest.is_sought) == (False, False)
    rest.wait(arm.clock, PERIOD, calm)
    assert rest.is_reached
    assert len(meanwhile) == 7 + REST_SCANS - 1  # 0.5 to the power of 7 is below the limit


@pytest.mark.parametrize(("share", "is_at_rest"), [(0.99, True), (1.01, False)])
def test_an_arm_that_creeps_is_not_at_rest(arm, rest, share, is_at_rest):
    """It reads twice the speed of rest."""
    way = share * REST_SPEED * PERIOD
    assert any(taken(rest, arm, [2.0 * REST_SPEED] * round(LONGEST / PERIOD), lambda n: way * n)) == is_at_rest


def test_an_arm_whose_encoders_jitter_in_place_comes_to_rest(arm, rest):
    told = taken(rest, arm, [2.0 * REST_SPEED] * round(1.3 * REST_TIME / PERIOD), lambda n: 3e-4 * (n % 2))
    assert told.index(True) == pytest.approx(REST_TIME / PERIOD, abs=2)


def test_an_arm_may_move_exactly_as_far_as_allowed(arm):
    rest = Rest(arm)
    rest.seek(-2.0 * REST_TIME)
    assert not take_at(rest, arm, 0.0, 0.5)
    assert take_at(rest, arm, PLACE_TIME, 0.5, REST_SPEED * PLACE_TIME)


def test_an_arm_in_place_is_at_rest_after_exactly_its_time(arm, rest):
    told = [take_at(rest, arm, now, 0.02) for now in (0.0, 0.5, REST_TIME, REST_TIME + 1e-9)]
    assert told == [False, False, False, True]


def test_an_arm_may_move_until_exactly_the_longest_time(arm, rest):
    assert not take_at(rest, arm, LONGEST, 0.5)
    with pytest.raises(ArmRestlessError, match=r"^arm: joint 1 moves at 0\.500 rad/s 3\.0 s .*; 0\.01 rad/s allowed$"):
        take_at(rest, arm, LONGEST + 1e-9, 0.5)
