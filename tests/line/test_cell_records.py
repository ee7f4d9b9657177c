"""Entries that a run of the whole cell of fakes leaves in the journal."""

import json

import pytest

from cell.records.schema import EventKind
from cell.run.states import State
from drivers.errors import FaultCode, SkinSilentError
from plc_bridge.protocol.messages import Control, Result, Warnings
from skills.catalogue import CATALOGUE
from skills.contract import Outcome, Reason, SkillResult
from skills.entry import Program
from skills.flow import run_stage
from tests.trouble import full_disk, until

GRASP, RELEASE = CATALOGUE["grasp_from_rack"].code, CATALOGUE["release_and_retract"].code


def test_a_run_says_what_it_was_made_with_and_how_long_it_took(rig):
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
def test_the_times_of_a_run_never_fall_and_stay_when_it_has_ended(rig, monkeypatch, is_stopped):
    monkeypatch.setitem(CATALOGUE.by_code, GRASP, Program(name="twice", code=GRASP, run=searched_twice))
    told = []
    rig.clock.every.append(lambda: told.append(rig.plc.report))
    if is_stopped:
        rig.at(1.5, rig.plc.stop)
    report = rig.command(GRASP)
    assert report.result == (Result.ABORTED if is_stopped else Result.SUCCESS)
    for name in ("total_time", "stage_times"):
        values = [getattr(each, name) for each in told if each.run == report.run]
        assert values == sorted(values)
        assert values[-1] == getattr(rig.scan(10), name)
    assert report.total_time == pytest.approx(1.1 if is_stopped else 1.2, abs=0.1)


def test_states_commands_refusals_and_faults_are_events(rig):
    rig.command(GRASP)
    rig.command(Control.HOLD)
    rig.skin.fault = SkinSilentError("skin: silent")
    rig.scan()
    told = {kind: [] for kind in EventKind}
    for event in rig.journal.events():
        told[event.kind].append((event.name, event.code, event.source, event.run))
    assert told["command"] == [("grasp_from_rack", GRASP, "plc", 0), ("hold", Control.HOLD, "plc", 0)]
    assert [name for name, *_ in told["refusal"]] == ["not_ready"]
    assert told["fault"] == [("SKIN_SILENT", FaultCode.SKIN_SILENT, "", 0)]
    assert ("EXECUTE", State.EXECUTE, "", 1) in told["state"]
    assert told["state"][-1] == ("ABORTED", State.ABORTED, "", 0)


def test_a_run_on_a_full_disk_goes_on_and_the_plc_reads_the_warning(rig):
    with full_disk():
        report = rig.command(GRASP)
        until(lambda: rig.journal.trouble)
        assert (report.result, rig.scan().warnings) == (Result.SUCCESS, Warnings.NOT_RECORDED)
    assert rig.command(RELEASE).fault == FaultCode.NONE
    until(lambda: not rig.journal.trouble)
    assert rig.scan().warnings == 0
    warned = [event.name for event in rig.journal.events() if event.kind == EventKind.WARNING]
    assert warned == ["not recorded", "not recorded is over"]
