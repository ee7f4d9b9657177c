import pytest

from cell.config.load import load
from drivers.errors import ConfigError

LATCH = "hole.latch={kind='detent',force=%s,height=%s}"


def refused(*sets: str) -> str:
    with pytest.raises(ConfigError) as error:
        load(sets=sets)
    return str(error.value)


def test_a_latch_that_the_shipped_cell_presses_through_is_taken():
    assert load(sets=[LATCH % (5.8, 0.003)]).cell.hole.latch.force == 5.8


def test_a_latch_that_the_push_does_not_pass_is_refused_with_what_it_would_pass():
    said = refused(LATCH % (5.9, 0.003))
    assert "hole.latch.force = 5.9: not pressed through" in said
    assert "push with 11 N; at most 5.83 allowed" in said


def test_a_latch_that_the_pads_do_not_bear_is_refused():
    said = refused(LATCH % (5.0, 0.003), "grasp.force=15.0")
    assert "hole.latch.force = 5: not pressed through, as the pads bear" in said
    assert "at grasp.force = 15" in said


def test_a_latch_beyond_the_force_limit_is_refused():
    assert "limits.force = 9; at most 4.17 allowed" in refused(LATCH % (5.0, 0.003), "limits.force=9.0")


def test_a_stronger_push_and_grip_pass_a_stronger_latch():
    sets = [LATCH % (8.0, 0.003), "grasp.force=45.0", "adjust.push_offset=0.014"]
    assert load(sets=sets).cell.hole.latch.force == 8.0


def test_a_latch_above_the_mouth_and_a_bottom_above_it_are_refused():
    assert "hole.latch.height = 0.01" in refused(LATCH % (5.0, 0.01), "hole.depth=0.008")
    assert "sim.plate.shallow = 0.02" in refused("sim.plate.shallow=0.02")
