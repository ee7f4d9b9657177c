"""The technician's commands about the skin: its picture, its calibration, and each fault with its repair."""

import io
import json
import math
import re
import sys
import tomllib
from contextlib import closing, redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cell.calibrate.skin import ROD_HALF, STEP_BY_HAND, HandHeldRod, sweep
from cell.commands.cli import FAULT, GOOD, WRONG_USE, main
from cell.config.load import load
from cell.devices.assembly import bench_skin, make_estimator
from drivers.parts import Peg
from drivers.quantities import TaxelFrame
from sim.boards.terminal import Terminal
from sim.config import PadConfig
from sim.hand.pads import PadLoad, Pads
from skills.tactile.skin_gains import fit_gains, rod_angles
from tests.skins import BoardRig, can_config

FAST = ["--set", "sim.pace=max", "--set", "reality.scale=0"]
CAN = [*FAST, "--set", "skin.kind=can"]
SERIAL = [*FAST, "--set", "skin.kind=serial"]


def printed(capsys, *arguments, status=GOOD):
    """Return the output of a command with --json."""
    assert main([*arguments, "--json"]) == status
    return json.loads(capsys.readouterr().out)


def complaint(capsys, *arguments):
    """Return the one-line error message after wrong use."""
    assert main(list(arguments)) == WRONG_USE
    return capsys.readouterr().err


SOFT = 1.7e-3
"""Point spread of a pad softer than the estimators assume, m."""
OF_SOFT_PADS = ["skin.kind=can", f"boards.skin.pad.blur={SOFT}"]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """Return the output of the calibration of a skin with such pads, and the folder of the user's data."""
    folder = tmp_path_factory.mktemp("data")
    with pytest.MonkeyPatch.context() as here, redirect_stdout(io.StringIO()) as out:
        here.setenv("XDG_DATA_HOME", str(folder))
        assert main(["calibrate", "skin", "--json", *(w for key in OF_SOFT_PADS for w in ("--set", key))]) == GOOD
    return json.loads(out.getvalue()), folder


def test_calibration_is_written_to_the_users_data_and_can_be_used(calibrated, capsys):
    found, folder = calibrated
    assert found["file"] == str(folder / "tactile-insertion-cell" / "calibration" / f"skin_{found['date']}.toml")
    assert found["point_spread"] == pytest.approx(SOFT, abs=0.1e-3)
    assert printed(capsys, "skin", *CAN, "--set", f"calibration.skin={found['file']}")["figures"]["lost"] == 0


def test_calibration_brings_the_taxels_together(calibrated):
    """Gains are compared with those that the stand-in drew."""
    skin, _, _ = bench_skin(load(sets=OF_SOFT_PADS).cell, ROD_HALF)
    drawn = skin._port.link.board.hub.measure.__self__.taxels._gain
    written = tomllib.loads(Path(calibrated[0]["file"]).read_text(encoding="utf-8"))
    remaining = drawn / np.array([written["left"], written["right"]])
    before, after = (values.std() / values.mean() for values in (drawn, remaining))
    assert before > 0.045
    assert after < 0.6 * before


def error_of_theta(*sets):
    """Return the RMSE of theta over frames of soft pads, rad."""
    config, rng, errors = load(sets=sets).cell, np.random.default_rng(5), []
    estimator, pads, peg = make_estimator(config), Pads(PadConfig(blur=SOFT), config.skin.layout), config.peg
    for _ in range(50):
        theta, offset = rng.uniform(-1.3, 1.3), rng.normal(0.0, 0.7e-3)
        pressure = pads.pressure(PadLoad(theta, offset, 30.0, 0.0, 0.0, peg.length, peg.overhang, peg.diameter))
        counts = 0.05 * pressure + rng.normal(0.0, 300.0, pressure.shape)
        found = estimator.estimate(TaxelFrame(counts, np.ones(counts.shape, dtype=bool), 0.0, 0))
        errors.append(math.remainder(found.theta - theta, math.pi))
    return math.sqrt(np.mean(np.square(errors)))


def test_a_calibrated_point_spread_makes_the_angle_more_exact(calibrated):
    assert error_of_theta(f"calibration.skin={calibrated[0]['file']}") < error_of_theta()


def test_a_real_skin_is_calibrated_by_somebody_at_a_terminal(capsys, monkeypatch):
    real = ["calibrate", "skin", *CAN, "--set", "skin.channel=can-none"]
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: False))
    assert "a terminal needed" in complaint(capsys, *real)
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True))
    assert main(real) == FAULT
    assert "CAN bus socketcan can-none" in capsys.readouterr().err


def test_a_hand_held_rod_is_read_at_every_requested_angle():
    rig, angles, half = BoardRig(can_config()), rod_angles(STEP_BY_HAND), ROD_HALF

    def turn(text):
        found = re.search(r"to ([+-]\d+) degrees", text)
        theta = math.radians(float(found[1])) if found else 0.0
        rig.world.load = PadLoad(theta, 0.0, 30.0, 0.0, 0.0, half, half, 0.008) if found else None

    with closing(rig):
        rig.skin.open()
        rod = HandHeldRod(rig.skin, rig.clock, 0.01, turn)
        readings, trusted = sweep(rig.skin, rig.clock, rod, angles, 0.01, lambda done, of: None)
    peg = Peg(diameter=0.008, length=half, overhang=half, mass=0.02)
    found = fit_gains(angles.tolist(), readings, trusted, peg, "parallelogram")
    assert found.point_spread == pytest.approx(1.2e-3, abs=0.15e-3)
    assert rig.world.load is None  # a rod left between the pads would hide the print of the next peg


@pytest.mark.parametrize("kind", ["sim", "can", "serial"])
def test_both_fingers_are_shown_and_a_picture_is_saved(kind, capsys, tmp_path):
    picture = tmp_path / "new" / "skin.png"
    assert main(["skin", *FAST, "--set", f"skin.kind={kind}", "--out", str(picture)]) == GOOD
    out = capsys.readouterr().out
    assert "left finger" in out
    assert "40 of 40 taxels trusted" in out
    assert ("10.0 Hz  0 lost" in out) == (kind != "sim")
    assert picture.read_bytes()[1:4] == b"PNG"


def test_recorded_traffic_plays_back_to_the_same_frame(capsys, tmp_path):
    file = str(tmp_path / "traffic")
    live = printed(capsys, "skin", *SERIAL, "--record", file)
    again = printed(capsys, "skin", *SERIAL, "--replay", file)
    assert {**again, "figures": None} == {**live, "figures": None}
    assert 'skin.kind = "can"' in complaint(capsys, "skin", *CAN, "--replay", file)
    assert 'skin.kind = "can" or "serial" needed, not "sim"' in complaint(capsys, "skin", *FAST, "--replay", file)


@pytest.fixture
def nobody():
    """Yield a serial port without a device."""
    terminal = Terminal("nobody")
    terminal.plug_in()
    yield terminal.port
    terminal.unplug()


HUB_SILENT, SHORT = "fault 1001: skin: hub 1 does not answer: check its supply", "skin.open_timeout=0.2"
FINDINGS = {
    "sound on CAN": (CAN, [], "ok"),
    "sound on a serial line": (SERIAL, [], "ok"),
    "dead module": (CAN, ["boards.skin.dead_modules=1"], "fault 1002.*right finger, module 1 .taxels 10 to 19.: dead"),
    "dead taxels": (FAST, ["skin.dead_taxels=2"], "ok, but skin: .*finger, taxels "),
    "silent hub": (CAN, ["boards.skin.faults.unplugged=[[0.0, 100.0]]"], "fault 1001.*hub 1 does not answer"),
    "unplugged adapter": (SERIAL, ["boards.skin.faults.unplugged=[[0.0, 100.0]]"], ".*no such port: plug it in"),
    "slow wire": (SERIAL, ["skin.rate=100", "skin.baud_rate=57600"], ".*80% of skin.rate"),
    "losses": (SERIAL, ["boards.skin.faults.corrupt=0.003"], ".*messages refused: mend the wiring"),
    "no port": (SERIAL, ["skin.port=/dev/ttyNO7"], "fault 1007: serial port /dev/ttyNO7: no such port: .*, step 5$"),
    "nobody on the line": (SERIAL, ["skin.port={nobody}", SHORT], f"{HUB_SILENT} and cable.*skin.baud_rate"),
    "nobody on the bus": (
        CAN,
        ["skin.interface=virtual", "skin.channel=nobody", SHORT],
        f"{HUB_SILENT}, the wires with a terminator",
    ),
}
"""Skins: options of their wire, keys of the fault, and the beginning of the line of `check`."""


@pytest.mark.parametrize("skin", FINDINGS)
def test_check_names_the_fault_of_the_skin(skin, capsys, nobody):
    wire, keys, found = FINDINGS[skin]
    words = [word for key in ("plc.modbus.port=0", *keys) for word in ("--set", key.format(nobody=nobody))]
    lines = printed(capsys, "check", *wire, *words, status=GOOD if found.startswith("ok") else FAULT)
    assert re.match(found, next(line["found"] for line in lines if line["device"] == "skin"))
