"""The study of hole events, with a few short searches: what a still search sees is what a listening one would."""

import csv
import io
import json
import math
from contextlib import redirect_stdout

import numpy as np
import pytest

from cell.assembly import assemble, opened
from cell.cli import main
from cell.config import load
from cell.lab.events.measure import DETECTORS, HEIGHT, Watched, rice_chance, rice_limit, watch
from cell.lab.events.report import RATES
from drivers.errors import ConfigError
from drivers.quantities import TaxelFrame
from skills import spray_search
from skills.catalogue import GRASP
from skills.tactile.hole_event import HoleEvent

SEED = 101
"""Of a search that slides over the hole within three seconds; the skin tells an event in it, and in those of two seeds more."""


def config(*sets):
    return load(None, None, ["sim.pace=max", "reality.scale=0.0", "search.timeout=4.0", *sets]).cell


class NotedEvent(HoleEvent):
    """Tells when it reported something first, once the sliding had begun."""

    first, has_begun, is_telling = None, False, False

    def restart(self) -> None:
        """Begin anew, as the search asks where it begins to slide, and as an event does by itself."""
        super().restart()
        self.has_begun = self.has_begun or not self.is_telling

    def update(self, frame: TaxelFrame) -> bool:
        self.is_telling = True
        is_event = super().update(frame)
        self.is_telling = False
        if is_event and self.has_begun and self.first is None:
            self.first = frame.stamp
        return is_event


def listened(cell_config, seed):
    """Return the first event of a search that is stopped by it, and when sliding began, s."""
    begun = []
    cell = assemble(cell_config.model_copy(update={"sim": cell_config.sim.model_copy(update={"seed": seed})}))
    with opened(cell):
        ctx = cell.context(seed)
        GRASP.run(cell_config.skill_set(), ctx)
        event = NotedEvent(cell_config.search.event, cell_config.search.timeout)
        ctx.record = lambda seen, held: begun.append(seen.stamp) if not event.has_begun else None
        spray_search.run(cell_config.search, ctx, event=event)
    return event.first, begun[-1]


@pytest.mark.parametrize("seed", [SEED, SEED + 2, SEED + 3])
def test_search_that_listens_goes_the_same_way_until_its_first_event(seed):
    sets = ("sim.plate.present=false", "search.evidence=skin", "search.event.false_alarms=50")
    first, begun = listened(config(*sets), seed)
    row = watch(config(), False, seed)
    limit = HoleEvent(config(*sets).search.event, 4.0)
    for number in range(2):
        limit.take(TaxelFrame(np.ones((2, 20)), np.ones((2, 20), dtype=bool), 0.1 * number, number))
    seen = row.before["cusum"].first(limit.limit())
    assert seen is not None
    assert begun + seen[0] == pytest.approx(first, abs=0.011)


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
    for detector in DETECTORS[2:]:
        stopped = [line["stopped"] for line in lines if line["detector"] == detector and not line["in_use"]]
        assert len(stopped) == len(RATES)
        assert stopped == sorted(stopped)
    with (tmp_path / "events.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(lines)
    assert (tmp_path / "events.png").read_bytes()[:4] == b"\x89PNG"
