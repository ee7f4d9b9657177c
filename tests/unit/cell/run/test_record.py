"""A run ends as its first failed stage, with the time of each stage."""

from dataclasses import replace

import pytest

from cell.peg.ending import ending_of
from cell.records.run_trace import RunTrace
from cell.run.record import StageClock
from drivers.errors import SkinSilentError
from plc_bridge.protocol.messages import Result
from skills.contract import Outcome, Reason, SkillResult
from skills.flow import StageRecord


def stage(name, outcome=Outcome.SUCCESS, reason=Reason.NONE, elapsed=1.0):
    """Return a stage as it ended."""
    return StageRecord(name, SkillResult(outcome, reason, elapsed), 0.0, 1.0)


def test_each_stage_gets_its_time_and_is_entered_once():
    clock = StageClock()
    assert [clock.enter("grasp_from_rack", 1.0), clock.enter("grasp_from_rack", 2.0)] == [True, False]
    clock.enter("spray_search", 4.0)
    clock.leave(9.0)
    assert clock.times == {"grasp_from_rack": 3.0, "spray_search": 5.0}


def test_a_stage_counts_its_own_time_in_all_tries():
    clock = StageClock()
    for began, elapsed in ((0.0, 10.0), (12.0, 3.0)):
        assert clock.enter("spray_search", began)
        clock.end("spray_search", elapsed)
    clock.leave(20.0)
    assert clock.times == {"spray_search": 13.0}


def test_a_run_ends_as_the_first_stage_that_did_not_succeed():
    records = [stage("grasp_from_rack"), stage("spray_search", Outcome.FAILURE, Reason.NO_HOLE), stage("recover")]
    ending = ending_of(records, None, "recover")
    assert (ending.outcome, ending.stage, ending.reason) == ("failure", "spray_search", Reason.NO_HOLE)


def test_a_fault_after_a_recovery_is_recorded_with_its_stage(seen, loaded):
    trace = RunTrace(0.0, loaded.cell.hole)
    for stamp, name in ((0.5, "recover"), (1.5, "grasp_from_rack")):
        trace.see(replace(seen, stamp=stamp), name)
    rows = trace.stages(1, [stage("recover")], SkinSilentError("skin: silent"))
    told = [(row.place, row.name, row.outcome, row.began) for row in rows]
    assert told == [(1, "recover", "success", 0.0), (2, "grasp_from_rack", "fault", 1.5)]


@pytest.mark.parametrize("records", [[], [stage("grasp_from_rack")]])
def test_a_fault_outweighs_what_went_well_before(records):
    ending = ending_of(records, SkinSilentError("skin: silent"), "spray_search")
    assert (ending.outcome, ending.stage) == ("fault", "spray_search")


def test_every_outcome_is_a_result_of_the_same_name():
    assert {outcome.name for outcome in Outcome} == {result.name for result in Result} - {"NONE", "REFUSED"}
