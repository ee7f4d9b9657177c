"""Evidence of an edge by the height of the plate, also where little of it was felt yet."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from skills.catalogue import SEARCH
from skills.search.feel import LATE, Evidence
from skills.search.surface import SurfaceEstimate

CONFIG = load().cell
PARAMS = CONFIG.params(SEARCH)
PERIOD, SPEED, RUN_UP = 0.01, 0.14, 0.15


def blind(height: float = 0.0) -> SimpleNamespace:
    """Return an observation without a frame, of a hand at this height, m: heights alone are asked."""
    tcp = SimpleNamespace(position=np.array([0.0, 0.0, height]))
    return SimpleNamespace(is_new_frame=False, arm=SimpleNamespace(tcp=tcp))


DIP = PARAMS.dip_threshold


@pytest.mark.parametrize(
    ("dip", "scans", "how", "is_edge"),
    [
        (5e-4, 15, {"is_likely": True}, True),
        (5e-4, 8, {}, True),
        (5e-4, 15, {}, True),
        (5e-4, 30, {}, True),
        (0.9 * DIP, 15, {"with_hand": 0.2}, False),
        (0.9 * DIP, 300, {"with_hand": 0.2}, False),
        (0.75 * DIP, 300, {}, True),
        (0.75 * DIP, 300, {"lasting": 20}, False),
        (0.95 * DIP, 300, {"in_vain": 1}, True),
        (0.95 * DIP, 300, {"in_vain": 2}, False),
        (1.5 * DIP, 300, {"in_vain": 9}, True),
        (0.0, 90, {"slope": 0.035}, False),
        (0.0, 60, {"is_likely": True}, False),
    ],
    ids=[
        "shallow after the run-up where the hole is likely",
        "on the first lane",
        "later on the first lane",
        "much later on the first lane",
        "early without the hand",
        "without the hand",
        "sudden and less than the threshold",
        "as deep but slow",
        "sudden after one stop in vain",
        "sudden after two stops in vain",
        "whole dip after many stops in vain",
        "plate that leans by two degrees",
        "level plate where the hole is likely",
    ],
)
def test_what_is_evidence_of_an_edge(dip, scans, how, is_edge):
    assert falls(dip, scans, **how) is is_edge


def falls(dip, scans, *, is_likely=False, slope=0.0, with_hand=1.0, lasting=3, in_vain=0):
    """Return whether there is evidence of an edge that runs up from rest over a plate, down its slope, and after so many scans
    falls by `dip`, m, within `lasting` scans and stays there for five.

    The hand goes down by `with_hand` of what the edge does. The search has rested `in_vain` so many times.
    """
    evidence, place = Evidence(PARAMS, SurfaceEstimate(), PERIOD), 0.0
    for _ in range(in_vain):
        evidence.doubt()
    for k in range(scans + lasting + 5):
        place += PERIOD * SPEED * min(k * PERIOD / RUN_UP, 1.0)
        edge = np.array([0.0, place, -slope * place - dip * min(max(k - scans, 0) / lasting, 1.0)])
        below, is_edge = evidence.update(blind(with_hand * edge[2]), edge, 1, is_likely)
        if is_edge:
            return True
        assert dip or not is_likely or below <= 0.0
        evidence.learn(edge, 1)
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
def test_less_than_the_whole_threshold_counts_only_where_the_hole_is_likely(params, dip, is_likely, is_edge):
    known = SurfaceEstimate()
    for k in range(400):
        known.learn(np.array([0.0, 1e-3 * (k % 60), 0.0]), 1)
    edge = np.array([0.0, 0.03, -dip * params.dip_threshold - 1e-5])
    assert Evidence(params, known, PERIOD).update(blind(), edge, 1, is_likely)[1] is is_edge


def test_a_fall_under_way_does_not_take_the_estimate_with_it():
    """The rest below the full dip is the uncertainty of slopes that were never touched."""
    evidence = Evidence(PARAMS, SurfaceEstimate(), PERIOD)
    for k in range(40):
        evidence.learn(np.array([0.0, 1e-3 * k, 0.0]), 1)
    before, _ = evidence.update(blind(), np.array([0.0, 0.04, -5e-4]), 1)
    for k in range(round(LATE / PERIOD)):
        evidence.learn(np.array([0.0, 0.04 + 1e-3 * k, -5e-4]), 1)
    after, _ = evidence.update(blind(), np.array([0.0, 0.04, -5e-4]), 1)
    assert after == pytest.approx(before, abs=5e-5)
