"""Whole insertions into a hole without a switch, on honest cells: seated parts pass, and parts that are not seated do not."""

import numpy as np
import pytest

from cell.config.load import load
from cell.lab.charts import draw_panels
from cell.lab.compare import chosen
from cell.lab.seating import hanging, line_of, panel
from cell.lab.trials import run_trial
from drivers.parts import Latch
from skills.seating.latch_likelihood import GRID, SHEAR, InsertionStroke, resistance

CASES = {variant.family: variant for variant in chosen("seating", is_quick=False)}


def tried(case):
    variant = CASES[case]
    return run_trial(load(sets=list(variant.sets)).cell, 101001, variant.probe)


def test_a_seated_peg_is_detected_by_the_force_of_its_latch(tmp_path):
    row = tried("seated")
    line = line_of("seated", [row])
    assert (row.outcome, line.seated, line.missed, line.false) == ("success", 1, 0, 0)
    assert float(row.more["believed"]) == 1.0
    assert float(row.more["latch_force"]) == pytest.approx(5.0, rel=0.35)
    chart = draw_panels([panel({"seated": [row]})], "one trial", tmp_path / "seating.png")
    assert chart.stat().st_size > 10_000


def test_a_part_on_a_higher_bottom_is_neither_reported_nor_accepted():
    row = tried("bottom 1 mm higher")
    line = line_of("bottom 1 mm higher", [row])
    assert (row.outcome, line.seated, line.false) == ("failure", 0, 0)


def test_deviations_that_last_longer_have_a_longer_correlation_length():
    latch, above = Latch(kind="detent", force=5.0, height=0.003), np.concatenate([np.arange(6e-3, 0.0, -1e-4), [0.0]])

    def length(period):
        force = resistance(above, latch) + 0.5 * np.sin(2.0 * np.pi * above / period)
        force[-1] = 11.0
        return hanging(InsertionStroke(tuple((above - SHEAR * force).tolist()), tuple(force.tolist())), latch)

    assert GRID <= length(4e-4) < length(1.6e-3)
    assert hanging(InsertionStroke((), ()), latch) is None
