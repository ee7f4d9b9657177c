"""A thin peg falls less deep, and its search detects a shallower fall."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from skills.catalogue import GRASP, SEARCH
from skills.insert.grip import grip_of
from skills.search.feel import Evidence
from skills.search.size import PUSH, STATED, THIN, firm, shallow
from skills.search.surface import SurfaceEstimate

SEARCH_PARAMS = load().cell.params(SEARCH)
SLIM = shallow(SEARCH_PARAMS, STATED / 2)
PERIOD = 0.01


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


def test_a_threshold_that_is_set_lower_is_kept():
    low = SEARCH_PARAMS.model_copy(update={"dip_threshold": 5e-5})
    assert shallow(low, STATED / 2).dip_threshold == 5e-5


@pytest.mark.parametrize(("dip", "drop", "is_evidence"), [(1.5, 1.1, True), (1.5, 0.9, False), (0.5, 2.0, False)])
def test_only_a_dip_with_which_the_hand_drops_is_evidence(dip, drop, is_evidence):
    """A dip of the tip alone is a new angle."""
    evidence = Evidence(SLIM, SurfaceEstimate(), PERIOD)
    for k in range(400):
        edge = np.array([0.0, 1e-3 * (k % 60), 0.0])
        evidence.update(seen(0.2), edge, 1)
        evidence.learn(edge, 1)
    edge = np.array([0.0, 0.03, -dip * SLIM.dip_threshold])
    assert evidence.update(seen(0.2 - drop * SLIM.drop), edge, 1)[1] is is_evidence
