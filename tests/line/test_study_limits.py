"""The study of limits, with one trial of each preset: every phase takes at least the time of its bound."""

import csv
import io
import json
from contextlib import redirect_stdout

import pytest

from cell.commands.cli import main
from cell.commands.terminal import GOOD
from cell.lab.limits import COVER, DAMPED, DOWN, TURN, WALLS


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return what the command printed, and its folder."""
    folder = tmp_path_factory.mktemp("limits")
    words = ["--quick", "--json", "--workers", "1", "--seed", "5", "--set", "hole.area=[0.02,0.02]"]
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["study", "limits", *words, "--out", str(folder)]) == GOOD
    return json.loads(printed.getvalue()), folder


@pytest.mark.parametrize("phase", [TURN, DOWN, DAMPED])
def test_no_phase_is_quicker_than_its_bound(study, phase):
    for line in study[0]["lines"]:
        if line["phase"] == phase:
            assert 0.0 < line["bound"] < line["reached"]


def test_every_phase_has_a_line_for_each_preset(study):
    found, folder = study
    phases = [(variant, phase) for variant in ("default", "fast") for phase in (COVER, TURN, DOWN, DAMPED, WALLS)]
    assert [(line["variant"], line["phase"]) for line in found["lines"]] == phases
    with (folder / "limits.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(phases)
    assert (folder / "limits.png").read_bytes()[:4] == b"\x89PNG"
