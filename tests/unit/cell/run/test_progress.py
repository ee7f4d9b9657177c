"""Progress counts the work that is done."""

import pytest

from cell.run.execution import progress_of
from skills.catalogue import CATALOGUE

INSERT = CATALOGUE["insert_peg"]

HALVES = [(stage, fraction) for stage in INSERT.stages for fraction in (0.0, 0.5)]


@pytest.mark.parametrize(
    ("program", "updates", "percents"),
    [
        ("insert_peg", HALVES, [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]),
        ("insert_peg", [("spray_search", 1.0), ("recover", 1.0)], [40, 0]),
        ("spiral_adjust", [("spiral_adjust", fraction) for fraction in (-1.0, 0.0, 1.0, 9.0)], [0, 0, 100, 100]),
    ],
    ids=["whole stages and a part", "clearing up after a failure", "single skill"],
)
def test_progress_counts_what_is_done(program, updates, percents):
    assert [progress_of(CATALOGUE[program], *update) for update in updates] == percents
