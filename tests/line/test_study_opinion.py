"""`cell study opinion`: the figures of a public description of the FR3, and one whole trial on its arm."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from cell.commands.cli import GOOD, main
from cell.lab.opinion import FILE, PACKAGE

BESIDE = Path(__file__).parents[2] / "build" / "franka" / PACKAGE
"""Folder in which `.ci/run` installs the package that carries the description."""
URDF = Path(next(iter(found.submodule_search_locations or ())) if (found := find_spec(PACKAGE)) else BESIDE) / FILE


@pytest.mark.skipif(
    not URDF.is_file(), reason="franka-sim, which carries the description, is not installed; .ci/run does"
)
def test_the_public_fr3_agrees_with_ours_and_seats_the_peg(capsys, tmp_path):
    words = [
        "--model",
        str(URDF),
        "--set",
        "arm.model=fr3",
        "--seed",
        "102001",
        "--workers",
        "1",
        "--out",
        str(tmp_path),
    ]
    assert main(["study", "opinion", "--quick", *words, "--json"]) == GOOD
    told = json.loads(capsys.readouterr().out)
    place, angle, mass, weight = (each["worst"] for each in told["comparison"]["agreements"])
    assert max(place, angle) < 1e-6
    assert (mass, weight) == (pytest.approx(0.0, abs=1e-3), pytest.approx(0.0, abs=1e-3))
    (line,) = told["lines"]
    assert (line["name"], line["successes"]) == ("the described arm", 1)
