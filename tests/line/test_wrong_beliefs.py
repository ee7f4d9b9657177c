"""Insertions by a cell that is wrong about the peg in its hand, or about the force that its arm tells, beside all honest errors."""

from dataclasses import replace

import sim.disturb
from cell.config import load
from cell.lab.trials import run_trial
from sim.drawn_arm import drawn_arm
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

    monkeypatch.setattr(sim.disturb, "drawn_arm", told)
    config = load().cell
    row = run_trial(config, 62001)
    assert (row.outcome, row.peak_contact_force < config.limits.force) == ("success", True)
