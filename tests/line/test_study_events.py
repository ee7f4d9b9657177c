"""The study of hole events, with a few short searches: what a still search sees is what a listening one would."""

import csv
import io
import json
import math
from contextlib import redirect_stdout

import numpy as np
import pytest

from cell.commands.cli import main
from cell.config.load import load
from cell.lab.events.measure import DETECTORS, HEIGHT, Watched, rice_chance, rice_limit, watch
from drivers.errors import ConfigError

SEED = 101
"""Seed of a search that slides over the hole within four seconds."""


def config(*sets):
    return load(None, None, ["sim.pace=max", "reality.scale=0.0", "search.timeout=5.0", *sets]).cell


def test_peg_falls_where_there_is_a_hole_and_nowhere_else():
    hollow, solid = (watch(config(), has_hole, SEED) for has_hole in (True, False))
    assert hollow.after is not None
    assert hollow.after[HEIGHT].first(config().search.dip_threshold) is not None
    assert solid.after is None
    assert solid.slid > hollow.slid
    assert solid.before[HEIGHT].first(config().search.dip_threshold) is None


def test_plate_of_facets_has_a_hole():
    with pytest.raises(ConfigError, match=r"sim\.plate\.present = false"):
        config("sim.plate.present=false", "sim.model.hole=boxes")


def test_dip_from_the_spread_is_passed_as_often_as_stated():
    rng, passed, searches, scans = np.random.default_rng(1), 0, 200, 5000
    smooth = np.exp(-0.5 * (np.arange(-30, 31) / 6.0) ** 2)
    for seed in range(searches):
        height = np.convolve(rng.standard_normal(scans + 60), smooth, "valid")
        row = Watched(seed, False, slid=scans / 100.0, spread=float(height.std()))
        row.crossings = float(np.count_nonzero((height[:-1] < 0.0) & (height[1:] >= 0.0))) / row.slid
        limit = rice_limit(row, 0.3, row.slid)
        assert rice_chance(row, limit) == pytest.approx(-math.expm1(-0.3), rel=1e-6)
        passed += bool(height.max() > limit)
    assert passed / searches == pytest.approx(-math.expm1(-0.3), abs=0.1)


def test_quick_study_tells_of_every_detector_and_draws(tmp_path):
    arguments = ["study", "events", "--quick", "--json", "--trials", "2", "--seed", str(SEED), "--workers", "1"]
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*arguments, "--set", "world=v1", "--out", str(tmp_path)]) == 0
    lines = json.loads(printed.getvalue())["lines"]
    used = [line for line in lines if line["in_use"]]
    assert [line["detector"] for line in used] == list(DETECTORS)
    assert all((line["searches"], line["falls"]) == (2, 2) for line in used)
    height = used[0]
    assert (height["stopped"], height["probes"], height["detected"]) == (0, 0, 2)
    assert height["high"] > 0.4
    with (tmp_path / "events.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(lines)
    assert (tmp_path / "events.png").read_bytes()[:4] == b"\x89PNG"
