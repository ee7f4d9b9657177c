"""Proofs of a cell, changes that make a new proof necessary, and actions permitted in commissioning."""

import shutil
from contextlib import nullcontext
from dataclasses import replace
from datetime import date
from functools import partial

import numpy as np
import pytest

from cell.calibrate.hand_motion import MOST_FORCE
from cell.calibrate.proofs import ALONG, LEAST_FORCE, LEAST_WAY, prove_switch, prove_wrench, sense
from cell.calibrate.proven import FACTS, FILE, SLOW, commissioning, in_force, keep, missing, read
from cell.commands import calibrate
from cell.commands.cli import GOOD, main
from cell.config.files import SHIPPED
from cell.config.load import load
from cell.devices.computer import UNLIMITED, settings
from cell.run.supervisor import Supervisor
from drivers.errors import NotCalibratedError, WrenchReversedError
from drivers.quantities import Pose, SwitchState
from plc_bridge.protocol.messages import Control, Refusal, Warnings
from skills.catalogue import CATALOGUE, RECOVER

TODAY = date(2026, 11, 26)
X = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def physical():
    """Return the shipped physical cell and its recipes."""
    return load(SHIPPED / "cell_01.toml")


@pytest.fixture
def proven(physical, tmp_path):
    """Return what is proven of the whole cell, kept in a file."""
    return keep(tmp_path / FILE, physical.cell, dict.fromkeys(FACTS, "measured"), TODAY)


def changed(config, **sections):
    parts = {name: getattr(config, name).model_copy(update=keys) for name, keys in sections.items()}
    return config.model_copy(update=parts)


def test_a_new_cell_is_slow_and_gentle_in_commissioning(physical, tmp_path):
    loaded, why = in_force(physical, tmp_path / FILE)
    assert why.startswith(f"in commissioning: {', '.join(FACTS)} not proven")
    for config in loaded.recipes.values():
        assert (config.speed_scale, config.limits.force) == (SLOW, MOST_FORCE)


def test_a_proven_cell_is_as_its_file_says(physical, proven, tmp_path):
    assert in_force(physical, tmp_path / FILE) == (physical, "")
    assert proven == read(tmp_path / FILE)
    fact = proven.facts["switch"]
    assert (fact.date, fact.measured) == (TODAY, "measured")
    assert physical.cell.switch.port in fact.devices
    assert physical.cell.arm.host in fact.devices


@pytest.mark.parametrize(
    ("sections", "asked"),
    [
        ({"arm": {"host": "172.16.0.3"}}, ["wrench", "end effector", "load", "places"]),
        ({"arm": {"model": "fr3v2"}}, ["wrench", "end effector", "load", "places"]),
        ({"gripper": {"host": "172.16.0.3"}}, ["end effector", "load", "places"]),
        ({"skin": {"channel": "can1"}}, ["load", "places"]),
        ({"switch": {"port": "/dev/ttyUSB7"}}, ["switch"]),
        ({"hole": {"centre": (0.5, 0.01, 0.1)}}, ["places"]),
        ({"limits": {"force": 40.0}}, []),
    ],
)
def test_a_changed_device_or_place_needs_a_new_proof(physical, proven, sections, asked):
    assert missing(changed(physical.cell, **sections), proven) == asked


def test_a_calibration_moves_slowly_and_gently_until_all_is_proven(physical, tmp_path, monkeypatch):
    for name in ("cell_01.toml", "sim.toml"):
        shutil.copy(SHIPPED / name, tmp_path)
    found = []
    monkeypatch.setitem(calibrate.DEVICES, "probe", lambda args, config, today, path: found.append(config) or GOOD)
    command = ["calibrate", "probe", "--config", str(tmp_path / "cell_01.toml")]
    main(command)
    keep(tmp_path / "calibration" / FILE, physical.cell, dict.fromkeys(FACTS, "measured"), TODAY)
    main(command)
    assert [config.speed_scale for config in found] == [SLOW, physical.cell.speed_scale]


def test_a_damaged_file_proves_nothing(physical, proven, tmp_path):
    (tmp_path / FILE).write_text("{", encoding="utf-8")
    assert missing(physical.cell, read(tmp_path / FILE)) == list(FACTS)


def test_a_simulated_cell_is_never_in_commissioning(loaded, tmp_path):
    assert in_force(loaded, tmp_path / FILE) == (loaded, "")
    assert commissioning(loaded.cell, read(tmp_path / FILE)) == ""


@pytest.mark.parametrize("code", [next(iter(CATALOGUE.by_code)), RECOVER.code])
def test_a_plc_starts_nothing_in_commissioning_and_reads_why(rig, code):
    rig.supervisor = Supervisor(replace(rig.cell, commissioning="not proven"), rig.loaded, rig.bridge, rig.journal)
    rig.scan()
    report = rig.command(code)
    assert report.refusal == Refusal.COMMISSIONING
    assert report.warnings & Warnings.COMMISSIONING
    assert rig.command(Control.STOP).refusal == Refusal.NONE


@pytest.mark.parametrize(
    ("force", "way", "found"),
    [
        (LEAST_FORCE * X, LEAST_WAY * X, 1),
        (-LEAST_FORCE * X, LEAST_WAY * X, -1),
        (0.99 * LEAST_FORCE * X, LEAST_WAY * X, 0),
        (LEAST_FORCE * X, 0.99 * LEAST_WAY * X, 0),
        (20.0 * np.array([0.9 * ALONG, 1.0, 0.0]), 0.01 * X, 0),
    ],
)
def test_a_push_counts_if_force_and_way_are_along_one_line(force, way, found):
    assert sense(force, way) == found


@pytest.mark.parametrize(
    ("sign", "error", "told"),
    [
        (1.0, None, "15 N along a push of 5.0 mm"),
        (-1.0, WrenchReversedError, "reports 15 N against the push"),
        (0.0, NotCalibratedError, "no push of 5 N"),
    ],
)
def test_a_push_on_the_hand_proves_the_sign_of_the_wrench(rig, sign, error, told):
    def push():
        rig.arm.tcp = Pose(rig.arm.tcp.position + 0.005 * X, rig.arm.tcp.rotation)
        rig.arm.force = sign * 15.0 * X

    if sign:
        rig.at(1.0, push)
    with pytest.raises(error, match=told) if error else nullcontext():
        assert prove_wrench(rig.cell, lambda text: None) == told


def test_only_a_press_on_the_lever_proves_the_switch(rig):
    with pytest.raises(NotCalibratedError, match="switch: not seen closed"):
        prove_switch(rig.cell, lambda text: None)
    for delay, state in ((1.0, SwitchState.CLOSED), (2.0, SwitchState.OPEN)):
        rig.at(delay, partial(setattr, rig.switch, "state", state))
    assert prove_switch(rig.cell, lambda text: None) == "open, closed and open again"


@pytest.mark.parametrize(
    ("readings", "wrong"),
    [
        ((True, UNLIMITED, 99, {"performance"}), []),
        ((True, UNLIMITED, UNLIMITED, set()), []),
        ((False, UNLIMITED, 80, {"performance"}), ["kernel"]),
        ((True, 102400 * 1024, 80, {"performance"}), ["memlock"]),
        ((True, UNLIMITED, 79, {"performance"}), ["priority"]),
        ((True, UNLIMITED, 80, {"performance", "powersave"}), ["governor"]),
    ],
)
def test_a_computer_unfit_for_the_loop_is_reported(readings, wrong):
    assert [name for name, text in settings(*readings) if text != "ok"] == wrong
