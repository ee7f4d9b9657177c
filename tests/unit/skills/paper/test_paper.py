"""The printed search, insertion and adjustment: their equations, what they command, and how they end."""

import math

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import ConfigError
from drivers.frames import UP, angle_between, end_point
from drivers.quantities import SwitchState, TaxelFrame
from skills.catalogue import SEARCH
from skills.contract import Outcome, Reason
from skills.motion import tilted_by
from skills.paper import adjust, insert, search
from skills.paper.equations import MOST_LEAD, OFFSET, k_33, towards, x_star
from skills.paper.hole_event import HoleEvent
from skills.paper.spray_paint import spray_paint
from skills.paths import spiral
from tests import scripted
from tests.board import Board
from tests.fakes import PERIOD, Rig
from tests.scripted import CELL, HOLE, LIGHT, ScriptedHand

LOADED = load(preset="paper", sets=["hole.area=[0.02, 0.02]"])
PAPER, WAY = LOADED.cell.paper, LOADED.cell.params(SEARCH)
TILT = 0.6
"""Lean of a peg that the search has left in the hole's mouth, rad."""


def test_equation_4_lies_below_the_hole_and_equation_7_stiffens():
    np.testing.assert_allclose(x_star(np.array([0.5, 0.1, 0.7]), 0.1), [0.5, 0.1, 0.09])
    pushes = [k_33(phi, 0.8, 300.0, 1200.0) for phi in (0.8, 0.4, 0.0, 1.1)]
    assert pushes == pytest.approx([300.0, 600.0, 1200.0, 300.0])


@pytest.mark.parametrize("tilt", [0.2, 0.99 * MOST_LEAD, 1.3])
def test_the_setpoint_of_the_axis_leads_by_what_the_gate_allows(tilt):
    lead = min(tilt, MOST_LEAD)
    axis = towards(np.array([math.sin(tilt), 0.0, math.cos(tilt)]), UP)
    np.testing.assert_allclose(axis, [math.sin(tilt - lead), 0.0, math.cos(tilt - lead)], atol=1e-15)


@pytest.fixture
def board(tmp_path):
    board = Board(Rig(LOADED, tmp_path))
    board.put(HOLE + 0.02 * UP, *board.part.leaning(WAY.tilt_azimuth, 0.9 * WAY.tilt))
    return board


def test_a_print_that_vanishes_marks_the_hole(board):
    board.rig.at(4.0, lambda: setattr(board.rig.skin, "shows_print", False))
    found = search.run(PAPER.search, WAY, board.ctx)
    assert (found.outcome, found.plane) == (Outcome.SUCCESS, None)
    assert 4.0 <= board.rig.clock.now() < 4.2
    assert found.tip == pytest.approx(tuple(board.seen[-1].tip))
    assert found.edge == found.tip[:2]


def test_the_end_follows_the_path_below_the_surface_from_a_random_point(board):
    found = search.run(PAPER.search, WAY.model_copy(update={"timeout": 2.0}), board.ctx)
    assert (found.outcome, found.reason, found.elapsed) == (Outcome.FAILURE, Reason.NO_HOLE, 2.0)
    along = [each for each in board.commanded if each.twist and each.twist.linear.any() and not each.is_free]
    path = search.path_from(np.array(found.start) - HOLE[:2], PAPER.search, WAY, board.ctx)
    for number, setpoint in enumerate(along):
        point, velocity = path.at(number * PERIOD)
        np.testing.assert_allclose(setpoint.tip, [*(HOLE[:2] + point), HOLE[2] - OFFSET], atol=1e-9)
        np.testing.assert_allclose(setpoint.twist.linear[:2], velocity, atol=1e-9)
        assert setpoint.stiffness[2] == PAPER.search.push_stiffness
    assert np.abs(np.array(found.start) - HOLE[:2]).max() <= 0.01


def test_the_hand_keeps_its_attitude_if_the_plate_turns_the_peg(board):
    board.turn(1.5, 0.3)
    search.run(PAPER.search, WAY.model_copy(update={"timeout": 2.0}), board.ctx)
    last, hand = board.commanded[-1], board.seen[-1].arm.tcp
    assert last.in_hand.theta == 0.3
    np.testing.assert_allclose(last.axis, end_point(hand, 0.3, board.length)[1], atol=1e-6)


@pytest.fixture
def bench(tmp_path):
    """Return a hand whose peg leans in the hole's mouth by default."""
    bench = ScriptedHand(Rig(load(sets=[LIGHT]), tmp_path), lambda time: scripted.hand(HOLE - 1e-3 * UP, TILT))
    bench.move()
    return bench


def test_the_insertion_commands_equations_4_to_7(bench):
    bench.way = lambda time: scripted.hand(HOLE - 1e-3 * UP, TILT - 0.5 * time)
    ended = insert.run(PAPER.insert.model_copy(update={"timeout": 0.5}), bench.ctx)
    assert (ended.reason, ended.first_phi) == (Reason.NOT_ALIGNED, pytest.approx(TILT))
    for seen, setpoint in zip(bench.seen, bench.commanded, strict=True):
        phi = angle_between(seen.axis, UP)
        np.testing.assert_allclose(setpoint.tip, HOLE - OFFSET * UP, atol=1e-9)
        np.testing.assert_array_equal(setpoint.axis, UP)
        assert setpoint.stiffness[2] == k_33(phi, ended.first_phi, *PAPER.insert.push_stiffness)
        assert setpoint.integral_gain == PAPER.insert.integral_gain


def test_the_insertion_ends_below_15_degrees(bench):
    bench.way = lambda time: scripted.hand(HOLE - 1e-3 * UP, math.radians(15.01 - 0.1 * time))
    assert insert.run(PAPER.insert, bench.ctx).elapsed == pytest.approx(0.1, abs=PERIOD + 1e-9)


def test_the_adjustment_spirals_about_the_end_and_pushes(bench):
    bench.way = lambda time: scripted.hand(HOLE - 1e-3 * UP)
    ended = adjust.run(PAPER.adjust.model_copy(update={"timeout": 1.0}), bench.ctx)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    growth = PAPER.adjust.radius / PAPER.adjust.growing_time
    for number, setpoint in enumerate(bench.commanded):
        np.testing.assert_allclose(setpoint.tip, HOLE - (1e-3 + OFFSET) * UP, atol=1e-9)
        offset = spiral(number * PERIOD, growth, PAPER.adjust.turn_rate)
        np.testing.assert_allclose(setpoint.axis, tilted_by(offset, CELL.peg.length), atol=1e-9)


@pytest.mark.parametrize(("skill", "params"), [(insert, PAPER.insert), (adjust, PAPER.adjust)])
def test_the_switch_ends_it_well(bench, skill, params):
    bench.rig.switch.state = SwitchState.CLOSED
    bench.way = lambda time: scripted.hand(HOLE - CELL.hole.depth * UP, 0.3)
    bench.move()
    assert skill.run(params, bench.ctx).outcome is Outcome.SUCCESS


def test_the_preset_chooses_all_three_and_a_section_without_skills_none():
    plan = LOADED.cell.plan()
    assert (plan.retries, set(plan.steered)) == (0, {f"paper.{each}.gains" for each in ("search", "insert", "adjust")})
    assert load(preset="paper", sets=["paper.skills=[]"]).cell.paper is None


@pytest.mark.parametrize(
    ("sets", "line"),
    [
        (["peg.shape=square"], 'peg.shape = "square": a printed skill of paper.skills inserts round pegs'),
        (["hole.latch={kind='detent',force=3.0,height=0.003}", "hole.evidence=force"], 'hole.evidence = "force"'),
    ],
)
def test_what_the_printed_method_is_not_made_for_is_refused(sets, line):
    with pytest.raises(ConfigError, match=line):
        load(preset="paper", sets=sets)


THRESHOLD = 0.1


def events(levels, trusted=None):
    """Return the numbers of the frames that are events, of frames whose taxels all read the same."""
    event, trusted = HoleEvent(THRESHOLD), np.ones((2, 20), dtype=bool) if trusted is None else trusted
    frames = (TaxelFrame(np.full((2, 20), float(level)), trusted, 0.1 * n, n) for n, level in enumerate(levels))
    return [n for n, frame in enumerate(frames) if event.update(frame)]


FEW = np.arange(40).reshape(2, 20) < 9


@pytest.mark.parametrize(
    ("levels", "trusted", "found"),
    [
        ([1000.0] * 8 + [900.0] * 4, None, []),
        ([1000.0] * 8 + [899.0] * 4, None, [8]),
        ([1000.0] * 8 + [1100.0] * 4, None, []),
        ([1000.0] * 8 + [1101.0] * 4, None, [8]),
        (1000.0 * 1.05 ** np.arange(20), None, []),
        (-np.abs(np.random.default_rng(0).normal(size=50)), None, []),
        ([1000.0], None, []),
        ([1000.0, 10.0], FEW, []),
    ],
    ids=["at", "beyond", "at, upwards", "beyond, upwards", "slow", "no average", "first frame", "few taxels trusted"],
)
def test_only_a_sudden_change_beyond_the_threshold_is_an_event(levels, trusted, found):
    assert events(levels, trusted) == found


def test_taxels_that_drop_out_are_no_change():
    half = np.arange(40).reshape(2, 20) % 2 == 0
    event = HoleEvent(THRESHOLD)
    for number in range(40):
        is_whole = number < 30
        values = np.where(half & is_whole, 4000.0, 100.0)
        assert not event.update(TaxelFrame(values, ~half | is_whole, 0.1 * number, number))


HALF = (0.03, 0.03)


@pytest.mark.parametrize("start", [(-0.012, 0.02), (0.01, -0.02)])
def test_the_path_begins_at_its_start_towards_the_nearer_edge(start) -> None:
    path = spray_paint(HALF, 0.005, 0.1, 1, start)
    point, velocity = path.at(0.0)
    np.testing.assert_allclose(point, start, atol=1e-12)
    assert velocity[0] * start[0] > 0.0
    before, after = path.at(1.3 - 1e-6)[0], path.at(1.3 + 1e-6)[0]
    np.testing.assert_allclose(path.at(1.3)[1], (after - before) / 2e-6, atol=1e-6)


def test_every_place_is_within_half_a_pitch_of_the_path() -> None:
    pitch = 0.005
    path = spray_paint(HALF, pitch, 0.1, 1, (0.01, 0.0))
    points = np.array([path.at(t)[0] for t in np.arange(0.0, 2.0 * np.pi / min(path.rate), 0.005)])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 25)] * 2), axis=-1).reshape(-1, 2)
    gaps = np.sqrt(((grid[:, None] - points[None]) ** 2).sum(axis=2)).min(axis=1)
    assert gaps.max() <= pitch / 2 + 2e-4


def test_the_fast_axis_peaks_at_the_stated_speed() -> None:
    path = spray_paint(HALF, 0.005, 0.4, 1, (0.01, -0.02))
    speeds = [abs(path.at(time)[1][1]) for time in np.arange(0.0, 2.0, 0.005)]
    assert max(speeds) == pytest.approx(0.4, rel=1e-2)
