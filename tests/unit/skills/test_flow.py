"""Records of skills that follow one another."""

from dataclasses import replace

import pytest

from cell.config.load import load
from drivers.errors import CellError
from skills.contract import Interrupted, Outcome, Reason, SkillResult
from skills.flow import in_order, run_stage
from tests.fakes import FakeArm, FakeClock, FakeGripper, context_of

CELL = load().cell
DONE = SkillResult(Outcome.SUCCESS, Reason.NONE, 1.5)
FAILED = SkillResult(Outcome.FAILURE, Reason.NO_HOLE, 2.0)


@pytest.fixture
def ctx():
    clock = FakeClock()
    return context_of(CELL, FakeArm(clock), FakeGripper(CELL.peg.part.thickness))


def taking(seconds, result):
    """Return a step that takes so long on the cell's clock and ends so, or is interrupted for a reason."""

    def step(ctx):
        ctx.devices.clock.wait_until(ctx.devices.clock.now() + seconds)
        if isinstance(result, Reason):
            raise Interrupted(result)
        return result

    return step


def test_a_stage_is_on_record_with_its_times_and_reported_when_it_begins_and_ends(ctx):
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
def test_an_interruption_is_the_result_of_its_stage_and_only_a_stop_aborts(ctx, reason, outcome):
    ctx.devices.clock.wait_until(7.0)
    result = run_stage("search", taking(2.0, reason), ctx).result
    assert (result.outcome, result.reason, result.elapsed) == (outcome, reason, 2.0)


def test_a_step_that_returns_no_result_is_a_fault_with_its_name_and_what_it_returned(ctx):
    ended = []
    ctx.callbacks = replace(ctx.callbacks, ended=lambda stage, elapsed: ended.append(stage))
    with pytest.raises(CellError, match=r"^search: run returned str; a SkillResult allowed$"):
        run_stage("search", taking(0.0, "done"), ctx)
    assert not ended


def test_steps_follow_one_another_until_one_does_not_succeed(ctx):
    steps = [("a", taking(1.0, DONE)), ("b", taking(1.0, FAILED)), ("c", taking(1.0, DONE))]
    records = in_order(steps, ctx)
    assert [(record.name, record.result, record.started) for record in records] == [
        ("a", DONE, 0.0),
        ("b", FAILED, 1.0),
    ]
