"""The shipped file of a physical cell, in a process of its own, with every board at its wire."""

import json

import pytest

pytest.importorskip(
    "franka_sim", reason="needs the packages that tests/franka/simulated.py names", exc_type=ImportError
)

from tests.emulation import emulated_or_skip
from tests.franka.desk import desk

pytestmark = pytest.mark.alone


def test_a_cell_is_found_whole_by_its_file_and_a_board_that_is_pulled_is_named(tmp_path):
    emulated_or_skip()
    with desk(7, tmp_path) as boards:
        found = {line["device"]: line["found"] for line in json.loads(boards.run("check", "--json").stdout)}
        boards.pull_switch()
        then = {line["device"]: line["found"] for line in json.loads(boards.run("check", "--json").stdout)}
    # The lateness of scans depends on the machine.
    assert {name: text for name, text in found.items() if name not in ("clock", "network", "proven")} == {
        **dict.fromkeys(("arm", "end effector", "load", "gripper", "skin", "switch", "plc"), "ok"),
        "system": "ok, with the interface that pylibfranka needs",
        "thresholds": "ok, 60 N·m and 60 N taken by the arm",
        "calibration.skin": "ok, but there is none: `cell calibrate skin`",
        "calibration.arm": "ok, but there is none: `cell calibrate arm`",
    }
    assert "no such port: plug it in" in then["switch"]
    assert then["switch"].endswith("; docs/first-day.md, step 6")
    assert then["skin"] == "ok"
