"""Requests of a PLC to the cell, through the bridge's mailbox, against instant fakes."""

import json
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

from cell.run.states import State
from drivers.errors import FaultCode
from plc_bridge.protocol.messages import Control, Refusal, Result
from skills.contract import Reason
from skills.guards.rest import REST_TIME

GRASP, SEARCH, RELEASE = 101, 102, 105


def test_a_skill_runs_and_the_plc_reads_the_answer(rig):
    report = rig.command(GRASP)
    assert (report.result, report.state, report.stage, report.run) == (Result.SUCCESS, State.COMPLETE, 1, 1)


def test_the_run_is_on_record_with_who_asked(rig):
    rig.command(GRASP, recipe=1)
    row = rig.journal.find(1)
    assert (row.program, row.recipe, row.source, row.sequence, row.outcome) == (
        "grasp_from_rack",
        1,
        "plc",
        1,
        "success",
    )
    assert dict(json.loads(row.stage_times))["grasp_from_rack"] > 1.0


def test_an_empty_slot_is_a_failure_and_the_next_command_runs(rig):
    rig.gripper.has_peg = False
    report = rig.command(GRASP)
    assert (report.result, report.reason, report.state) == (Result.FAILURE, Reason.MISSED_GRASP, State.COMPLETE)
    rig.gripper.has_peg = True
    assert rig.command(GRASP).result == Result.SUCCESS


def test_the_program_clears_up_after_a_failure(rig):
    rig.gripper.has_peg = False
    rig.command(100)
    row = rig.journal.find(1)
    assert (row.outcome, row.stage, row.reason) == ("failure", "grasp_from_rack", "missed_grasp")
    assert [name for name, _ in json.loads(row.stage_times)] == ["grasp_from_rack", "recover"]


def test_every_start_takes_a_fresh_peg(rig):
    rig.command(GRASP)
    rig.put_away()
    rig.command(GRASP)
    seeds = [seed for _, seed in rig.restocked]
    assert seeds[1] == seeds[0] + 1
    assert len(seeds) == 2


def test_an_acknowledged_result_leaves_the_cell_idle(rig):
    rig.command(GRASP)
    rig.plc.acknowledge()
    assert rig.scan().state == State.IDLE


def test_a_start_right_behind_an_acknowledgement_is_taken_in_the_same_scan(rig):
    rig.command(GRASP)
    rig.plc.acknowledge()
    rig.plc.trigger(RELEASE)
    assert rig.scan(1).run == 2


def test_stop_halts_the_arm_in_the_middle_of_a_skill(rig):
    rig.at(0.5, rig.plc.stop)
    report = rig.command(GRASP)
    assert (report.result, report.reason, report.state) == (Result.ABORTED, Reason.STOPPED, State.STOPPED)
    assert rig.arm.is_halted
    assert rig.clock.now() < 1.0


def test_a_stopped_cell_starts_only_after_a_reset(rig):
    rig.at(0.5, rig.plc.stop)
    rig.command(GRASP)
    assert rig.command(GRASP).refusal == Refusal.NOT_READY
    assert rig.command(Control.RESET).state == State.IDLE
    assert rig.command(GRASP).result == Result.SUCCESS


def test_abort_ends_in_aborted(rig):
    rig.at(0.5, lambda: rig.plc.trigger(Control.ABORT))
    assert rig.command(GRASP).state == State.ABORTED


def test_hold_keeps_the_arm_still_until_it_is_taken_back(rig):
    states = []
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    rig.at(2.4, lambda: states.append((rig.supervisor.state, rig.arm.is_halted)))
    rig.at(2.5, lambda: rig.plc.trigger(Control.UNHOLD))
    report = rig.command(GRASP)
    assert states == [(State.HELD, True)]
    assert report.state == State.COMPLETE


def test_a_limit_that_is_hit_in_the_scan_of_a_hold_ends_the_run(rig):
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    rig.at(0.5, lambda: rig.arm.force.__setitem__(2, 1.001 * rig.loaded.cell.limits.force))
    report = rig.command(GRASP)
    assert (report.result, report.reason, report.state) == (Result.FAILURE, Reason.FORCE_LIMIT, State.COMPLETE)


def test_an_arm_that_never_reads_zero_speed_counts_as_at_rest_in_time(rig):
    rig.arm.dq[0] = 0.02
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    states = []
    rig.clock.every.append(lambda: states.append(rig.plc.report.state))
    rig.at(2.5, lambda: rig.plc.trigger(Control.STOP))
    report = rig.command(GRASP)
    assert (report.result, report.state) == (Result.ABORTED, State.STOPPED)
    assert REST_TIME < states.count(State.HOLDING) * rig.supervisor._context.schedule.period < REST_TIME + 0.05
    assert REST_TIME < states.count(State.STOPPING) * rig.supervisor._context.schedule.period < REST_TIME + 0.05


def test_an_arm_that_goes_on_moving_is_never_told_to_be_held(rig):
    rig.arm.dq[0] = 0.02
    rig.clock.every.append(lambda: rig.arm.q.__setitem__(0, 0.02 * rig.clock.time))
    states = []
    rig.clock.every.append(lambda: states.append(rig.plc.report.state))
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    report = rig.command(GRASP)
    assert State.HOLDING in states
    assert State.HELD not in states
    assert (report.result, report.fault, report.state) == (Result.FAULT, FaultCode.ARM_RESTLESS, State.ABORTED)


def test_an_abort_while_the_arm_of_a_stop_still_moves_aborts(rig):
    rig.arm.dq[0] = 0.02
    rig.at(0.5, lambda: rig.plc.stop())
    rig.at(0.7, lambda: rig.plc.trigger(Control.ABORT))
    report = rig.command(GRASP)
    assert (report.result, report.state, rig.journal.find(1).outcome) == (Result.ABORTED, State.ABORTED, "aborted")


def test_after_a_hold_the_arm_is_led_back_slowly(rig):
    def be_pushed_away():
        rig.arm.tcp = replace(rig.arm.tcp, position=rig.arm.tcp.position + np.array([0.0, 0.0, 0.03]))

    tips, follow = [], rig.arm.follow
    rig.arm.follow = lambda setpoint: (tips.append((rig.plc.report.state, setpoint.tip)), follow(setpoint))
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    rig.at(1.0, be_pushed_away)
    rig.at(1.5, lambda: rig.plc.trigger(Control.UNHOLD))
    assert rig.command(GRASP).result == Result.SUCCESS
    way = np.array([tip for state, tip in tips if state == State.UNHOLDING])
    before = [tip for state, tip in tips[: len(tips) - len(way)] if state == State.EXECUTE]
    assert np.linalg.norm(way[-1] - way[0]) == pytest.approx(0.03, rel=0.02)
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() == pytest.approx(0.0003)
    assert any(np.allclose(way[-1], tip) for tip in before)


def test_a_hold_is_obeyed_also_on_the_way_back(rig):
    states = []
    rig.clock.every.append(lambda: states.append(rig.plc.report.state))
    for time, control in ((0.5, Control.HOLD), (1.0, Control.UNHOLD), (1.5, Control.HOLD), (2.0, Control.UNHOLD)):
        rig.at(time, lambda control=control: rig.plc.trigger(control))
    assert rig.command(GRASP).result == Result.SUCCESS
    assert [state for state, _ in groupby(states)].count(State.HELD) == 2


def test_a_stop_on_hold_ends_the_run(rig):
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    rig.at(1.0, rig.plc.stop)
    assert rig.command(GRASP).state == State.STOPPED


def test_stop_stops_an_idle_cell_too(rig):
    rig.plc.stop()
    assert rig.scan().state == State.STOPPED


def test_a_second_start_is_refused_and_the_first_goes_on(rig):
    refusals = []
    rig.at(0.5, lambda: rig.plc.trigger(SEARCH))
    rig.at(0.6, lambda: refusals.append(rig.plc.report.refusal))
    rig.command(GRASP)
    assert refusals == [Refusal.BUSY]
    assert rig.journal.find(1).outcome == "success"


def test_a_control_that_does_not_fit_is_refused_and_the_run_goes_on(rig):
    refusals = []
    rig.at(0.5, lambda: rig.plc.trigger(Control.UNHOLD))
    rig.at(0.6, lambda: refusals.append(rig.plc.report.refusal))
    rig.command(GRASP)
    assert refusals == [Refusal.NOT_READY]
    assert rig.bridge.diagnostics.refusals == 1
    assert rig.journal.find(1).outcome == "success"


@pytest.mark.parametrize(
    ("code", "recipe", "parameters", "refusal"),
    [
        (GRASP, 99, (), Refusal.UNKNOWN_RECIPE),
        (99, 0, (), Refusal.UNKNOWN_CODE),
        (GRASP, 0, ((0, 10_000),), Refusal.PARAMETER),
        (GRASP, 0, ((7, 1),), Refusal.PARAMETER),
        (Control.UNHOLD, 0, (), Refusal.NOT_READY),
        (Control.CLEAR, 0, (), Refusal.NOT_READY),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_reason_and_nothing_moves(rig, code, recipe, parameters, refusal):
    before = rig.arm.tcp
    report = rig.command(code, recipe, parameters)
    assert (report.refusal, report.state) == (refusal, State.IDLE)
    assert rig.arm.tcp is before


def test_a_parameter_holds_for_its_own_run(rig):
    rig.command(GRASP, parameters=((0, 123),))
    assert rig.gripper.force == pytest.approx(12.3)
    rig.put_away()
    rig.command(GRASP)
    assert rig.gripper.force == rig.loaded.cell.grasp.force


def test_a_force_beyond_the_limit_ends_the_skill_as_a_failure(rig):
    limit = rig.loaded.cell.limits.force
    rig.at(0.5, lambda: rig.arm.force.__setitem__(2, limit))
    rig.at(0.7, lambda: rig.arm.force.__setitem__(2, 0.0))  # before the wrench is zeroed in free air
    assert rig.command(GRASP).result == Result.SUCCESS
    rig.put_away()
    rig.at(0.5, lambda: rig.arm.force.__setitem__(2, 1.001 * limit))
    report = rig.command(GRASP)
    assert (report.result, report.reason) == (Result.FAILURE, Reason.FORCE_LIMIT)
    assert rig.arm.is_halted
    assert report.peak_force >= limit, "the scan that broke the limit is missing on record"
    assert rig.supervisor.last.peak_force >= limit


@pytest.mark.parametrize(("beyond", "reason"), [(0.0, Reason.NOT_SEATED), (1e-4, Reason.WORKSPACE)])
def test_leaving_the_workspace_ends_the_skill(rig, beyond, reason):
    rig.arm.tcp.position[0] = rig.loaded.cell.limits.high[0] + beyond
    assert rig.command(RELEASE).reason == reason


def test_the_plc_sees_stage_and_progress_while_a_skill_runs(rig):
    seen = []
    rig.at(0.5, lambda: seen.append(rig.plc.report))
    rig.command(GRASP)
    assert (seen[0].state, seen[0].stage, seen[0].result) == (State.EXECUTE, 1, Result.NONE)
