"""The scene of the 3D view and the replay of a run hold what the run's record holds."""

import json

import numpy as np
import pytest

from cell.page.scene import CURVES, replay
from cell.page.traces import STEP
from cell.records.journal import Journal
from drivers.errors import JournalError
from drivers.scene_facts import BRIGHT, NOISE, PALETTE, felt, touch_colours
from tests.filmed_runs import HOLE, PERIOD, record

SCANS = 60


def read(data):
    """Return head and rows of a replay as a browser reads them."""
    end = 4 + int.from_bytes(data[:4], "little")
    assert end % 4 == 0
    head = json.loads(data[4:end])
    return head, np.frombuffer(data[end:], "<f4").reshape(head["rows"], -1)


@pytest.fixture(params=[True, False], ids=["simulated", "as sensed"])
def run(request, rig, tmp_path):
    with Journal(tmp_path) as journal:
        number = record(rig, journal, knows_truth=request.param, scans=SCANS)
        path = journal.samples_path(number)
    return (*read(replay(path)), request.param)


def test_a_replay_has_twenty_samples_a_second_and_the_last_one(run):
    head, rows, _ = run
    assert head["names"] == list(CURVES)
    assert np.diff(rows[:, 0])[:-1] == pytest.approx(STEP, abs=1e-6)
    assert rows[-1, 0] == pytest.approx((SCANS - 1) * PERIOD)


def test_a_hand_that_holds_no_peg_has_no_angle(run):
    head, rows, _ = run
    theta, width = (rows[:, head["names"].index(name)] for name in ("theta", "width"))
    is_held = width <= head["scene"]["peg"]["open"]
    assert np.isnan(theta[~is_held]).all()
    assert theta[is_held] == pytest.approx(0.2)


def test_a_replay_has_the_true_hole_or_the_switchs(run):
    head, rows, knows_truth = run
    x, y = (rows[-1, head["names"].index(name)] for name in "xy")
    assert head["hole"] == pytest.approx(HOLE.position[:2] if knows_truth else [x, y], abs=1e-5)
    pose = rows[-1, len(CURVES) + 7 : len(CURVES) + 14]
    assert np.isfinite(pose).all() == knows_truth


def test_a_run_without_samples_has_no_replay(tmp_path):
    with pytest.raises(JournalError, match="no samples on record"):
        replay(tmp_path / "run-000001.arrows")


def test_noise_is_drawn_as_no_touch_and_the_scale_ends_bright():
    readings = np.array([-500.0, 0.0, NOISE - 1, NOISE, BRIGHT, 2 * BRIGHT])
    shown = touch_colours(felt(readings))
    assert (shown[:3] == PALETTE[0]).all()
    assert shown[3].sum() > shown[2].sum()
    assert (shown[4:] == PALETTE[-1]).all()
