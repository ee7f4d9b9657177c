"""A busy computer slows an insertion and does not end it."""

import pytest

from cell.config.load import load
from cell.lab.trials import run_trial
from tests.reality_files import reality_of


@pytest.mark.parametrize(("late", "outcome"), [(1.0, "success"), (0.2, "scan_overrun")])
def test_a_run_whose_every_scan_comes_10_ms_late_on_average_ends_only_where_that_is_not_allowed(
    tmp_path, late, outcome
):
    path = reality_of(tmp_path, scan_late=1.0, scan_delay=0.01)
    row = run_trial(load(sets=[f'reality.file="{path}"', f"scan.late={late}"]).cell, 62001)
    assert (row.reason or row.outcome) == outcome
