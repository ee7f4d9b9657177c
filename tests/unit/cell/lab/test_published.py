"""A stage of the published table succeeds if another stage follows it."""

from cell.lab.published import Tried, stage_table


def test_a_stage_succeeds_when_another_follows():
    lost_in_search = Tried(False, "spray_search", {"spray_search": 100.0})
    lost_in_insert = Tried(False, "tactile_insert", {"spray_search": 10.0, "tactile_insert": 60.0})
    good = Tried(True, "release_and_retract", {"spray_search": 20.0, "tactile_insert": 5.0, "spiral_adjust": 3.0})
    search, insert, adjust, total = stage_table([lost_in_search, lost_in_insert, good])
    assert [(line.successes, line.attempts) for line in (search, insert, adjust, total)] == [
        (2, 3),
        (1, 2),
        (1, 1),
        (1, 3),
    ]
    assert (search.time, insert.time, total.time) == (15.0, 5.0, 28.0)
