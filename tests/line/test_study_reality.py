"""The study of errors, with a few short trials: each is drawn alone, and its range is printed in its own unit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from cell.lab.frontier import measure as frontier
from cell.lab.frontier.measure import Variant
from cell.lab.reality import ALL, SCALES, alone, drawn_alone, errors_of, ranking, size_at, still_borne, tolerances
from cell.lab.trials import TABLE, read_table
from tests.studies import is_chart, studied
from tests.trial_rows import SEATED

ERRORS = errors_of(load(sets=["sim.pace=max"]).cell)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return what the command printed, and its folder."""
    folder = tmp_path_factory.mktemp("reality")
    return studied(folder, "reality", "--quick", "--set", "search.timeout=1.0"), folder


def test_an_error_alone_leaves_the_others_ideal_in_every_row(study):
    found, folder = study
    for line in found["lines"]:
        [row] = read_table(folder / line["folder"] / TABLE)
        drawn = {name.removeprefix("reality.") for name, text in row.more.items() if not _is_ideal(name, text)}
        if line["family"] == ALL:
            assert bool(drawn) == (line["variant"] != "0")
        else:
            assert drawn <= {line["family"]}
    assert is_chart(folder / "reality.png")
    assert (folder / "frontier.csv").exists()


def test_every_error_that_does_something_alone_is_run_alone():
    names = drawn_alone(ERRORS, is_quick=False)
    assert {name for name in ERRORS if name not in names} == {"scan.delay"}
    assert all(f'reality.alone="{variant.family}"' in variant.sets for variant in alone(names, 4.0))


def test_an_error_is_tried_at_larger_sizes_until_it_loses():
    lines = [
        _line("arm.gravity", "1", 100),
        _line("grip.force", "1", 100),
        _line("arm.gravity", "2", 80),
        _line(ALL, "3", 0),
    ]
    assert still_borne(lines) == ["grip.force"]
    assert list(SCALES[False]) == sorted(SCALES[False])


def test_sizes_are_told_in_the_errors_unit():
    assert size_at(ERRORS["place.plate_height"], 2.0) == "±0.0018"
    assert size_at(ERRORS["grip.force"], 2.0) == "x 1/1.32 to 1.32"
    assert size_at(ERRORS["arm.transport"], 1.0) == "0.001 to 0.002"
    assert size_at(ERRORS["arm.sigmoid_friction"], 4.0) == "100 %"


def test_an_error_may_be_as_large_as_the_last_size_before_the_first_that_loses():
    lines = [_line("arm.gravity", scale, good) for scale, good in (("1", 100), ("2", 99), ("4", 80))]
    [sheet] = tolerances(ERRORS, lines)
    assert sheet.scale == 2.0
    assert sheet.lost == "99/100 at 2, 80/100 at 4"
    assert sheet.beyond == size_at(ERRORS["arm.gravity"], 4.0)


def test_a_delay_may_be_as_large_as_the_late_scans_that_have_it():
    late, delay = tolerances(ERRORS, [_line("scan.late", "1", 100), _line("scan.late", "2", 80)])
    assert (late.error, late.size, late.beyond) == ("scan.late", "0 to 0.02", "0 to 0.04")
    assert (delay.error, delay.size, delay.beyond) == ("scan.delay", "0.003 to 0.01", "0.006 to 0.02")


def test_the_error_that_the_time_depends_on_ranks_first():
    rng = np.random.default_rng(4)
    rows = []
    for seed in range(200):
        height, force = rng.normal(size=2)
        drawn = {"reality.place.plate_height": f"{height}", "reality.grip.force": f"{math.exp(0.1 * force)}"}
        rows.append(replace(SEATED, seed=seed, total_time=10.0 + height + 0.1 * rng.normal(), more=drawn))
    first, second = ranking(ERRORS, rows)
    assert first.error == "place.plate_height"
    assert first.time > 0.7
    assert second.time < 0.1


def _line(family: str, scale: str, successes: int) -> frontier.FrontierLine:
    rows = [replace(SEATED, seed=n, outcome="success" if n < successes else "failure") for n in range(100)]
    return frontier._line(Variant(family, scale, None, ()), "", rows, "", is_base=False)


def _is_ideal(name: str, text: str) -> bool:
    from sim.world.reality import KINDS

    return all(float(word) == KINDS[name.removeprefix("reality.")].ideal for word in text.split())
