"""The skin of the page for engineers: a file with five sensors on each finger, and their board's port in one module."""

import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, make_estimator, opened
from drivers.skin.board_config import BoardSkinConfig
from drivers.skin.boards import BoardSkin
from drivers.skin.layout import module_exchanges, shape_of
from sim.hand.pads import PadLoad
from sim.hand.skin import SimSkin
from skills.catalogue import CATALOGUE
from skills.contract import Outcome
from tests.skins import ScriptedWorld

SPREAD = 3e-3
"""Point spread of the elastomer, m."""
PAGE = Path("docs/extend.md").read_text(encoding="utf-8")
FIELD = np.array([200.0, -100.0, 3000.0])
"""Field of an untouched sensor, counts of its converter."""
PRESSED = np.array([0.3, 0.1, 1.0])
"""Rise of the field for each count of a simulated taxel."""


@pytest.fixture(scope="module")
def magnetic(tmp_path_factory):
    """Return the cell with the page's skin and its calibration."""
    folder = tmp_path_factory.mktemp("magnetic")
    layout, calibration = folder / "five.toml", folder / "calibration.toml"
    (figures,) = re.findall(r"```text\n(places = .*?)```", PAGE, re.DOTALL)
    layout.write_text(figures, encoding="utf-8")
    calibration.write_text(
        f'date = 2025-01-01\nlayout = "{layout}"\npoint_spread = {SPREAD}\nresidual = 0.01\nunmeasured = [[], []]\n'
        f"left = {[1.0] * 5}\nright = {[1.0] * 5}\n",
        encoding="utf-8",
    )
    # A fifth of the shipped skin's counts.
    counts = {"skin.full_scale": 4000.0, "skin.sensitivity": 0.01, "skin.offset": 1000.0}
    keys = {"skin.layout": layout, "skin.pad.blur": SPREAD, "calibration.skin": calibration, **counts}
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


class Board:
    """A serial line of ten magnetometers: for each frame of a simulated skin, a line with their fields."""

    character_time = 0.0

    def __init__(self, skin):
        self._skin, self._sent = skin, -1
        self.open, self.close = skin.open, skin.close

    def read(self, timeout):
        frame = self._skin.read()
        if frame.sequence == self._sent:
            return b""
        self._sent = frame.sequence
        fields = np.rint(FIELD + frame.values[..., None] * PRESSED)
        return " ".join(f"{value:.0f}" for value in fields.ravel()).encode() + b"\n"


def test_a_skin_of_magnetometers_inserts_a_peg(magnetic):
    (code,) = re.findall(r"```python drivers/skin/magnetometers\.py\n(.*?)```", PAGE, re.DOTALL)
    module = ModuleType("magnetometers")
    exec(code, module.__dict__)  # what the page prints
    cell = assemble(magnetic.model_copy(update={"sim": magnetic.sim.model_copy(update={"pace": "max", "seed": 1})}))
    config = BoardSkinConfig(layout=magnetic.skin.layout)
    port = module.Magnetometers(Board(cell.skin))
    with opened(replace(cell, skin=BoardSkin(config, port, cell.clock))) as wired:
        records = CATALOGUE["insert_peg"].run(magnetic.skill_set(), wired.context(1))
        assert records[-1].result.outcome is Outcome.SUCCESS
        assert wired.truth().switch_closed
    assert port.refused() == 0
