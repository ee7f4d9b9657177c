"""A busy computer slows an insertion and does not end it."""

import json
import tomllib
from pathlib import Path

import pytest

from cell.config import load
from cell.lab.trials import run_trial

NOTHING = {"normal": {"sigma": 0.0}, "uniform": {"low": 0.0, "high": 0.0}, "factor": {"spread": 1.0}}
NOTHING |= {"lognormal": {"sigma": 0.0}, "chance": {"probability": 0.0}}


def reality_of(folder, **figures):
    """Write a file in which no error is drawn but these, each of one value, and return its path."""
    lines = []
    for group, errors in tomllib.loads(Path("config/reality.toml").read_text(encoding="utf-8")).items():
        for name, error in errors.items():
            value = figures.get(f"{group}_{name}")
            drawn = NOTHING[error["distribution"]] if value is None else {"low": value, "high": value}
            lines.append(f"[{group}.{name}]")
            lines += [f"{key} = {json.dumps(entry, ensure_ascii=False)}" for key, entry in (error | drawn).items()]
    path = folder / "reality.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize(("late", "outcome"), [(1.0, "success"), (0.2, "scan_overrun")])
def test_a_run_whose_every_scan_comes_10_ms_late_on_average_ends_only_where_that_is_not_allowed(
    tmp_path, late, outcome
):
    path = reality_of(tmp_path, scan_late=1.0, scan_delay=0.01)
    row = run_trial(load(sets=[f'reality.file="{path}"', f"scan.late={late}"]).cell, 62001)
    assert (row.reason or row.outcome) == outcome
