"""Whole insertions into a hole without a switch, on honest cells: seated ones pass, and what may be taken for one does not."""

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.lab.seating import charts, drawn, measure
from drivers.errors import ConfigError
from skills.catalogue import GRASP
from skills.held_peg import HeldPeg
from skills.latch_likelihood import GRID, SHEAR, Way, resistance

CONFIG = load().cell
CASES = {case.name: case for case in measure.CASES}


def test_a_seated_peg_is_told_by_the_force_of_its_latch(tmp_path):
    row, curve = measure.run_trial(CONFIG, "detent", CASES["seated"], 101001)
    assert (row.outcome, row.is_seated, row.is_believed, row.is_void) == ("success", True, True, False)
    assert row.force == pytest.approx(5.0, rel=0.35)
    measure.write_table([row], tmp_path / measure.TABLE)
    assert charts.draw([curve], "one trial", tmp_path).stat().st_size > 10_000


@pytest.mark.parametrize("case", ["bottom 1 mm higher"])
def test_what_is_not_seated_is_not_called_so_and_would_not_be_believed(case):
    row, _ = measure.run_trial(CONFIG, "detent", CASES[case], 101001)
    assert (row.is_seated, row.is_told, row.is_believed) == (False, False, False)


def test_noise_alone_neither_hides_a_latch_nor_makes_one():
    told = {line.end: line.told for line in drawn.drawn(measure.LATCHES["detent"], 40, 1)}
    assert min(told["seated"]) >= 39
    assert told["worn out"] == told["bottom 1.5 mm higher"] == (0, 0, 0)
    assert told["bottom 1 mm higher"][:2] == (0, 0)


def test_a_case_that_does_not_exist_is_refused_by_name():
    with pytest.raises(ConfigError, match="--case lost: no such case; seated, bottom 1 mm higher"):
        measure.case_names(["lost"])


def test_lines_count_what_was_missed_and_what_was_false():
    def row(case, is_seated, is_told, is_believed):
        return measure.SeatingRow(
            "detent", case, 1, "", "", 0.02, is_seated, is_told, is_believed, None, None, None, None, 1, 0.0, False
        )

    rows = [row("seated", True, True, True), row("seated", True, False, False), row("worn latch", False, False, True)]
    seated, worn = measure.lines_of(rows)
    assert (seated.trials, seated.seated, seated.missed, seated.false) == (2, 2, 1, 0)
    assert (worn.trials, worn.seated, worn.missed, worn.false) == (1, 0, 0, 1)


def test_deviations_that_last_longer_hang_together_over_a_longer_way():
    latch, above = measure.LATCHES["detent"], np.concatenate([np.arange(0.006, 0.0, -1e-4), [0.0]])

    def length(period):
        force = resistance(above, latch) + 0.5 * np.sin(2.0 * np.pi * above / period)
        force[-1] = drawn.PUSH
        return measure.hanging(Way(tuple((above - SHEAR * force).tolist()), tuple(force.tolist())), latch)

    assert GRID <= length(4e-4) < length(1.6e-3)
    assert measure.hanging(Way((), ()), latch) is None


def test_ways_down_of_another_peg_are_forgotten_at_the_next_grasp():
    cell = assemble(CONFIG.model_copy(update={"sim": CONFIG.sim.model_copy(update={"pace": "max"})}))
    with opened(cell):
        ctx = cell.context(1)
        ctx.peg = HeldPeg(ways=(Way((0.1,), (0.0,)),))
        GRASP.run(CONFIG.skill_set(), ctx)
    assert ctx.peg.ways == ()
