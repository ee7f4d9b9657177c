"""Figures in force in an attempt, and what changed them."""

import pytest

from cell.config.load import load
from skills.plan import ARM, GRIP
from skills.search.size import CROSSED_DIP, CROSSINGS, fastest

CELL = load().cell
WIDTH = CELL.hole.part.inscribed


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_scale_multiplies_the_speed_of_the_search_in_force(scale):
    plan = load(sets=[f"speed_scale={scale}"]).cell.plan()
    assert plan.search.speed == pytest.approx(scale * CELL.plan().search.speed)
    assert plan.reasons["search.speed"] == ("speed_scale",)
    assert plan.capped == ()


def test_a_plan_lists_the_speeds_that_the_arm_caps():
    plan = load(sets=["speed_scale=20"]).cell.plan()
    assert plan.search.speed == CELL.arm_model().tool_speed
    assert {"search.speed", "insert.turn_rate", "grasp.transfer.turn_speed"} <= set(plan.capped)
    assert plan.reasons["search.speed"] == ("speed_scale", ARM)


@pytest.mark.parametrize(("dip", "share"), [(CROSSED_DIP, 1.0), (2.0 * CROSSED_DIP, 1.0), (CROSSED_DIP / 4.0, 2.0)])
def test_a_peg_crosses_so_much_of_the_hole_while_it_falls_by_the_dip_threshold(dip, share):
    """Under a constant push a quarter of the fall takes half the time."""
    assert fastest(dip, WIDTH) == pytest.approx(CROSSINGS * WIDTH * share)


@pytest.mark.parametrize(("part", "reasons"), [(0.9, ()), (1.1, ("hole",))])
def test_the_hole_caps_the_speed_over_it(part, reasons):
    most = fastest(CELL.plan().search.dip_threshold, WIDTH)
    plan = load(sets=[f"search.speed={part * most}"]).cell.plan()
    assert plan.search.speed == pytest.approx(min(part, 1.0) * most)
    assert plan.reasons.get("search.speed", ()) == reasons


def test_a_weak_grip_is_the_reason_of_a_weaker_push():
    plan = load(sets=["grasp.force=5"]).cell.plan()
    named = ("search.push_stiffness", "search.speed", "insert.push_stiffness", "adjust.push_stiffness")
    assert all(GRIP in plan.reasons[name] for name in named)
    assert plan.search.speed < CELL.plan().search.speed


def test_a_plan_names_the_sections_in_use_alone():
    square = load(sets=["peg.shape=square"]).cell.plan()
    assert {"corner", "insert"} & CELL.plan().sections.keys() == {"insert"}
    assert {"corner", "insert"} & square.sections.keys() == {"corner"}
