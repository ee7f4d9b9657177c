"""The study of the published method: trials are judged as in the paper, on other seeds than those of its fit."""

import math
from dataclasses import replace

import pytest

from cell.config.load import load
from cell.lab import paper
from cell.lab.published import PUBLISHED
from cell.lab.trials import TABLE, VOID
from skills import catalogue
from tests.studies import is_chart, rows_of, studied
from tests.trial_rows import SEATED

SEARCH, INSERT, ADJUST = (stage.name for stage in PUBLISHED)
FOUND = replace(SEATED, found_error=3e-3)


@pytest.mark.parametrize(
    ("row", "succeeded", "stage"),
    [
        (FOUND, True, FOUND.stage),
        (replace(FOUND, outcome="failure", reason="switch_disagrees"), True, FOUND.stage),
        (replace(FOUND, switch_closed=False), False, FOUND.stage),
        (replace(FOUND, outcome=VOID), False, FOUND.stage),
        (replace(FOUND, found_error=0.99 * paper.NEAR), True, FOUND.stage),
        (replace(FOUND, found_error=1.01 * paper.NEAR, stage=ADJUST, switch_closed=False), False, SEARCH),
    ],
)
def test_a_trial_counts_as_in_the_paper_by_the_switch_and_by_where_the_hole_was_found(row, succeeded, stage) -> None:
    found = paper.tried(row)
    assert (found.succeeded, found.stage) == (succeeded, stage)
    assert set(found.times) == ({SEARCH} if stage == SEARCH else {SEARCH, INSERT, ADJUST})


def test_what_is_printed_stands_in_the_preset_and_is_not_searched() -> None:
    cell = load(None, "paper").cell
    search = cell.params(catalogue.SEARCH)
    assert (search.tilt, search.timeout) == (pytest.approx(math.radians(45), abs=1e-3), 100.0)
    assert cell.params(catalogue.INSERT).estimator == "image"
    assert (cell.peg.part.diameter, cell.hole.part.diameter, cell.retries) == (0.008, 0.0081, 0)


def test_the_method_is_judged_stage_by_stage_on_seeds_of_its_own(tmp_path) -> None:
    words = ("--workers", "1", "--seed", "7", "--trials", "1", "--set", "search.timeout=0.5")
    found = studied(tmp_path, "paper", *words)
    assert [stage["name"] for stage in found["stages"]] == [SEARCH, INSERT, ADJUST, "total"]
    assert {row["seed"] for row in rows_of(tmp_path / "judge-kept" / TABLE)} == {"507"}
    assert len(rows_of(tmp_path / "paper.csv")) == 4
    assert is_chart(tmp_path / "paper.png")
