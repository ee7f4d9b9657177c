"""Requests of a PLC to the cell, through the bridge's mailbox, against instant fakes."""

import json
from itertools import groupby

from cell.run.states import State
from drivers.errors import FaultCode
from plc_bridge.protocol.messages import Control, Result
from skills.contract import Reason

GRASP, RELEASE = 101, 105


def test_the_program_clears_up_after_a_failure(rig):
    rig.gripper.has_peg = False
    rig.command(100)
    row = rig.journal.find(1)
    assert (row.outcome, row.stage, row.reason) == ("failure", "grasp_from_rack", "missed_grasp")
    assert [name for name, _ in json.loads(row.stage_times)] == ["grasp_from_rack", "recover"]


def test_a_limit_that_is_hit_in_the_scan_of_a_hold_ends_the_run(rig):
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    rig.at(0.5, lambda: rig.arm.force.__setitem__(2, 1.001 * rig.loaded.cell.limits.force))
    report = rig.command(GRASP)
    assert (report.result, report.reason, report.state) == (Result.FAILURE, Reason.FORCE_LIMIT, State.COMPLETE)


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


def test_a_hold_is_obeyed_also_on_the_way_back(rig):
    states = []
    rig.clock.every.append(lambda: states.append(rig.plc.report.state))
    for time, control in ((0.5, Control.HOLD), (1.0, Control.UNHOLD), (1.5, Control.HOLD), (2.0, Control.UNHOLD)):
        rig.at(time, lambda control=control: rig.plc.trigger(control))
    assert rig.command(GRASP).result == Result.SUCCESS
    assert [state for state, _ in groupby(states)].count(State.HELD) == 2
