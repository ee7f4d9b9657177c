"""The study of the page measures a real browser and a real scan."""

import json

from cell.cli import GOOD, main
from cell.lab.page import browser
from cell.lab.page.jitter import Pair
from cell.lab.page.tables import median_interval


def test_the_study_tells_growth_latency_and_jitter(tmp_path, capsys):
    assert main(["study", "page", "--quick", "--json", "--out", str(tmp_path)]) == GOOD
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "page.json").read_text())
    assert [pair["scans"] > 100 for pair in told["jitter"]] == [True]
    if browser.is_there():
        assert {line["what"] for line in told["growth"]} >= {"server", "JavaScript of both pages"}
        assert all(0.0 < shown < 10.0 for shown in told["latency"])
        assert len(told["latency"]) == 10


def test_the_ratio_is_that_of_pages_to_none():
    assert Pair(without=0.002, with_pages=0.003, scans=1).ratio == 1.5


def test_the_interval_of_a_median_lies_between_two_values():
    assert median_interval([3.0, 1.0, 2.0]) == (1.0, 3.0)
    assert median_interval([float(value) for value in range(12)]) == (2.0, 9.0)
