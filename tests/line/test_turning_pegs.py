"""A grip that lets the peg turn and slide in the hand, with all honest errors."""

import pytest

from cell.config.load import load
from cell.lab.compare import chosen
from cell.lab.trials import run_trial


@pytest.mark.parametrize("seed", [81018])
def test_a_peg_that_turns_in_weak_pads_is_inserted(seed):
    """Pads that bear 6.8 N, on a plate with a friction of 0.4: the peg turns by 20 degrees at once, and is held anew in the air."""
    row = run_trial(load(None, None, list(chosen("touch", True)[0].sets)).cell, seed)
    assert row.outcome == "success"
    assert row.grip_slip < 5e-3
