"""The measures of the line, taken for a moment: what must hold on any computer holds."""

import argparse
import json

import numpy as np
import pytest

from cell.lab.line import charts, siege, study
from cell.lab.line import measure as line
from cell.lab.line.attacks import ATTACKS

MOMENT = line.Effort(rounds=2, reads=20, flat_out=10, starts=4, windows=1, window=0.3, tries=1)


@pytest.fixture(scope="module")
def samples(loaded):
    return line.measure(loaded, MOMENT)


def test_nothing_is_lost_and_no_command_waits_for_a_second_scan(samples):
    assert (samples.flat_out.lost, samples.polled.lost) == (0, 0)
    assert samples.busy_at_once == MOMENT.starts
    assert samples.idle_scans == [0] * MOMENT.starts


def test_table_and_picture_are_written(samples, tmp_path):
    lines = line.measures(samples)
    _, as_json = line.write(lines, tmp_path)
    picture = tmp_path / charts.CHART
    charts.draw(samples, picture)
    assert [row["name"] for row in json.loads(as_json.read_text())] == [each.name for each in lines]
    assert picture.stat().st_size > 10_000


def test_a_plc_keeps_its_run_through_a_burst_of_every_attack(loaded):
    sieges = siege.besiege(loaded, MOMENT.tries)
    assert [each.name for each in sieges] == list(ATTACKS)
    assert [each.kept for each in sieges] == [1] * len(ATTACKS)
    assert all(len(each.cycles) for each in sieges)


def test_the_attacks_alone_are_told_beside_what_a_plc_feels_without_one(monkeypatch, tmp_path):
    felt = [siege.Siege("no attack", 4, 4, np.full(9, 0.002)), siege.Siege("connect storm", 4, 3, np.full(9, 0.06))]
    monkeypatch.setattr(siege, "besiege", lambda *how: felt)
    parser = argparse.ArgumentParser()
    study.add_arguments(parser)
    report = study.run(parser.parse_args(["--attacks", "--out", str(tmp_path)]))
    told = [(row["name"], row["value"], row["beside"], row["holds"]) for row in report.result]
    assert told == [
        ("no attack: runs kept", 4, None, True),
        ("no attack: cycle p99, n = 9", pytest.approx(0.002), None, True),
        ("connect storm: runs kept", 3, None, False),
        ("connect storm: cycle p99, n = 9", pytest.approx(0.06), pytest.approx(0.002), False),
    ]
