"""A thin peg falls less deep, and its search detects a shallower fall."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from skills.catalogue import GRASP, SEARCH
from skills.insert.grip import grip_of
from skills.search.feel import Evidence
from skills.search.size import DIP, PUSH, STATED, THIN, fastest, firm, shallow
from skills.search.surface import SurfaceEstimate

SEARCH_PARAMS = load().cell.params(SEARCH)
SLIM = shallow(SEARCH_PARAMS, STATED / 2)
PERIOD = 0.01


def evidence_of(dip: float, hand: float) -> bool:
    """Return whether it is evidence that a thin peg's end seems to dip by `dip`, m, and the hand to drop by `hand`, m, within a scan."""
    evidence = Evidence(SLIM, SurfaceEstimate(), PERIOD)
    for k in range(400):
        edge = np.array([0.0, 1e-3 * (k % 60), 0.0])
        evidence.update(seen(0.2), edge, 1)
        evidence.learn(edge, 1)
    return evidence.update(seen(0.2 - hand), np.array([0.0, 0.03, -dip]), 1)[1]


def seen(height: float) -> SimpleNamespace:
    """Return an observation without a frame of a hand at this height, m."""
    return SimpleNamespace(
        is_new_frame=False, arm=SimpleNamespace(tcp=SimpleNamespace(position=np.array([0.5, 0.0, height])))
    )


@pytest.mark.parametrize("thickness", [1.01 * THIN, STATED, 2 * STATED])
def test_a_peg_that_is_not_thin_is_searched_with_as_stated(thickness):
    assert firm(SEARCH_PARAMS, thickness) is shallow(SEARCH_PARAMS, thickness) is SEARCH_PARAMS


def test_a_thin_peg_is_not_pushed_harder_than_weak_pads_bear():
    weak = ["peg.diameter=0.004", "hole.diameter=0.0041", "grasp.force=15"]
    config = load(None, None, weak).cell
    search, grip = config.plan().search, grip_of(config.params(GRASP))
    push = search.push_stiffness * search.push_offset
    assert push == pytest.approx(grip.bears_over_plate(search.tilt, SEARCH_PARAMS.dip_threshold))
    assert push < PUSH


def test_a_thin_peg_is_pushed_harder_and_tells_a_shallower_fall():
    thin = load(None, None, ["peg.diameter=0.004", "hole.diameter=0.0041"]).cell.plan().search
    assert thin.dip_threshold == pytest.approx(DIP * 0.004)
    assert thin.push_stiffness * thin.push_offset == pytest.approx(PUSH)
    assert thin.fall == pytest.approx(SEARCH_PARAMS.fall / 2)


def test_a_threshold_that_is_set_lower_is_kept():
    low = SEARCH_PARAMS.model_copy(update={"dip_threshold": 5e-5})
    assert shallow(low, STATED / 2).dip_threshold == 5e-5


def test_a_dip_with_which_the_hand_drops_is_evidence():
    assert evidence_of(1.5 * SLIM.dip_threshold, hand=1.1 * SLIM.drop)


def test_a_dip_of_the_tip_alone_is_a_new_angle_and_no_evidence():
    assert not evidence_of(1.5 * SLIM.dip_threshold, hand=0.9 * SLIM.drop)


def test_a_hand_that_drops_alone_is_no_evidence():
    assert not evidence_of(0.5 * SLIM.dip_threshold, hand=2.0 * SLIM.drop)


def test_a_fall_of_a_quarter_of_the_depth_is_crossed_twice_as_fast():
    assert fastest(7.5e-5, 4e-3) == pytest.approx(2.0 * fastest(3e-4, 4e-3))


def test_a_larger_dip_threshold_slows_no_lane():
    assert fastest(5e-4, 8.1e-3) == fastest(3e-4, 8.1e-3)
