"""The rows of stated errors: each writes a file that draws its sizes alone, and ends once nothing is left to be learnt."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from cell.lab.reality import rows
from cell.lab.reality.measure import errors_of
from cell.lab.results import result_of
from sim.config import RealityConfig
from sim.reality import KINDS, read
from tests.trial_rows import SEATED

CONFIG = load(sets=["sim.pace=max"]).cell
ERRORS = errors_of(CONFIG)


def drawn(row, tmp_path):
    """Return what the file of a row draws for some seed."""
    path = tmp_path / "errors.toml"
    path.write_text(rows.errors_file(ERRORS, rows.figures_of(row, CONFIG)), encoding="utf-8")
    return read(path).draw(3, RealityConfig())


@pytest.mark.parametrize("row", rows.ROWS, ids=lambda row: row.name)
def test_a_row_draws_its_errors_at_their_size_and_no_other(row, tmp_path):
    found, sizes = drawn(row, tmp_path), rows.figures_of(row, CONFIG)
    for name, kind in KINDS.items():
        np.testing.assert_allclose(found[name], np.broadcast_to(sizes.get(name, kind.ideal), kind.shape))


def test_names_are_told_apart():
    assert len({row.name for row in rows.ROWS}) == len(rows.ROWS)


def test_a_force_of_the_wrench_is_that_of_its_joint_torques():
    up = rows.joint_torques(CONFIG, np.array([0.0, 0.0, 4.0]))
    q, _ = CONFIG.place().postures()
    lifted = [rows.finger_frame(CONFIG.arm_model(), q + 1e-6 * unit).position[2] for unit in np.eye(7)]
    still = rows.finger_frame(CONFIG.arm_model(), q).position[2]
    np.testing.assert_allclose(up, 4.0 * (np.array(lifted) - still) / 1e-6, atol=1e-4)


def test_blocks_double_and_hold_every_seed_once():
    assert [len(block) for block in rows.blocks(range(7, 27))] == [4, 4, 8, 4]
    assert [seed for block in rows.blocks(range(7, 27)) for seed in block] == list(range(7, 27))


@pytest.mark.parametrize(("lost", "goes_on"), [(1, True), (2, False)])
def test_a_row_that_can_no_longer_be_borne_ends(lost, goes_on):
    trials = [replace(SEATED, outcome="failure" if n < lost else "success") for n in range(4)]
    assert rows.may_be_borne(trials) == goes_on


def test_a_result_counts_what_is_within_20_n_and_names_what_was_lost():
    lost = replace(SEATED, outcome="failure", stage="spray_search", reason="no_hole", peak_contact_force=20.5)
    found = result_of("some error", [SEATED, lost])
    assert (found.successes, found.trials, found.within, found.mean) == (1, 2, 1, 8.0)
    assert found.endings == "1 x spray_search no_hole"
