"""Requests of a PLC to the whole cell of fakes: reports and records of its runs."""

import json
from itertools import groupby

import numpy as np
import pytest

from cell.records.schema import EventKind
from cell.run.states import State
from drivers.errors import ArmReflexError, FaultCode, SkinSilentError
from drivers.quantities import Pose, SwitchState
from plc_bridge.protocol.images import PACKML
from plc_bridge.protocol.messages import Control, PartEvidence, PartPlace, Refusal, Result, Warnings
from skills.catalogue import CATALOGUE
from skills.contract import Outcome, Reason, SkillResult
from skills.entry import Program
from skills.flow import run_stage
from tests.fakes import HAND_DOWN
from tests.trouble import full_disk, until

GRASP, RELEASE, RECOVER = 101, 105, 106


def test_the_program_clears_up_after_a_failure(rig):
    rig.gripper.has_peg = False
    rig.command(100)
    row = rig.journal.find(1)
    assert (row.outcome, row.stage, row.reason) == ("failure", "grasp_from_rack", "missed_grasp")
    assert [name for name, _ in json.loads(row.stage_times)] == ["grasp_from_rack", "recover"]


def test_a_limit_exceeded_in_the_scan_of_a_hold_ends_the_run(rig):
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    rig.at(0.5, lambda: rig.arm.force.__setitem__(2, 1.001 * rig.loaded.cell.limits.force))
    report = rig.command(GRASP)
    assert (report.result, report.reason, report.state) == (Result.FAILURE, Reason.FORCE_LIMIT, State.COMPLETE)


@pytest.mark.parametrize(
    ("state", "refusal"), [(SwitchState.CLOSED, Refusal.HOLE_OCCUPIED), (SwitchState.UNKNOWN, Refusal.SWITCH_UNKNOWN)]
)
def test_a_closed_or_unknown_switch_refuses_a_start_before_any_motion(rig, state, refusal):
    rig.switch.state, before = state, rig.arm.tcp
    report = rig.command(100)
    assert (report.refusal, report.result) == (refusal, Result.REFUSED)
    assert rig.arm.tcp is before


@pytest.fixture
def reports(rig):
    """Return the reports that the PLC has read, one a scan."""
    read = []
    rig.clock.every.append(lambda: read.append(rig.plc.report))
    return read


def test_an_arm_that_goes_on_moving_is_never_reported_as_held(rig, reports):
    rig.arm.dq[0] = 0.02
    rig.clock.every.append(lambda: rig.arm.q.__setitem__(0, 0.02 * rig.clock.time))
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    report = rig.command(GRASP)
    states = {each.state for each in reports}
    assert State.HOLDING in states
    assert State.HELD not in states
    assert (report.result, report.fault, report.state) == (Result.FAULT, FaultCode.ARM_RESTLESS, State.ABORTED)


def test_a_hold_is_obeyed_also_on_the_way_back(rig, reports):
    for time, control in ((0.5, Control.HOLD), (1.0, Control.UNHOLD), (1.5, Control.HOLD), (2.0, Control.UNHOLD)):
        rig.at(time, lambda control=control: rig.plc.trigger(control))
    assert rig.command(GRASP).result == Result.SUCCESS
    assert [state for state, _ in groupby(each.state for each in reports)].count(State.HELD) == 2


def test_a_run_has_its_settings_and_its_time_on_record(rig):
    before = rig.clock.now()
    row = rig.journal.find(rig.command(GRASP, parameters=((1, 250),)).run)
    assert 0.0 < row.cycle_time < rig.clock.now() - before
    assert json.loads(row.parameters) == {"search.speed": 0.025}
    assert json.loads(rig.journal.config(row.config_hash))["search"]["speed"] == 0.025
    assert (row.is_simulated, row.seed, row.retries) == (1, rig.loaded.cell.sim.seed, 0)
    assert row.ended >= row.started


def searched_twice(skills, ctx):
    """A program whose search takes a second each time, of which it counts less as its own."""

    def search(ctx):
        *_, last = ctx.scan(1.0)
        return SkillResult(Outcome.SUCCESS, Reason.NONE, last.elapsed - 0.4)

    return [run_stage("spray_search", search, ctx) for _ in range(2)]


@pytest.mark.parametrize("is_stopped", [False, True])
def test_the_times_of_a_run_never_fall_and_stay_afterwards(rig, reports, monkeypatch, is_stopped):
    monkeypatch.setitem(CATALOGUE.by_code, GRASP, Program(name="twice", code=GRASP, run=searched_twice))
    if is_stopped:
        rig.at(1.5, rig.plc.stop)
    report = rig.command(GRASP)
    assert report.result == (Result.ABORTED if is_stopped else Result.SUCCESS)
    for name in ("total_time", "stage_times"):
        values = [getattr(each, name) for each in reports if each.run == report.run]
        assert values == sorted(values)
        assert values[-1] == getattr(rig.scan(10), name)
    assert report.total_time == pytest.approx(1.1 if is_stopped else 1.2, abs=0.1)


def test_states_commands_refusals_and_faults_are_events(rig):
    rig.command(GRASP)
    rig.command(Control.HOLD)
    rig.skin.fault = SkinSilentError("skin: silent")
    rig.scan()
    events = {kind: [] for kind in EventKind}
    for event in rig.journal.events():
        events[event.kind].append((event.name, event.code, event.source, event.run))
    assert events["command"] == [("grasp_from_rack", GRASP, "plc", 0), ("hold", Control.HOLD, "plc", 0)]
    assert [name for name, *_ in events["refusal"]] == ["not_ready"]
    assert events["fault"] == [("SKIN_SILENT", FaultCode.SKIN_SILENT, "", 0)]
    assert ("EXECUTE", State.EXECUTE, "", 1) in events["state"]
    assert events["state"][-1] == ("ABORTED", State.ABORTED, "", 0)


def test_a_run_on_a_full_disk_goes_on_with_a_warning(rig):
    with full_disk():
        report = rig.command(GRASP)
        until(lambda: rig.journal.trouble)
        assert (report.result, rig.scan().warnings) == (Result.SUCCESS, Warnings.NOT_RECORDED)
    assert rig.command(RELEASE).fault == FaultCode.NONE
    until(lambda: not rig.journal.trouble)
    assert rig.scan().warnings == 0
    warned = [event.name for event in rig.journal.events() if event.kind == EventKind.WARNING]
    assert warned == ["not recorded", "not recorded is over"]


def hold_in_hole(rig, depth):
    """Let the hand hold an upright peg with its end so deep in the hole's area, m."""
    hole, length = np.array(rig.loaded.cell.hole.centre), rig.loaded.cell.peg.length
    rig.gripper.grip(30.0)
    rig.arm.tcp = Pose(hole + np.array([0.003, -0.002, length - depth]), HAND_DOWN)


def test_the_place_of_the_peg_its_depth_and_their_evidence(rig):
    bit = PartEvidence
    assert rig.scan().part_evidence == bit.HAND_EMPTY | bit.SKIN_FREE | bit.SWITCH_OPEN
    hold_in_hole(rig, 0.0123)
    report = rig.scan(12)  # until the next frame of the skin
    held = bit.HAND_HOLDS | bit.SKIN_TOUCHED | bit.TIP_IN_HOLE | bit.SWITCH_OPEN
    assert report.part_evidence == held
    assert report.part_width == pytest.approx(rig.loaded.cell.peg.part.thickness)
    assert report.part_depth == pytest.approx(0.0123, abs=1e-6)
    report = rig.command(Control.CLEARED)  # by mistake: the hand still holds it
    assert (report.part, report.part_evidence) == (PartPlace.IN_HOLE, held)
    rig.gripper.has_peg = False
    rig.gripper.release(0.04)
    rig.scan()
    report = rig.command(Control.CLEARED)
    assert (report.part, report.part_evidence) == (PartPlace.RACK, bit.PERSON)


def test_the_place_of_the_hole_and_the_largest_force_of_the_run(rig):
    hold_in_hole(rig, 0.010)
    rig.at(0.1, lambda: rig.arm.force.__setitem__(2, 23.45))
    rig.at(0.3, lambda: rig.arm.force.__setitem__(2, 0.0))
    rig.at(0.5, rig.plc.stop)
    report = rig.command(RECOVER)
    x, y, _ = rig.loaded.cell.hole.centre
    assert report.hole == pytest.approx((x + 0.003, y - 0.002), abs=5e-4)
    assert report.peak_force == pytest.approx(23.45)


def test_states_reasons_and_counts_of_pack_tags(rig):
    def tags(*names):
        values = PACKML.unpack(rig.bridge.packml_words())
        return tuple(values[f"packml_{name}"] for name in names)

    rig.scan(10)
    assert tags("unit_mode", "state") == (1, State.IDLE)
    rig.gripper.has_peg = False
    rig.command(100)  # an empty slot: an insertion that fails
    assert tags("processed", "defective", "cntrl_cmd") == (1, 1, Control.START)
    assert tags(f"state_time_{State.EXECUTE.value}")[0] >= 3
    rig.arm.fault = ArmReflexError("arm: reflex")
    rig.scan()
    assert tags("state", "stop_reason") == (State.ABORTED, FaultCode.ARM_REFLEX)
    rig.command(Control.RESET)
    assert tags("state", "cntrl_cmd") == (State.IDLE, Control.RESET)
    rig.command(Control.CLEARED)
    assert tags("cntrl_cmd") == (Control.RESET,)  # CLEARED is no control of PackML
