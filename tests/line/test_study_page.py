"""The study of the page measures a real browser and a real scan."""

import json

import numpy as np
import pytest

from cell.commands.cli import GOOD, main
from cell.lab.page import browser
from cell.lab.page.jitter import TURNS, Pair, cost


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
    assert Pair([0.002] * 9, [0.003] * 9).ratio == pytest.approx(1.5)


def test_neither_a_slope_nor_a_bend_of_the_work_looks_like_a_cost_of_pages():
    places = np.arange(len(TURNS))
    for power in (0, 1, 2):
        assert sum(np.where(TURNS, 1, -1) * places**power) == 0


def test_the_cost_of_pages_is_told_within_its_interval_though_pairs_differ_in_their_work():
    rng = np.random.default_rng(5)
    pairs = []
    for work in rng.lognormal(sigma=0.3, size=12):
        without, with_pages = rng.exponential(work, (2, 200))
        pairs.append(Pair(without, 1.5 * with_pages))
    found = cost(pairs)
    assert 1.0 < found.low < 1.5 < found.high < 2.0
