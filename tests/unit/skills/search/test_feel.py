"""Evidence of an edge by the height of the plate, and how far the peg reaches from the hand by its touch."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, end_point
from drivers.quantities import Pose
from skills.catalogue import GRASP, SEARCH
from skills.held_peg import EXPLAINED
from skills.insert.grip import grip_of
from skills.search.feel import LONGEST_SLIP, EdgeEvidence, excess_of
from skills.search.size import firm, shallow
from skills.search.surface import SurfaceEstimate
from tests.fakes import HAND_DOWN

CONFIG = load().cell
PARAMS = CONFIG.params(SEARCH)
PERIOD, SPEED, RUN_UP = 0.01, 0.14, 0.15


def blind(height: float = 0.0, force: float = 6.0) -> SimpleNamespace:
    """Return an observation of a hand at this height, m, that bears down with this force, N."""
    tcp, wrench = SimpleNamespace(position=height * UP), SimpleNamespace(force=force * UP)
    return SimpleNamespace(arm=SimpleNamespace(tcp=tcp, wrench=wrench))


def known_plate():
    """Return the estimate of a level plate that the peg has slid over."""
    known = SurfaceEstimate()
    for k in range(400):
        known.learn(np.array([0.0, 1e-3 * (k % 60), 0.0]))
    return known


DIP = PARAMS.dip_threshold
EVIDENCE = {
    "shallow after the run-up where the hole is likely": (5e-4, 15, {"is_likely": True}, True),
    "on the first lane": (5e-4, 15, {}, True),
    "on the first lane with the push that is lost": (5e-4, 20, {"unloaded": 3.0}, True),
    "later on the first lane": (5e-4, 60, {"unloaded": 3.0}, True),
    "early without the hand": (0.9 * DIP, 15, {"with_hand": 0.2}, False),
    "without the hand": (0.9 * DIP, 300, {"with_hand": 0.2}, False),
    "less than the threshold": (0.75 * DIP, 300, {}, False),
    "less than the threshold and less push borne": (0.75 * DIP, 300, {"unloaded": 1.5}, True),
    "the same before it is known what the plate bears": (0.75 * DIP, 8, {"unloaded": 1.5}, False),
    "more than the threshold and more push borne": (1.5 * DIP, 300, {"unloaded": -2.0}, False),
    "less push borne at one height": (0.0, 300, {"unloaded": 6.0}, False),
    "first lane on a plate that leans by one degree": (0.0, 90, {"slope": 0.017}, False),
    "first lane on a plate that leans by two degrees": (0.0, 90, {"slope": 0.035}, True),
    "level plate where the hole is likely": (0.0, 60, {"is_likely": True}, False),
}


@pytest.mark.parametrize(("dip", "scans", "how", "is_edge"), EVIDENCE.values(), ids=EVIDENCE)
def test_what_is_evidence_of_an_edge(dip, scans, how, is_edge):
    assert falls(dip, scans, **how) is is_edge


def falls(dip, scans, *, is_likely=False, slope=0.0, with_hand=1.0, unloaded=0.0):
    """Return whether there is evidence of an edge that runs up from rest over a plate, down its slope, and after so many scans
    falls by `dip`, m, within three scans and stays there for five.

    The hand goes down by `with_hand` of what the edge does, and the plate then bears less by `unloaded`, N.
    """
    evidence, place = EdgeEvidence(PARAMS, SurfaceEstimate(), PERIOD), 0.0
    for k in range(scans + 8):
        place += PERIOD * SPEED * min(k * PERIOD / RUN_UP, 1.0)
        fallen = min(max(k - scans, 0) / 3, 1.0)
        edge = np.array([0.0, place, -slope * place - dip * fallen])
        below, is_edge = evidence.update(blind(with_hand * edge[2], 6.0 - unloaded * fallen), edge, is_likely)
        if is_edge:
            return True
        assert dip or not is_likely or below <= 0.0
        evidence.learn(edge)
    return False


@pytest.mark.parametrize(
    ("params", "dip", "is_likely", "is_edge"),
    [
        (PARAMS, 0.75, False, False),
        (PARAMS, 0.75, True, True),
        (CONFIG.corner.searching(PARAMS), 0.75, True, False),
        (CONFIG.corner.searching(PARAMS), 1.5, True, True),
    ],
    ids=["elsewhere", "where the hole is likely", "under a corner", "whole dip under a corner"],
)
def test_half_the_threshold_counts_only_where_the_hole_is_likely(params, dip, is_likely, is_edge):
    evidence, fallen = EdgeEvidence(params, known_plate(), PERIOD), dip * params.dip_threshold + 1e-5
    evidence.update(blind(), np.array([0.0, 0.03, 0.0]), is_likely)
    assert evidence.update(blind(-fallen / 2), np.array([0.0, 0.03, -fallen]), is_likely)[1] is is_edge


def test_slow_scans_compare_the_force_of_the_plate_too():
    evidence = EdgeEvidence(PARAMS, known_plate(), 0.05)
    for height, force, is_edge in (*[(0.0, 6.0, False)] * 4, (-0.75 * DIP, 4.0, True)):
        assert evidence.update(blind(height, force), np.array([0.0, 0.03, height]))[1] is is_edge


def test_a_fall_under_way_does_not_take_the_estimate_with_it():
    """The rest below the full dip is the uncertainty of slopes that were never touched."""
    evidence = EdgeEvidence(PARAMS, SurfaceEstimate(), PERIOD)
    for k in range(40):
        evidence.learn(np.array([0.0, 1e-3 * k, 0.0]))
    before, _ = evidence.update(blind(), np.array([0.0, 0.04, -5e-4]))
    for k in range(round(PARAMS.late / PERIOD)):
        evidence.learn(np.array([0.0, 0.04 + 1e-3 * k, -5e-4]))
    after, _ = evidence.update(blind(), np.array([0.0, 0.04, -5e-4]))
    assert after == pytest.approx(before, abs=5e-5)


SLIM = shallow(PARAMS, PARAMS.stated / 2)


@pytest.mark.parametrize("thickness", [1.01 * PARAMS.thin, PARAMS.stated, 2 * PARAMS.stated])
def test_a_peg_that_is_not_thin_is_searched_with_as_stated(thickness):
    assert firm(PARAMS, thickness) is shallow(PARAMS, thickness) is PARAMS


def test_a_thin_peg_is_not_pushed_harder_than_weak_pads_bear():
    weak = ["peg.diameter=0.004", "hole.diameter=0.0041", "grasp.force=15"]
    config = load(None, None, weak).cell
    search, grip = config.plan().search, grip_of(config.params(GRASP))
    push = search.push_stiffness * search.push_offset
    assert push == pytest.approx(grip.bears_over_plate(search.tilt, PARAMS.dip_threshold))
    assert push < PARAMS.thin_push


def test_a_threshold_that_is_set_lower_is_kept():
    low = PARAMS.model_copy(update={"dip_threshold": 5e-5})
    assert shallow(low, low.stated / 2).dip_threshold == 5e-5


@pytest.mark.parametrize(("dip", "drop", "is_evidence"), [(1.5, 1.1, True), (1.5, 0.9, False), (0.5, 2.0, False)])
def test_only_a_dip_with_which_the_hand_drops_is_evidence(dip, drop, is_evidence):
    """A dip of the tip alone is a new angle, or one that a rest has judged already."""
    evidence = EdgeEvidence(SLIM, known_plate(), PERIOD)
    evidence.update(blind(0.2), np.array([0.0, 0.03, 0.0]))
    edge = np.array([0.0, 0.03, -dip * SLIM.dip_threshold])
    assert evidence.update(blind(0.2 - drop * SLIM.shared * SLIM.dip_threshold), edge)[1] is is_evidence


BOUND, LENGTH = 0.006, 0.05


def axis_at(tilt):
    return np.array([math.sin(tilt), 0.0, math.cos(tilt)])


@pytest.mark.parametrize(
    ("reached", "has_touched", "believed"),
    [
        (0.99 * EXPLAINED, False, 0.0),
        (0.99 * BOUND, False, 0.99 * BOUND),
        (1.01 * BOUND, False, None),
        (1.01 * BOUND, True, None),
        (-0.99 * LONGEST_SLIP, True, -0.99 * LONGEST_SLIP),
        (-1.01 * LONGEST_SLIP, True, None),
    ],
    ids=["other errors explain it", "bound", "beyond", "no peg grows", "slip by half the pads", "beyond half the pads"],
)
def test_length_and_slip_of_a_peg_are_believed_up_to_bounds(reached, has_touched, believed):
    found = excess_of(reached * math.cos(0.7854), axis_at(0.7854), BOUND, has_touched=has_touched)
    assert found == (believed and pytest.approx(believed))


@pytest.mark.parametrize("is_plate_high", [False, True])
def test_a_seated_peg_is_as_deep_as_the_switch_expects(is_plate_high):
    """Depth of the hole 20 mm, tolerance 4 mm: the correction must serve a long peg and a high plate alike."""
    error, tilt, depth = 0.005, 0.7854, 0.02
    height, longer = (error, 0.0) if is_plate_high else (0.0, error)
    # The hand when the tilted tip touches the true plate; the believed plate is at 0.
    touched = height + (LENGTH + longer) * math.cos(tilt) - LENGTH * math.cos(tilt)
    excess = excess_of(touched, axis_at(tilt), 0.01)
    seated = Pose((height - depth + LENGTH + longer) * UP, HAND_DOWN)
    tip, _ = end_point(seated, 0.0, LENGTH + excess)
    assert -tip[2] == pytest.approx(depth, abs=0.0025)
