"""The study of learning on a few parts: the third is searched where the first two were, and another fixture is noticed."""

from cell.config.load import load
from cell.lab.charts import draw_panels
from cell.lab.learning import Mode, PartRow, lines_of, panels, run_series


def test_a_cell_that_learns_finds_its_third_part_at_once_and_notices_another_fixture(tmp_path):
    config = load(sets=["reality.scale=0.0"]).cell
    rows = run_series(config, 3, Mode.LEARNS, 3)
    assert [row.outcome for row in rows] == ["success"] * 4
    assert [row.is_expected for row in rows] == [False, False, True, True]
    assert [row.is_exchanged for row in rows] == [False, False, False, True]
    assert rows[2].search_time < 1.2 < min(rows[0].search_time, rows[3].search_time)
    assert draw_panels(panels(rows, 3), "one series", tmp_path / "parts.png").stat().st_size > 10_000


def test_lines_count_failures_and_take_times_of_successes_alone():
    rows = [
        PartRow(Mode.LEARNS, 1, part, False, part > 2, outcome, 1.0 * part, 10.0 * part)
        for part, outcome in enumerate(("success", "failure", "success", "success"), 1)
    ]
    first, later, _ = lines_of(rows, 4)[:3]
    assert (first.trials, first.successes, first.expected, first.search) == (2, 1, 0, 1.0)
    assert (later.trials, later.successes, later.expected, later.total) == (2, 2, 2, 35.0)
