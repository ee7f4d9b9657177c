"""`cell skin` shows every taxel on 80 columns and names those that are not trusted."""

import io

import numpy as np
import pytest
from rich.console import Console

from cell.commands.skin_view import SeenFrame, as_data, fingers
from drivers.quantities import TaxelFrame
from drivers.skin.layout import LAYOUTS


def shown(layout, values, trusted):
    out = io.StringIO()
    Console(file=out, width=80).print(fingers(SeenFrame(TaxelFrame(values, trusted, 0.0, 7), None), layout))
    return out.getvalue()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_taxel_is_shown_whole_on_eighty_columns(layout):
    values = np.arange(40, dtype=float).reshape(2, 20) * 1000.0 - 5000.0
    text = shown(layout, values, np.ones((2, 20), dtype=bool))
    assert "…" not in text
    assert all(f"{value / 1e3:.1f}" in text.split() for value in values.flat)


def test_a_taxel_that_is_not_trusted_is_named_by_its_number():
    trusted = np.ones((2, 20), dtype=bool)
    trusted[0, 3] = trusted[1, 19] = False
    text = shown("parallelogram", np.zeros((2, 20)), trusted)
    assert {"x3", "x19"} <= set(text.split())
    assert "38 of 40 taxels trusted" in text


def test_data_for_programs_hold_no_figures_where_nobody_counts():
    data = as_data(SeenFrame(TaxelFrame(np.zeros((2, 20)), np.ones((2, 20), dtype=bool), 1.5, 7), None))
    assert (data["stamp"], data["sequence"], "figures" in data) == (1.5, 7, False)
