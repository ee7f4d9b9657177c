"""Named errors: each writes a file that draws its sizes alone."""

import numpy as np
import pytest

from cell.config.load import load
from cell.lab import reality
from cell.lab.compare import section
from sim.config import RealityConfig
from sim.world.reality import AS_BELIEVED, KINDS, read

CONFIG = load(sets=["sim.pace=max"]).cell
ROWS = section("rows")["row"]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_a_row_draws_its_errors_at_their_size_and_no_other(row, tmp_path):
    path, sizes = tmp_path / "errors.toml", reality.figures_of(row, CONFIG)
    path.write_text(reality.errors_file(reality.errors_of(CONFIG), sizes), encoding="utf-8")
    found = read(path).draw(3, RealityConfig())
    for name, kind in KINDS.items():
        np.testing.assert_allclose(
            found[name], np.broadcast_to(sizes.get(name, kind.ideal), np.shape(AS_BELIEVED[name]))
        )


def test_every_named_error_is_a_config_of_its_own(tmp_path):
    variants = reality.named_rows(CONFIG, tmp_path, is_quick=False)
    assert len({variant.family for variant in variants}) == len(ROWS)
    for variant in variants:
        assert load(None, variant.preset, list(variant.sets)).cell.reality.file.exists()


def test_a_force_of_the_wrench_is_that_of_its_joint_torques():
    up = reality.joint_torques(CONFIG, np.array([0.0, 0.0, 4.0]))
    q, _ = CONFIG.place().postures()
    lifted = [reality.finger_frame(CONFIG.arm_model(), q + 1e-6 * unit).position[2] for unit in np.eye(7)]
    still = reality.finger_frame(CONFIG.arm_model(), q).position[2]
    np.testing.assert_allclose(up, 4.0 * (np.array(lifted) - still) / 1e-6, atol=1e-4)
