"""The commands of docs/first-day.md that move nothing, one after the other, on the desk with a person beside it."""

import json
import shutil
import time

import pytest

pytest.importorskip(
    "franka_sim", reason="needs the packages that tests/franka/simulated.py names", exc_type=ImportError
)

from cell.calibrate.proven import FACTS
from tests.emulation import emulated_or_skip
from tests.franka.desk import FILE, desk

pytestmark = pytest.mark.alone


def test_a_new_cell_is_proven_by_the_commands_of_the_first_day(tmp_path):
    emulated_or_skip()
    began = time.monotonic()
    with desk(8) as boards:
        boards.file = tmp_path / FILE.name
        shutil.copy(FILE, boards.file)

        def proven(printed):
            return next(line["found"] for line in json.loads(printed) if line["device"] == "proven")

        new = proven(boards.run("check", "--json").stdout)
        assert all(fact in new for fact in FACTS), new
        assert boards.run("where").returncode == 0
        assert json.loads(boards.run("check", "--loop", "--minutes", "0.05", "--json").stdout)["cycles"] > 0
        assert proven(boards.prove()).startswith("ok, but in commissioning: places not proven")
        assert "places not proven" in proven(boards.run("check", "--json").stdout)
    print(f"steps 7 and 8 of the first day: {time.monotonic() - began:.0f} s")
