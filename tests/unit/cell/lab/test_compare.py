"""Variants of studies are valid configs, run beside refused ones, and fill tables and charts."""

import argparse
from dataclasses import replace

import pytest

from cell.config.load import load
from cell.lab.charts import Curve, Panel, draw_panels, draw_speed_accuracy
from cell.lab.compare import NAMES, VARIANTS, Variant, chosen, compared
from cell.lab.published import StageLine
from cell.lab.tables import table
from cell.lab.trials import run_trial, write_table
from cell.lab.workers import each_of, on_processes
from drivers.errors import ConfigError
from tests.studies import in_this_process, rows_of


@pytest.mark.parametrize("study", ["modelling", "seating", "limits", "paper"])
def test_every_variant_is_a_config(study):
    variants = chosen(study, is_quick=False)
    for variant in variants:
        load(None, variant.preset, ["sim.pace=max", *variant.sets])
        assert callable(variant.probe)
    quick = chosen(study, is_quick=True)
    assert {*quick} <= {*variants}
    assert 0 < len(quick) <= len(variants)


def test_an_unknown_group_of_variants_is_refused_by_name():
    with pytest.raises(ConfigError, match="--only slow: no such name; as shipped, nominal joint friction"):
        chosen("modelling", is_quick=False, families=["slow"])


def test_a_refused_variant_has_its_reason_and_the_others_run(tmp_path):
    args = argparse.Namespace(config=None, set=["sim.pace=max", "search.timeout=0.2"], out=tmp_path, workers=1)
    tried = [Variant("bad", sets=("peg.diameter=-1",)), Variant("blind", sets=("skin.dead_taxels=40",))]
    with in_this_process():
        bad, blind = compared(args, tried, range(3, 4)).lines
    assert "peg.diameter" in bad.error
    assert (bad.trials, blind.trials, blind.successes) == (0, 1, 0)
    assert "skin_untrusted" in blind.endings
    assert table("title", NAMES, VARIANTS, [bad, blind]).row_count == 2


def test_jobs_return_in_their_order():
    assert each_of(divmod, [(7, 2), (9, 4), (8, 3)], 2, "jobs") == [(3, 1), (2, 1), (2, 2)]


def test_jobs_end_once_their_results_are_enough():
    found = []
    found.extend(on_processes(abs, [-1, -2, -3], 1, lambda: bool(found)))
    assert found == [1]


def test_panels_are_drawn(tmp_path):
    curve = Curve([1.0, 2.0], [1.0, 4.0], label="a", style="o-", low=[0.5, 3.0], high=[1.5, 5.0], text="b")
    panels = [Panel("one", "x (m)", "y (N)", [curve], "xy", x_ticks=[1.0, 2.0], marks=[1.5])] * 3
    for path in (
        draw_panels(panels, "title", tmp_path / "a.png"),
        draw_panels(panels, "title", tmp_path / "b.png", across=2, legend=1),
        draw_speed_accuracy(StageLine("total", 0, 4, None), tmp_path / "c.png"),
    ):
        assert path.read_bytes().startswith(b"\x89PNG")


class Scans:
    """Counts the scans of a trial."""

    def __init__(self, cell, ctx):
        self.count = 0

    def record(self, seen, setpoint):
        self.count += 1

    def columns(self, records):
        return {"scans": str(self.count), "stages": " ".join(record.name for record in records)}


def test_a_probe_adds_columns(tmp_path):
    row = run_trial(load(sets=["search.timeout=0.2"]).cell, 3, Scans)
    assert int(row.more["scans"]) == pytest.approx(100.0 * row.sim_time, rel=0.05)
    assert row.more["stages"].startswith("grasp_from_rack spray_search")
    other = replace(row, seed=4, more={})
    write_table([row, other], tmp_path / "trials.csv")
    assert [found["scans"] for found in rows_of(tmp_path / "trials.csv")] == [row.more["scans"], ""]
