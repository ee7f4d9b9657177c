"""The skin of the page for engineers, of five sensors on each finger, in a file of its own."""

import re
from pathlib import Path

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import make_estimator
from cell.lab.trials import run_trial
from drivers.skin.layout import module_exchanges, shape_of
from sim.hand.pads import PadLoad
from sim.hand.skin import SimSkin
from tests.skins import ScriptedWorld

SPREAD = 3e-3
"""Point spread of the elastomer, m."""


@pytest.fixture(scope="module")
def magnetic(tmp_path_factory):
    """Return the cell with the page's skin and its calibration."""
    folder = tmp_path_factory.mktemp("magnetic")
    layout, calibration = folder / "five.toml", folder / "calibration.toml"
    (figures,) = re.findall(
        r"```text\n(places = .*?)```", Path("docs/extend.md").read_text(encoding="utf-8"), re.DOTALL
    )
    layout.write_text(figures, encoding="utf-8")
    calibration.write_text(
        f'date = 2025-01-01\nlayout = "{layout}"\npoint_spread = {SPREAD}\nresidual = 0.01\nunmeasured = [[], []]\n'
        f"left = {[1.0] * 5}\nright = {[1.0] * 5}\n",
        encoding="utf-8",
    )
    keys = {"skin.layout": layout, "skin.pad.blur": SPREAD, "calibration.skin": calibration}
    return load(sets=["calibration.longest_age=3e8", *(f"{key}={value}" for key, value in keys.items())]).cell


def test_a_skin_without_modules_has_none_to_exchange(magnetic):
    layout = magnetic.skin.layout
    assert (shape_of(layout), module_exchanges(layout)) == ((2, 5), {})


def test_five_sensors_a_finger_give_theta_within_the_stated_sigma(magnetic):
    rng, estimator, found = np.random.default_rng(1), make_estimator(magnetic), []
    for theta in np.radians(np.linspace(-30.0, 30.0, 61)):
        world = ScriptedWorld()
        skin = SimSkin(magnetic.skin, world, rng)
        skin.open()
        world.load, world.time = PadLoad(theta, rng.normal(0.0, 7e-4), 30.0, 0.0, 0.0, 0.05, 0.015, 0.008), 1.0
        pose = estimator.estimate(skin.read())
        found.append((pose.theta - theta, pose.sigma, pose.healthy))
    error, sigma, healthy = np.array(found).T
    assert healthy.mean() > 0.9
    assert np.degrees(np.median(sigma)) < 3.0
    assert np.mean(np.abs(error) < 2.0 * sigma) > 0.9


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_five_sensors_a_finger_insert_a_peg(magnetic, seed):
    row = run_trial(magnetic, seed)
    assert (row.outcome, row.switch_closed) == ("success", True)
