"""The study of the published method: what is not printed is fitted on half of the seeds and judged on the other."""

import csv
import io
import json
import math
from contextlib import redirect_stdout

import pytest

from cell.cli import main
from cell.lab.frontier.measure import Variant
from cell.lab.paper import measure
from cell.lab.published import PUBLISHED, StageLine
from cell.lab.trials import TABLE, read_table

EXACT = [StageLine(each.name, each.successes, each.attempts, each.time) for each in PUBLISHED]


def test_table_of_the_paper_itself_has_no_misfit() -> None:
    assert measure.misfit(EXACT) == pytest.approx(0.0, abs=1e-12)


def test_a_stage_that_takes_a_fifth_longer_is_one_deviation() -> None:
    slower = [EXACT[0], StageLine("tactile_insert", 38, 39, 1.2 * 24.1), EXACT[2]]
    assert measure.misfit(slower) == pytest.approx(math.sqrt(1.0 / 6.0))


def test_a_stage_that_fails_more_often_or_is_never_reached_does_not_fit() -> None:
    losing = [StageLine("spray_search", 20, 40, 19.9), *EXACT[1:]]
    unreached = [EXACT[0], StageLine("tactile_insert", 0, 10, None), StageLine("spiral_adjust", 0, 0, None)]
    assert measure.misfit(losing) > 2.0
    assert measure.misfit(unreached) > 3.0


def test_never_finding_the_hole_fits_worse_than_stages_whose_times_are_far_off() -> None:
    lost = [StageLine("spray_search", 0, 8, None), StageLine("tactile_insert", 0, 0, None)]
    lost.append(StageLine("spiral_adjust", 0, 0, None))
    hasty = [StageLine("spray_search", 7, 8, 34.2), StageLine("tactile_insert", 6, 7, 1.9)]
    hasty.append(StageLine("spiral_adjust", 1, 6, 4.6))
    assert measure.misfit(hasty) < measure.misfit(lost) == pytest.approx(measure.WORST)


def test_candidates_begin_with_the_preset_stay_within_bounds_and_are_the_same_again() -> None:
    preset, by_hand, *drawn = measure.figures(12)
    assert preset == {}
    assert drawn == measure.figures(12)[2:]
    for chosen in (by_hand, *drawn):
        assert all(0.99 * u.low <= chosen[u.key] <= 1.01 * u.high for u in measure.UNKNOWNS)


def test_candidates_that_fit_begin_with_the_best_and_leave_out_what_could_not_be_run() -> None:
    tried = [measure.Candidate(str(n), measure.FIT, {}, EXACT, m, "") for n, m in enumerate((2.0, math.nan, 1.0, 1.2))]
    assert [each.name for each in measure.fitting(tried)] == ["2", "3"]
    assert measure.fitting(tried[1:2]) == []


def test_a_candidate_is_the_preset_with_its_figures_under_honest_errors() -> None:
    found = measure.variant(7, measure.FIT, {"search.speed": 0.06})
    assert found == Variant("fit", "007", "paper", ("reality.scale=1", "search.speed=0.06"))


def test_the_study_judges_on_seeds_that_it_did_not_choose_by(tmp_path) -> None:
    command = ["study", "paper", "--quick", "--json", "--workers", "1", "--seed", "7", "--set", "search.timeout=0.5"]
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*command, "--out", str(tmp_path)]) == 0
    found = json.loads(printed.getvalue())
    assert [each["error"] for each in found["fitted"]] == ["", "", ""]
    assert {row.seed for row in read_table(tmp_path / "fit-001" / TABLE)} == {7}
    assert {row.seed for each in found["judged"] for row in read_table(tmp_path / f"judge-{each['name']}" / TABLE)} == {
        8
    }
    with (tmp_path / measure.TABLE).open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 3 + len(found["judged"])
    assert (tmp_path / "paper.png").stat().st_size > 10_000
