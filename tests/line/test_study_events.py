"""The study of hole events, with a few short searches."""

import math

from cell.lab.events import HoleEventRow, line_of
from tests.studies import rows_of, studied

SEED = 101
"""Seed of a search that slides over the hole within four seconds."""
NAN = math.nan


def test_the_peg_falls_only_if_there_is_a_hole_and_the_fall_is_detected(tmp_path):
    words = ("--quick", "--trials", "1", "--seed", str(SEED), "--workers", "1", "--set", "reality.scale=0")
    line = studied(tmp_path, "events", *words)["line"]
    assert (line["searches"], line["stopped"], line["falls"], line["detected"]) == (1, 0, 1, 1)
    solid, hollow = sorted(rows_of(tmp_path / "events.csv"), key=lambda row: row["has_hole"])
    assert (solid["has_hole"], solid["fell"], hollow["fell"]) == ("False", "False", "True")
    assert 0.0 <= float(hollow["delay"]) < 0.1
    assert float(solid["slid"]) > float(hollow["slid"])
    assert math.isnan(float(solid["falsely"]))


def test_a_fall_after_a_false_event_does_not_count():
    rows = [
        HoleEventRow(1, False, 5.0, NAN, False, NAN),
        HoleEventRow(2, False, 5.0, 1.0, False, NAN, 1, True),
        HoleEventRow(1, True, 2.0, NAN, True, 0.01),
        HoleEventRow(2, True, 2.0, NAN, True, NAN),
        HoleEventRow(3, True, 2.0, 1.0, True, NAN),
    ]
    line = line_of(rows)
    assert (line.searches, line.stopped, line.probes, line.finds) == (2, 1, 1, 1)
    assert (line.falls, line.detected, line.delay) == (2, 1, 0.01)
