"""Figures in force in an attempt, at a pace, and what changed them."""

import pytest

from cell.config.load import load
from drivers.errors import ConfigError
from skills.catalogue import ADJUST, SEARCH
from skills.pace import Pace, at_pace
from skills.plan import ARM, GRIP
from skills.search.size import fastest

CELL = load().cell
WIDTH = CELL.hole.part.inscribed


@pytest.mark.parametrize("scale", [0.5, 1.5])
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


@pytest.mark.parametrize(("dip", "share"), [(1.0, 1.0), (2.0, 1.0), (0.25, 2.0)])
def test_the_dip_threshold_sets_the_fastest_search(dip, share):
    """Under a constant push a quarter of the fall takes half the time."""
    search = CELL.plan().search
    search = search.model_copy(update={"dip_threshold": dip * search.crossed_dip})
    assert fastest(search, WIDTH) == pytest.approx(search.crossings * WIDTH * share)


@pytest.mark.parametrize(("part", "reasons"), [(0.9, ()), (1.1, ("hole",))])
def test_the_hole_caps_the_speed_over_it(part, reasons):
    most = fastest(CELL.plan().search, WIDTH)
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


PAPER = load(preset="paper").cell
SPEEDS = (
    *("grasp.transfer.speed", "grasp.transfer.turn_speed", "grasp.drawing_speed", "release.transfer.speed"),
    *("search.speed", "search.descent", "search.probe_speed", "search.pull.speed"),
    *("search.pull.dither_rate", "insert.turn_rate", "adjust.dither_rate"),
    *("corner.insert.raise_rate", "corner.insert.turn_rate", "corner.adjust.turn_rate", "recover.pull.speed"),
    *("paper.search.speed", "paper.adjust.turn_rate", "recover.transfer.speed"),
)
WAITS = (
    *("grasp.transfer.settle", "search.run_up", "search.rest", "search.return_time", "insert.turn_run_up"),
    *("adjust.stall_timeout", "adjust.dither_period", "adjust.sweep_time", "corner.insert.settle"),
    *("corner.adjust.stands_for", "paper.adjust.growing_time"),
)
LIMITS = ("search.touch_down", "search.timeout", "insert.timeout", "adjust.timeout", "paper.adjust.timeout")


def figure(name, pace):
    """Return a figure of the cell at a pace."""
    section, *names = name.split(".")
    value = at_pace(getattr(PAPER, section), pace)
    for each in names:
        value = getattr(value, each)
    return value


@pytest.mark.parametrize(
    ("name", "scale", "factor"),
    [
        *((name, 1.5, 1.5) for name in SPEEDS),
        *((name, 1.6, 1.0 / 1.6) for name in WAITS),
        *((name, scale, factor) for name in LIMITS for scale, factor in ((0.5, 2.0), (2.0, 1.0))),
    ],
)
def test_a_pace_scales_speeds_waits_and_timeouts(name, scale, factor):
    assert figure(name, Pace(scale)) == pytest.approx(factor * figure(name, Pace()))


def test_a_scaled_search_keeps_its_forces_and_lengths():
    kept = ("push_stiffness", "push_offset", "gains", "dip_threshold", "fall", "probe_radius", "trim_rate")
    slow = at_pace(PAPER.params(SEARCH), Pace(0.5))
    assert all(getattr(slow, name) == getattr(PAPER.params(SEARCH), name) for name in kept)


def test_the_speed_on_its_circle_caps_a_rate():
    dithered = PAPER.params(ADJUST)
    paced = at_pace(dithered, Pace(10.0, speed=0.01, turn_speed=0.1))
    assert paced.dither_rate * dithered.dither_radius == pytest.approx(0.01)


def test_a_figure_without_a_key_is_unknown_to_a_config():
    with pytest.raises(ConfigError, match=r"grasp\.drawing_speed: unknown key"):
        load(sets=["grasp.drawing_speed=0.1"])
