import pytest

from cell.run.progress import progress_of
from skills.catalogue import CATALOGUE

INSERT = CATALOGUE["insert_peg"]


def test_progress_counts_whole_stages_and_the_part_of_the_one_under_way():
    progress = progress_of(INSERT)
    told = [progress.update(stage, fraction) for stage in INSERT.stages for fraction in (0.0, 0.5)]
    assert told == [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]


def test_progress_never_falls_when_a_search_begins_anew():
    progress = progress_of(INSERT)
    assert [progress.update("tactile_insert", 0.5), progress.update("spray_search", 0.1)] == [50, 50]


def test_clearing_up_after_a_failure_is_no_progress():
    progress = progress_of(INSERT)
    progress.update("spray_search", 1.0)
    assert progress.update("recover", 1.0) == 40


@pytest.mark.parametrize(("fraction", "percent"), [(-1.0, 0), (0.0, 0), (1.0, 100), (9.0, 100)])
def test_a_single_skill_is_all_of_its_run(fraction, percent):
    assert progress_of(CATALOGUE["spiral_adjust"]).update("spiral_adjust", fraction) == percent
