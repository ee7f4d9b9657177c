"""The study of a second opinion: what is tried, and what two arms differ by on the same seeds."""

import math
from pathlib import Path

import pytest

from cell.config.load import load
from cell.lab import opinion as measure
from cell.lab.opinion import Agreement, Comparison, JointFigure
from cell.lab.trials import TrialRow
from sim.arm.described_arm import DescribedArm

ARM = DescribedArm("arm.xml", "00", "link8", 0.5, None, None, ())


def row(seed: int, outcome: str, total: float, force: float) -> TrialRow:
    none = (None,) * 4
    times = (total, 0, force, 0.0, 0.0, None, None, 0.0, 0.0, None, None, True, 0.0205, 9.0, 1.0)
    return TrialRow(seed, outcome, "", "tactile_insert", *none, *times)


def compared(*differs: str) -> Comparison:
    figures = JointFigure("dry friction, N·m", (1.0,) * 7, (2.0,) * 7)
    return Comparison([Agreement("place of the flange", "mm", 0.1, 0.2)], [figures], differs)


def test_each_part_that_differs_is_tried_alone_between_the_two_arms():
    names = [each.name for each in measure.variants(ARM, Path("arm.xml"), compared("kinematics", "inertia"))]
    alone = ["its kinematics alone", "its inertia alone, weightless", "its inertia alone"]
    assert names == [measure.OURS, *alone, measure.THEIRS]


def test_links_that_do_not_differ_are_tried_together():
    names = [each.name for each in measure.variants(ARM, Path("arm.xml"), compared("friction"))]
    assert names == [measure.OURS, measure.LINKS, "its friction alone", measure.THEIRS]


def test_every_arm_is_a_key_that_the_config_takes():
    for variant in measure.variants(ARM, Path("arm.xml"), compared("kinematics", "inertia", "friction", "rotors")):
        told = load(None, None, list(variant.sets)).cell.sim.described
        assert (told is None) == (variant.name == measure.OURS)
    assert (told.flange, told.sha256, set(told.takes)) == ("link8", "00", set(measure.EVERYTHING))


def test_arms_are_compared_seed_by_seed():
    ours = [row(1, "success", 8.0, 15.0), row(2, "success", 10.0, 16.0), row(3, "failure", 30.0, 17.0)]
    theirs = [row(1, "success", 9.0, 18.0), row(2, "success", 13.0, 18.0), row(3, "success", 9.0, 18.0)]
    line = measure.paired("theirs", theirs, ours)
    assert (line.pairs, line.slower, line.harder, line.won, line.lost) == (2, pytest.approx(2.0), 2.0, 1, 0)
    assert line.slower_error == pytest.approx(1.96 * math.sqrt(2.0) / math.sqrt(2.0), rel=1e-3)
