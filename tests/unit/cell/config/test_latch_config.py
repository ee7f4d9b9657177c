import pytest

from cell.config.load import load
from drivers.errors import ConfigError

LATCH = "hole.latch={kind='detent',force=%s,height=%s}"


@pytest.mark.parametrize(
    "sets", [[LATCH % (5.8, 0.003)], [LATCH % (8.0, 0.003), "grasp.force=45.0", "adjust.push_offset=0.014"]]
)
def test_a_latch_that_push_and_grip_pass_is_taken(sets):
    assert load(sets=sets).cell.hole.latch.force in (5.8, 8.0)


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        ([LATCH % (5.9, 0.003)], "hole.latch.force = 5.9: not pressed through"),
        ([LATCH % (5.9, 0.003)], "push with 11 N; at most 5.83 allowed"),
        ([LATCH % (5.0, 0.003), "grasp.force=15.0"], "hole.latch.force = 5: not pressed through, as the pads bear"),
        ([LATCH % (5.0, 0.003), "grasp.force=15.0"], "at grasp.force = 15"),
        ([LATCH % (5.0, 0.003), "limits.force=9.0"], "limits.force = 9; at most 4.17 allowed"),
        ([LATCH % (5.0, 0.01), "hole.depth=0.008"], "hole.latch.height = 0.01"),
        (["sim.plate.shallow=0.02"], "sim.plate.shallow = 0.02"),
    ],
)
def test_a_latch_that_is_not_passed_or_above_the_mouth_is_refused(sets, told):
    with pytest.raises(ConfigError) as error:
        load(sets=sets)
    assert told in str(error.value)
