"""The state of the peg follows switch, skin and hand, over silent devices and faults."""

import json
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from cell.peg.part_watch import EARLY_SHARE, LONGEST_UNKNOWN, PROVEN_BY_SWITCH, PartWatch
from drivers.errors import ArmSilentError, CellError, SkinSilentError, SwitchDisagreesError, SwitchUnknownError
from drivers.quantities import SwitchState
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Refusal, Report
from skills.entry import Claim

HOLE = (0.5, 0.01)


@pytest.fixture
def ctx(rig):
    return rig.cell.context(0)


@pytest.fixture
def watch(rig, ctx, tmp_path):
    return PartWatch(rig.cell, ctx, tmp_path)


def test_a_run_does_not_report_the_hole_of_the_last_one(rig, watch):
    assert watch.filled(Report(hole=HOLE)).hole == HOLE
    watch.begin(rig.loaded.cell, Claim.INSERTED)
    assert watch.filled(Report(hole=HOLE)).hole == (0.0, 0.0)


def scanned(rig, ctx, watch, claim, stage, scans):
    """Scan a switch that does not answer so many times."""
    ctx.stage, rig.switch.state = stage, SwitchState.UNKNOWN
    watch.begin(rig.loaded.cell, claim)
    for _ in range(scans):
        rig.clock.time += ctx.schedule.period
        watch.see(ctx.observe())


@pytest.mark.parametrize("claim", PROVEN_BY_SWITCH)
def test_a_run_that_needs_the_switch_ends_without_it(rig, ctx, watch, claim):
    scans = round(LONGEST_UNKNOWN / ctx.schedule.period)
    scanned(rig, ctx, watch, claim, "spray_search", scans)
    with pytest.raises(SwitchUnknownError, match=r"no valid answer for 0\.5 s"):
        scanned(rig, ctx, watch, claim, "spray_search", scans + 2)


@pytest.mark.parametrize(("claim", "stage"), [(Claim.INSERTED, "recover"), (Claim.HELD, "grasp_from_rack")])
def test_neither_a_recovery_nor_a_grasp_needs_the_switch(rig, ctx, watch, claim, stage):
    scanned(rig, ctx, watch, claim, stage, 3 * round(LONGEST_UNKNOWN / ctx.schedule.period))


def closing(rig, ctx, watch, stage, depth, is_held):
    """Close the open switch in this stage, with the end of a held peg so deep, m."""
    hole = rig.loaded.cell.job().hole
    if is_held:
        rig.gripper.grip(30.0)
    tip = ctx.observe().tip
    above = np.array([0.0, 0.0, hole.centre[2] - depth - tip[2]])
    rig.arm.tcp = replace(rig.arm.tcp, position=rig.arm.tcp.position + above)
    ctx.stage = stage
    watch.begin(rig.loaded.cell, Claim.INSERTED)
    for state in (SwitchState.OPEN, SwitchState.CLOSED):
        rig.switch.state = state
        rig.clock.time += ctx.schedule.period
        watch.see(ctx.observe())


@pytest.mark.parametrize(
    ("stage", "share", "is_held", "is_fault"),
    [
        ("grasp_from_rack", -3.0, False, True),
        ("grasp_from_rack", -3.0, True, True),
        ("spray_search", EARLY_SHARE - 0.01, True, True),
        ("spray_search", EARLY_SHARE + 0.01, True, False),
        ("spray_search", -3.0, False, False),
        ("tactile_insert", 0.1, True, False),
        ("release_and_retract", -3.0, False, False),
    ],
)
def test_a_switch_that_closes_too_early_is_a_fault(rig, ctx, watch, stage, share, is_held, is_fault):
    with pytest.raises(SwitchDisagreesError, match="switch: closed") if is_fault else nullcontext():
        closing(rig, ctx, watch, stage, share * rig.loaded.cell.job().hole.depth, is_held)


SKIN = PartEvidence.SKIN_TOUCHED | PartEvidence.SKIN_FREE


@pytest.mark.parametrize("looks", [True, False])
def test_the_skin_shows_a_held_peg_with_and_without_a_scan(rig, ctx, watch, looks):
    rig.gripper.grip(30.0)
    rig.clock.time += 1.0
    watch.look() if looks else watch.see(ctx.observe())
    assert watch.part.basis & SKIN == PartEvidence.SKIN_TOUCHED


def test_the_skin_counts_as_free_once_its_last_print_is_old(rig, watch):
    rig.gripper.grip(30.0)
    rig.clock.time = 1.0
    watch.look()
    rig.skin.shows_print = False
    found = []
    for rig.clock.time in (1.2, 1.3):
        watch.look()
        found.append(watch.part.basis & SKIN)
    assert found == [PartEvidence.SKIN_TOUCHED, PartEvidence.SKIN_FREE]


def test_a_silent_or_untrusted_skin_is_no_evidence(rig, watch):
    rig.gripper.grip(30.0)
    rig.skin.trusted[:] = False
    watch.look()
    assert watch.part.basis == PartEvidence.HAND_HOLDS | PartEvidence.SWITCH_OPEN
    rig.skin.fault = SkinSilentError("skin: silent")
    watch.look()
    assert watch.part.basis == PartEvidence.HAND_HOLDS | PartEvidence.SWITCH_OPEN


@pytest.fixture
def silent(rig, watch):
    """Return the watch in a run whose arm times out."""
    watch.look()
    watch.begin(rig.loaded.cell, Claim.INSERTED)
    rig.arm.fault = ArmSilentError("arm: silent")
    return watch


def test_a_hand_closing_while_the_arm_is_silent_holds_its_peg(rig, silent):
    silent.end()
    assert silent.part.place is PartPlace.RACK
    rig.gripper.grip(30.0)
    silent.look()
    assert (silent.part.place, silent.part.is_held) == (PartPlace.IN_HAND, True)
    rig.gripper.fault = CellError("hand: silent")
    rig.gripper.release(0.04)
    silent.look()
    assert silent.part.is_held


def test_a_closed_switch_is_an_obstacle_while_the_arm_is_silent(rig, silent):
    silent.end()
    rig.switch.state = SwitchState.CLOSED
    silent.look()
    assert silent.filled(Report()).obstacle is Refusal.HOLE_OCCUPIED


def test_a_peg_gripped_after_the_arm_fell_silent_is_recorded(rig, silent, tmp_path):
    rig.gripper.grip(30.0)
    silent.end()
    silent.flush()
    assert json.loads((tmp_path / "part-sim.json").read_text())["place"] == "IN_HAND"
    assert PartWatch(rig.cell, rig.cell.context(0), tmp_path).part.place is PartPlace.UNKNOWN  # before its first look
