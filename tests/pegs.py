"""Frames of pegs held anyhow, made by the stand-in's pads and not by the estimators' templates."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from cell.config.load import load
from drivers.quantities import TaxelFrame
from sim.config import SimSkinConfig
from sim.hand.pads import PadLoad, Pads
from skills.tactile.robust import RobustEstimator, RobustParams

LOAD = PadLoad(0.0, 0.0, 30.0, 0.0, 0.0, 0.05, 0.015, 0.008)
SKIN = SimSkinConfig(kind="sim")
ALL = np.ones((2, 20), dtype=bool)
TAXELS = np.arange(40).reshape(2, 20)


@lru_cache
def shipped():
    return load(sets=["reality.scale=0.0"]).cell


@lru_cache
def untaught(layout):
    """Return the estimator by prints, which has learnt nothing yet; what teaches it uses a copy."""
    return RobustEstimator(RobustParams(), layout, shipped().peg)


@lru_cache
def pads(layout):
    return Pads(SKIN.pad, layout)


def readings(layout, load, rng=None, noise=SKIN.noise):
    """Return what the taxels read above their baseline, counts; without `rng` as no real skin does."""
    values = SKIN.sensitivity * pads(layout).pressure(load)
    if rng is not None:
        values = values * rng.normal(1.0, SKIN.gain_spread, values.shape)
        values = values + noise * SKIN.full_scale * rng.standard_normal(values.shape)
    return values


def framed(values, trusted=ALL):
    return TaxelFrame(np.where(trusted, values, 0.0), trusted, 1.5, 7)


def pushed(rng, theta, offset, peg=LOAD):
    across = rng.uniform(-7.0, 7.0)
    return replace(peg, theta=theta, offset=offset, across=across, tilting=0.045 * across)


def folded(angle):
    """Return an angle folded to what a peg that looks the same from both ends can differ by."""
    return (angle + math.pi / 2) % math.pi - math.pi / 2


def swept(estimator, layout, spoil=lambda rng, values: (values, ALL), count=321, seed=11, peg=LOAD):
    """Return error of theta, rad, its sigma, error of the offset, m, and health over the whole range of angles."""
    rng, rows = np.random.default_rng(seed), []
    for theta in np.radians(np.linspace(-80.0, 80.0, count)):
        load = pushed(rng, theta, rng.normal(0.0, 0.7e-3), peg)
        pose = estimator.estimate(framed(*spoil(rng, readings(layout, load, rng))))
        rows.append((folded(pose.theta - theta), pose.sigma, pose.offset - load.offset, pose.healthy))
    return np.array(rows).T


def rms_degrees(errors):
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


NONSENSE = {
    "all zero": lambda rng: np.zeros((2, 20)),
    "noise alone": lambda rng: rng.normal(0.0, 300.0, (2, 20)),
    "loud noise": lambda rng: rng.normal(0.0, 3000.0, (2, 20)),
    "all at the rail": lambda rng: np.full((2, 20), 38000.0),
    "pressed all over": lambda rng: 8000.0 + rng.normal(0.0, 300.0, (2, 20)),
    "drawn at random": lambda rng: rng.uniform(0.0, 20000.0, (2, 20)),
    "below the baseline": lambda rng: np.full((2, 20), -5000.0),
    "one taxel alone": lambda rng: np.where(TAXELS == 7, 15000.0, rng.normal(0.0, 300.0, (2, 20))),
}
"""Readings that show no peg, counts, drawn with a generator."""
