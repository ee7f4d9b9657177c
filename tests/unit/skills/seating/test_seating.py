"""Detection of a support under a peg that is pushed down, and when a closed switch needs it as evidence."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, SwitchState
from skills.seating.decision import (
    BORNE_FOR,
    BORNE_WITHIN,
    CLOSED_TOLERANCE,
    DOUBTED,
    LEAST_PUSH,
    MOST_DEEP,
    MOST_SHALLOW,
    OPEN_TOLERANCE,
    Arrival,
    Footing,
    is_seated,
    require_short_of_bottom,
)

STIFFNESS = 1000.0


def pushing(seen, newtons):
    """Return a setpoint that pushes the tip down so hard."""
    return ImpedanceSetpoint(
        1, seen.tip - newtons / STIFFNESS * UP, UP, np.full(6, STIFFNESS), np.ones(6), seen.stamp + 1.0
    )


def scans(seen, heights, push=2.0 * LEAST_PUSH, period=0.01):
    """Return the footing after scans in which the tip was so high above where it is."""
    footing = Footing()
    for number, height in enumerate(heights):
        moved = replace(seen, stamp=number * period, tip=seen.tip + height * UP)
        footing = footing.after(moved, pushing(moved, push) if push else None)
    return footing


def test_a_pushed_peg_that_rests_is_borne(seen):
    footing = scans(seen, [0.5 * BORNE_WITHIN, -0.4 * BORNE_WITHIN] * 11)
    assert footing.since == 0.0
    assert not footing.is_firm(BORNE_FOR - 1e-6)
    assert footing.is_firm(BORNE_FOR)


def test_a_peg_that_goes_down_is_not_borne_until_it_rests(seen):
    footing = scans(seen, -np.minimum(np.arange(60) * 2 * BORNE_WITHIN, 20 * BORNE_WITHIN))
    assert footing.since == pytest.approx(0.1)


@pytest.mark.parametrize("push", [0.0, 0.99 * LEAST_PUSH])
def test_nothing_bears_a_peg_that_is_hardly_pushed(seen, push):
    assert scans(seen, np.zeros(40), push).since == math.inf


@pytest.mark.parametrize(
    ("shorts", "push", "goes_on"),
    [
        ((0.99 * MOST_SHALLOW,), 10.0, False),
        ((1.01 * MOST_SHALLOW,), 10.0, True),
        ((0.99 * DOUBTED,), 10.0, True),
        ((1.01 * DOUBTED,), 10.0, False),
        ((-0.99 * MOST_DEEP,), 10.0, False),
        ((-1.01 * MOST_DEEP,), 10.0, True),
        ((1.5e-3, 0.0), 10.0, True),
        ((1.5e-3,), 0.5 * LEAST_PUSH, False),
    ],
    ids=["near", "shallow", "doubted", "far", "near below", "deep", "doubted and deeper later", "weak push"],
)
def test_a_peg_is_pushed_on_only_where_that_can_prove_it_seated(seen, shorts, push, goes_on):
    arrival = Arrival()
    for short in shorts:
        arrival = arrival.after(seen, pushing(seen, push), short)
    assert arrival.is_over(seen.stamp) is not goes_on
    assert arrival.is_over(seen.stamp + BORNE_FOR)


HOLE = load().cell.job().hole


@pytest.mark.parametrize("off", [-CLOSED_TOLERANCE, CLOSED_TOLERANCE])
def test_a_switch_that_closes_elsewhere_is_named_with_both_depths(off):
    assert is_seated(SwitchState.CLOSED, HOLE.depth + 0.999 * off, HOLE)
    assert not is_seated(SwitchState.OPEN, HOLE.depth, HOLE)
    found = 1e3 * (HOLE.depth + 1.05 * off)
    expected = rf"^switch closed with the tip {found:.1f} mm deep; 20\.0 mm \+- 4 mm expected$"
    with pytest.raises(SwitchDisagreesError, match=expected):
        is_seated(SwitchState.CLOSED, HOLE.depth + 1.05 * off, HOLE)


def test_a_switch_without_an_answer_is_a_fault():
    with pytest.raises(SwitchUnknownError, match=r"^switch: state unknown; closed or open needed$"):
        is_seated(SwitchState.UNKNOWN, HOLE.depth, HOLE)


@pytest.mark.parametrize("off", [-OPEN_TOLERANCE, OPEN_TOLERANCE])
def test_an_open_switch_at_the_bottom_is_named_with_both_depths(off):
    require_short_of_bottom(HOLE.depth + 1.001 * off, HOLE)
    found = 1e3 * (HOLE.depth + 0.95 * off)
    expected = rf"^switch open with the tip {found:.1f} mm deep; closed expected at 20\.0 mm \+- 1\.5 mm$"
    with pytest.raises(SwitchDisagreesError, match=expected):
        require_short_of_bottom(HOLE.depth + 0.95 * off, HOLE)
