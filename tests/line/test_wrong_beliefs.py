"""Insertions with a wrong model of the peg in the hand, or of the arm's measured force, beside all honest errors."""

from dataclasses import replace

import pytest

import cell.devices.assembly
import sim.world.disturb
from cell.config.load import load
from cell.lab.trials import run_trial
from sim.arm.drawn_arm import drawn_arm
from tests.reality_files import reality_of


def test_a_peg_that_stands_5_mm_further_out_of_the_hand_is_inserted(tmp_path):
    path = reality_of(tmp_path, alone=False, peg_depth_in_hand=0.005)
    config = load(sets=[f'reality.file="{path}"']).cell
    row = run_trial(config, 62006)
    assert (row.outcome, row.peak_contact_force < config.limits.force) == ("success", True)


def test_an_offset_and_noise_of_the_wrench_press_no_harder(monkeypatch):
    def told(arm, drawn):
        truth = drawn_arm(arm, drawn)
        return replace(truth, wrench=replace(truth.wrench, force=(5.0, -5.0, 5.0), force_noise=2.0))

    monkeypatch.setattr(sim.world.disturb, "drawn_arm", told)
    config = load().cell
    row = run_trial(config, 62001)
    assert (row.outcome, row.peak_contact_force < config.limits.force) == ("success", True)


class Biased:
    """An estimator that reads theta wrong by the same angle in every frame."""

    def __init__(self, estimator, bias):
        self.estimator, self.bias = estimator, bias

    def estimate(self, frame):
        pose = self.estimator.estimate(frame)
        return replace(pose, theta=pose.theta + self.bias)


def adjusted_with(monkeypatch, bias, seed, *keys):
    """Return the row of a trial on stiff pads whose theta is wrong by `bias`, rad."""
    make = cell.devices.assembly.make_estimator
    monkeypatch.setattr(cell.devices.assembly, "make_estimator", lambda config: Biased(make(config), bias))
    return run_trial(load(sets=["world=v1", "hole.area=[0.02,0.02]", *keys]).cell, seed)


@pytest.mark.parametrize("bias", [-0.06, 0.06])
def test_a_peg_whose_angle_is_believed_3_degrees_wrong_is_swept_through_the_holes_axis(monkeypatch, bias):
    rows = [adjusted_with(monkeypatch, bias, seed) for seed in (159901, 159902)]
    assert [(row.outcome, row.retries, row.peak_contact_force < 25.0) for row in rows] == [("success", 0, True)] * 2
    assert max(row.adjust_time for row in rows) < 4.0
