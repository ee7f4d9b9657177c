"""The contact gates measure the same as with the pinned release of the physics, so that a drift in another is detected."""

import math
import re
from importlib.metadata import version
from pathlib import Path

import mujoco
import pytest

from drivers.part.round import Round
from sim.contact import rig
from sim.world import native

ROOT = Path(__file__).parents[2]
PEG, HOLE = Round(0.008), Round(0.0081)
# measured 2026-11-21 with mujoco 3.17.0, frictionless, 10 N for 1.5 s at 0.5 ms
DEPTHS = {1: 5.812103e-3, 2: 3.006852e-3, 5: 1.4914882e-3, 15: 1.3905797e-3, 45: 2.4431720e-3}
DRIFT = 1e-5
"""Relative; ten times less than the models on either side of the shipped one differ."""


@pytest.mark.parametrize(("degrees", "depth"), DEPTHS.items())
def test_a_pushed_peg_stops_where_it_did_with_the_pinned_release(degrees: int, depth: float) -> None:
    tilt = math.radians(degrees)
    pushed = rig.push(rig.tilted_peg(PEG, HOLE, tilt, 0.3, 0.0, 0.0005), PEG, tilt, 0.3, 10.0, 1.5)
    assert pushed.depth == pytest.approx(depth, rel=DRIFT), (
        f"mujoco {mujoco.mj_versionString()} moves the contact gates"
    )
    assert pushed.penetration < 0.5e-6
    assert pushed.speed < 1e-3


def test_a_leaning_peg_slides_without_seams_as_with_the_pinned_release() -> None:
    over = rig.tilted_peg(PEG, HOLE, math.pi / 4, 0.0, 0.0, 0.0005)
    assert rig.drag(over, PEG, math.pi / 4, 0.4, 0.0065) < 1e-4


def test_the_contacts_rely_on_the_release_that_is_pinned() -> None:
    pins = [
        re.search(r"mujoco==([\d.]+)", (ROOT / name).read_text(encoding="utf-8"))
        for name in ("constraints.txt", "pyproject.toml")
    ]
    assert [pin and pin[1] for pin in pins] == [native.MUJOCO_VERSION] * 2
    assert version("mujoco") == mujoco.mj_versionString() == native.MUJOCO_VERSION
