"""`cell calibrate places`: it finds the drawn places with bounded force, and writes nothing if it finds none."""

import json
import math
import signal
from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from cell.calibrate import places as module
from cell.calibrate.places import MOST_FORCE, calibrate_places
from cell.commands.cli import GOOD, NOT_GOOD, main
from cell.config.load import load
from drivers.errors import NotCalibratedError
from tests.reality_files import errors

RACK = (0.0015, -0.001, 0.0)


def calibrate(key, folder, *options):
    """Return the status of a calibration with two pegs, a key and a folder for the file."""
    return main(["calibrate", "places", "--pegs", "2", "--set", key, "--out", str(folder), *options])


def test_plate_and_rack_are_found_where_drawn_with_bounded_force(tmp_path, capsys, monkeypatch):
    forces, touch_off = [], module.touch_off

    def touched(place, transfer, touch, ctx):
        record = lambda seen, setpoint: forces.append(np.linalg.norm(seen.arm.wrench.force))  # noqa: E731
        ctx.callbacks = replace(ctx.callbacks, record=record)
        return touch_off(place, transfer, touch, ctx)

    monkeypatch.setattr(module, "touch_off", touched)
    drawn = errors(tmp_path, place_plate_height=0.002, place_plate_tilt=0.01, place_rack=RACK)
    assert calibrate(drawn, tmp_path / "new", "--json") == GOOD
    found = json.loads(capsys.readouterr().out)
    assert abs(found["height"] - 0.102) < found["height_interval"] < 1.2e-3
    assert [math.hypot(*lean) for lean in found["lean"]] == pytest.approx([0.01, 0.01], abs=1.5e-3)
    assert np.all(np.abs(np.subtract(found["rack"], RACK[:2])) < found["rack_interval"])
    assert max(forces) < MOST_FORCE
    assert (tmp_path / "new" / f"places_{found['date']}.toml").read_text(encoding="utf-8").endswith(found["write"])
    assert found["write"].startswith("[hole]\ncentre = [0.50000, 0.00000, 0.10")


def test_nothing_is_written_of_a_plate_that_is_not_there(tmp_path, capsys):
    assert calibrate(errors(tmp_path, place_plate_height=-0.02), tmp_path / "new") == NOT_GOOD
    assert "nothing to touch at x = 0.450" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_too_much_force_ends_the_calibration(monkeypatch):
    monkeypatch.setattr(module, "MOST_FORCE", 2.0)
    with pytest.raises(NotCalibratedError, match=r"no peg from slot 1: FORCE_LIMIT|FORCE_LIMIT at 2 N allowed"):
        calibrate_places(load(sets=["sim.seed=80001"]).cell, date.today(), lambda done, of: None, 2)


def test_an_interruption_leaves_the_arm_at_rest_and_the_old_file(tmp_path, monkeypatch, capsys):
    old, seen = tmp_path / f"places_{date.today().isoformat()}.toml", []
    old.write_text("old\n", encoding="utf-8")

    def broken_off(place, transfer, touch, ctx):
        seen.append(ctx)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(module, "touch_off", broken_off)
    assert calibrate("reality.scale=0", tmp_path) == NOT_GOOD
    assert capsys.readouterr().err == "cell: stopped\n"
    assert [file.read_text(encoding="utf-8") for file in tmp_path.iterdir()] == ["old\n"]
    assert seen[0].lead.rest.is_reached
