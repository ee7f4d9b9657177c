"""The estimators use the values that calibration measures."""

import math
from datetime import date

import numpy as np
import pytest

from cell.calibrate.skin import calibrate_skin
from cell.config.load import load
from cell.devices.assembly import make_estimator
from drivers.quantities import TaxelFrame
from sim.config import PadConfig
from sim.hand.pads import PadLoad, Pads

SOFT = 1.7e-3
"""Point spread of a pad softer than the estimators assume, m."""
FRAMES = 100


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Return the calibration of a skin with such pads."""
    path = tmp_path_factory.mktemp("calibration") / "skin.toml"
    soft = load(sets=["skin.kind=can", f"boards.skin.pad.blur={SOFT}"]).cell
    calibrate_skin(soft, date(2026, 11, 21), lambda done, of: None).write(path)
    return path


def error(*sets):
    """Return the RMSE of theta over frames of such pads, rad."""
    config, rng, errors = load(sets=sets).cell, np.random.default_rng(5), []
    estimator, pads, peg = make_estimator(config), Pads(PadConfig(blur=SOFT), config.skin.layout), config.peg
    for _ in range(FRAMES):
        theta, offset = rng.uniform(-1.3, 1.3), rng.normal(0.0, 0.7e-3)
        pressure = pads.pressure(PadLoad(theta, offset, 30.0, 0.0, 0.0, peg.length, peg.overhang, peg.diameter))
        counts = 0.05 * pressure + rng.normal(0.0, 300.0, pressure.shape)
        found = estimator.estimate(TaxelFrame(counts, np.ones(counts.shape, dtype=bool), 0.0, 0))
        errors.append(math.remainder(found.theta - theta, math.pi))
    return math.sqrt(np.mean(np.square(errors)))


def test_a_calibrated_point_spread_makes_the_angle_more_exact(file):
    assert error(f"calibration.skin={file}") < error()
