"""The study of the published method: what is not printed is fitted on half of the seeds and judged on the other."""

import csv
import io
import json
import math
from contextlib import redirect_stdout
from dataclasses import replace

import pytest

from cell.commands.cli import main
from cell.config.load import load
from cell.lab.frontier.measure import Variant
from cell.lab.paper import measure
from cell.lab.paper.unknowns import ADJUST, INSERT, LABORATORY, ONE_ARM, SEARCH, UNKNOWNS, by_hand, of_stage
from cell.lab.published import PUBLISHED, StageLine
from cell.lab.trials import TABLE, VOID, read_table
from skills import catalogue
from tests.trial_rows import SEATED

EXACT = [StageLine(each.name, each.successes, each.attempts, each.time) for each in PUBLISHED]
FOUND = replace(SEATED, found_error=3e-3)


def test_table_of_the_paper_itself_has_no_misfit() -> None:
    assert measure.misfit(EXACT) == pytest.approx(0.0, abs=1e-12)


def test_a_stage_that_takes_a_fifth_longer_is_one_deviation() -> None:
    slower = [EXACT[0], StageLine("tactile_insert", 38, 39, 1.2 * 24.1), EXACT[2]]
    assert measure.misfit(slower) == pytest.approx(math.sqrt(1.0 / 6.0))
    assert measure.misfit(slower, PUBLISHED[1:2]) == pytest.approx(math.sqrt(1.0 / 2.0))
    assert measure.misfit(slower, PUBLISHED[:1]) == pytest.approx(0.0, abs=1e-12)


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


@pytest.mark.parametrize(
    ("row", "succeeded", "stage"),
    [
        (FOUND, True, FOUND.stage),
        (replace(FOUND, outcome="failure", reason="switch_disagrees"), True, FOUND.stage),
        (replace(FOUND, switch_closed=False), False, FOUND.stage),
        (replace(FOUND, outcome=VOID), False, FOUND.stage),
        (replace(FOUND, found_error=0.99 * measure.NEAR), True, FOUND.stage),
        (replace(FOUND, found_error=1.01 * measure.NEAR, stage=ADJUST, switch_closed=False), False, SEARCH),
    ],
)
def test_a_trial_counts_as_in_the_paper_by_the_switch_and_by_where_the_hole_was_found(row, succeeded, stage) -> None:
    found = measure.tried(row)
    assert (found.succeeded, found.stage) == (succeeded, stage)
    assert set(found.times) == ({SEARCH} if stage == SEARCH else {SEARCH, INSERT, ADJUST})


def test_candidates_begin_with_the_figures_found_by_hand_stay_within_bounds_and_are_the_same_again() -> None:
    for stage in (SEARCH, INSERT, ADJUST):
        first, *drawn = measure.drawn(stage, 12)
        assert first == {each.key: each.by_hand for each in of_stage(stage)}
        assert drawn == measure.drawn(stage, 12)[1:]
        for chosen in (first, *drawn):
            assert all(0.99 * u.low <= chosen[u.key] <= 1.01 * u.high for u in of_stage(stage))


def test_a_candidate_is_the_preset_with_its_figures_under_honest_errors() -> None:
    found = measure.variant("07", SEARCH, {"paper.search.speed": 0.06}, measure.ENDED[SEARCH])
    assert found == Variant(SEARCH, "07", "paper", (*ONE_ARM, "paper.search.speed=0.06", "paper.insert.timeout=0.02"))


def faked(time: "dict[str, float]"):
    """Return a function that runs variants, each with successes that take `time` seconds by its candidate; and what was asked of it."""
    asked = []

    def run(variants, seeds):
        asked.append(([each.name for each in variants], list(seeds)))
        row = {SEARCH: "search_time", INSERT: "insert_time", ADJUST: "adjust_time"}[variants[0].family]
        return [
            ([replace(FOUND, seed=seed, **{row: time.get(each.name[:2], 50.0)}) for seed in seeds], "")
            for each in variants
        ]

    return run, asked


RUNGS = {SEARCH: ((4, 2), (2, 3)), INSERT: ((2, 1),), ADJUST: ((1, 1),)}


def test_halving_keeps_the_candidate_whose_time_is_the_published_one_and_goes_on_with_fresh_seeds() -> None:
    run, asked = faked({"00": 40.0, "02": 20.0, "03": 24.0})
    chosen, found = measure.fit(run, 100, RUNGS)
    assert [names for names, _ in asked][:2] == [
        ["00 rung 0", "01 rung 0", "02 rung 0", "03 rung 0"],
        ["02 rung 1", "03 rung 1"],
    ]
    assert [seeds for _, seeds in asked] == [[100, 101], [102, 103, 104], [133], [166]]
    assert {key: chosen[key] for key in measure.drawn(SEARCH, 4)[2]} == measure.drawn(SEARCH, 4)[2]
    assert [(each.name, len(each.rows)) for each in found if each.half == SEARCH] == [
        ("02", 5),
        ("03", 5),
        ("00", 2),
        ("01", 2),
    ]


def test_a_later_stage_is_tried_with_the_earlier_ones_as_they_were_found() -> None:
    run, _ = faked({"01": 24.1})
    chosen, found = measure.fit(run, 100, {**RUNGS, SEARCH: ((2, 1),)})
    searched = measure.drawn(SEARCH, 2)[1]
    assert all(searched.items() <= each.figures.items() for each in found if each.half != SEARCH)
    assert set(chosen) == set(by_hand())


def test_candidates_that_fit_are_of_the_last_rung_and_leave_out_what_could_not_be_run() -> None:
    figures = ((2.0, 1), (math.nan, 1), (1.9, 1), (0.5, 0))
    tried = [measure.Candidate(str(n), SEARCH, {}, EXACT, m, "", rung) for n, (m, rung) in enumerate(figures)]
    assert [each.name for each in measure.fitting(tried, SEARCH)] == ["2", "0"]
    assert measure.fitting(tried[1:2], SEARCH) == []


def test_what_is_printed_stands_in_the_preset_and_is_not_searched() -> None:
    cell = load(None, "paper").cell
    search = cell.params(catalogue.SEARCH)
    assert (search.tilt, search.timeout) == (pytest.approx(math.radians(45), abs=1e-3), 100.0)
    assert cell.params(catalogue.INSERT).estimator == "image"
    assert (cell.peg.part.diameter, cell.hole.part.diameter, cell.retries) == (0.008, 0.0081, 0)
    assert "search.tilt" not in {unknown.key for unknown in UNKNOWNS}


def test_what_was_kept_is_judged_alone(tmp_path) -> None:
    command = ["study", "paper", "--kept", "--json", "--workers", "1", "--seed", "7", "--trials", "1"]
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*command, "--set", "search.timeout=0.5", "--out", str(tmp_path)]) == 0
    found = json.loads(printed.getvalue())
    assert (found["fitted"], found["judged"]["figures"]) == ([], LABORATORY)
    assert {row.seed for row in read_table(tmp_path / "judge-kept" / TABLE)} == {507}


def test_the_study_judges_on_seeds_that_it_did_not_choose_by(tmp_path) -> None:
    command = ["study", "paper", "--quick", "--json", "--workers", "1", "--seed", "7", "--set", "search.timeout=0.5"]
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*command, "--out", str(tmp_path)]) == 0
    found = json.loads(printed.getvalue())
    assert [each["error"] for each in found["fitted"]] == [""] * 4
    assert {row.seed for row in read_table(tmp_path / "spray_search-00-rung-0" / TABLE)} == {7}
    assert {row.seed for row in read_table(tmp_path / "judge-kept" / TABLE)} == {507}
    with (tmp_path / measure.TABLE).open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 5
    assert (tmp_path / "paper.png").stat().st_size > 10_000
