"""Entries of the catalogue, and records of skills that follow one another."""

from dataclasses import replace
from enum import IntEnum

import pytest

from cell.config.load import load
from drivers.errors import CellError, ConfigError
from skills.catalogue import CATALOGUE, GRASP, SEARCH
from skills.contract import Interrupted, Outcome, Reason, SkillParams, SkillResult
from skills.entry import Catalogue, Skill
from skills.flow import StageRecord, in_order, run_stage
from skills.motion import Gains
from tests.unit.skills.benches import watched

CODE = max(CATALOGUE.by_code) + 1
STAGE = max(CATALOGUE.stages) + 1
OWN = max(99, *CATALOGUE.reasons) + 1
"""Numbers that no entry of the catalogue has, whatever somebody has added to it."""


class KnockParams(SkillParams):
    times: int = 3
    gains: Gains = Gains(translation=1.0, rotation=1.0)


class KnockReason(IntEnum):
    NOBODY_HOME = OWN


def knock(**changes):
    told = {"name": "knock", "code": CODE, "stage": STAGE, "section": "knock", "params": KnockParams}
    return Skill(**{**told, "perform": lambda params, ctx: SkillResult(Outcome.SUCCESS, Reason.NONE, 0.0), **changes})


def clash(*entries):
    with pytest.raises(ConfigError) as refused:
        Catalogue(*CATALOGUE.values(), *entries)
    line = str(refused.value)
    assert "\n" not in line
    return line


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": "recover"}, ("recover: name recover is that of another entry",)),
        ({"code": 102}, ("knock: command code 102", "spray_search")),
        ({"stage": 2}, ("knock: stage 2", "spray_search")),
        ({"stage": 0}, ("knock: stage 0", "from 1")),
        ({"section": "search"}, ("knock: config section search", "spray_search")),
        ({"steered": ("times",)}, ("knock: steered 'times'", "Gains")),
        ({"steered": ("strength",)}, ("knock: steered 'strength'", "Gains")),
        ({"reasons": IntEnum("Low", {"TIRED": 11})}, ("knock: reason 11 TIRED", "100 or more")),
        ({"reasons": IntEnum("Taken", {"NO_HOLE": OWN})}, (f"knock: reason {OWN} NO_HOLE", "an unused name")),
    ],
)
def test_a_clash_is_refused_in_one_line_that_names_both(changes, words):
    line = clash(knock(**changes))
    assert all(word in line for word in words), line


def test_two_skills_cannot_give_one_reason_two_numbers():
    reasons = IntEnum("Ring", {"NOBODY_HOME": OWN + 1})
    other = knock(name="ring", code=CODE + 1, stage=STAGE + 1, section="ring", reasons=reasons)
    assert "ring: reason NOBODY_HOME is that of knock" in clash(knock(reasons=KnockReason), other)


def test_tables_derive_from_the_entries():
    found = Catalogue(knock(reasons=KnockReason, counts=True), SEARCH, GRASP)
    assert found.stages == {1: "grasp_from_rack", 2: "spray_search", STAGE: "knock"}
    assert found.counted == ("spray_search", "knock")
    assert (found.reasons[3], found.reasons[OWN]) == ("NO_HOLE", "NOBODY_HOME")
    assert found.in_places({"knock": 2.5, "grasp_from_rack": 1.0}) == (1.0, *[0.0] * (STAGE - 2), 2.5)


def test_a_stage_of_no_skill_is_refused():
    assert CATALOGUE.stage_number("") == 0
    with pytest.raises(ConfigError, match=r"stage 'knock': no such skill; grasp_from_rack, .* allowed"):
        CATALOGUE.stage_number("knock")


def test_an_end_without_a_number_for_the_line_is_refused():
    found = Catalogue(knock(reasons=KnockReason), SEARCH, GRASP)
    ended = StageRecord("knock", SkillResult(Outcome.FAILURE, KnockReason.NOBODY_HOME, 1.0), 0.0, 1.0)
    found.require_known(ended)
    with pytest.raises(ConfigError, match=rf"knock: reason {OWN} NOBODY_HOME: not in `reasons` of its entry"):
        Catalogue(knock(), SEARCH, GRASP).require_known(ended)
    with pytest.raises(ConfigError, match="stage 'ring': no such skill"):
        found.require_known(replace(ended, name="ring"))


CELL = load().cell
DONE = SkillResult(Outcome.SUCCESS, Reason.NONE, 1.5)
FAILED = SkillResult(Outcome.FAILURE, Reason.NO_HOLE, 2.0)


@pytest.fixture
def ctx():
    return watched(CELL)


def taking(seconds, result):
    """Return a step that takes so long on the cell's clock and ends so, or is interrupted for a reason."""

    def step(ctx):
        ctx.devices.clock.wait_until(ctx.devices.clock.now() + seconds)
        if isinstance(result, Reason):
            raise Interrupted(result)
        return result

    return step


def test_a_stage_is_recorded_and_reported_with_its_times(ctx):
    ctx.devices.clock.wait_until(7.0)
    told = []
    ctx.callbacks = replace(
        ctx.callbacks,
        progress=lambda fraction: told.append((ctx.stage, fraction)),
        ended=lambda stage, elapsed: told.append((stage, elapsed)),
    )
    record = run_stage("search", taking(2.0, DONE), ctx)
    assert (record.name, record.result, record.started, record.ended) == ("search", DONE, 7.0, 9.0)
    assert not record.retried
    assert told == [("search", 0.0), ("search", 1.5)]


@pytest.mark.parametrize(
    ("reason", "outcome"), [(Reason.STOPPED, Outcome.ABORTED), (Reason.FORCE_LIMIT, Outcome.FAILURE)]
)
def test_an_interruption_ends_its_stage_and_only_a_stop_aborts(ctx, reason, outcome):
    ctx.devices.clock.wait_until(7.0)
    result = run_stage("search", taking(2.0, reason), ctx).result
    assert (result.outcome, result.reason, result.elapsed) == (outcome, reason, 2.0)


def test_a_step_that_returns_no_result_is_a_fault(ctx):
    ended = []
    ctx.callbacks = replace(ctx.callbacks, ended=lambda stage, elapsed: ended.append(stage))
    with pytest.raises(CellError, match=r"^search: run returned str; a SkillResult allowed$"):
        run_stage("search", taking(0.0, "done"), ctx)
    assert not ended


def test_steps_follow_one_another_until_one_does_not_succeed(ctx):
    steps = [("a", taking(1.0, DONE)), ("b", taking(1.0, FAILED)), ("c", taking(1.0, DONE))]
    records = in_order(steps, ctx)
    assert [(each.name, each.result, each.started) for each in records] == [("a", DONE, 0.0), ("b", FAILED, 1.0)]
