"""What differs between the attempts of one insertion."""

import pytest

from skills.handling import FIRST_STALL, stall_share


@pytest.mark.parametrize(
    ("attempt", "retries", "share"), [(0, 4, FIRST_STALL), (1, 4, 1.0), (4, 4, 1.0), (0, 0, 1.0), (0, 1, FIRST_STALL)]
)
def test_a_jam_is_given_up_sooner_where_a_first_attempt_is_not_the_last(attempt, retries, share):
    assert stall_share(attempt, retries) == share < 1.01
