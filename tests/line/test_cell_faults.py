"""Every fault code that can be provoked today: the arm is halted, the PLC reads the code, and a reset re-arms."""

import math
import socket
from dataclasses import replace

import numpy as np
import pytest

from cell.commands.cli import FAULT, main
from cell.run.states import State
from drivers.errors import (
    ArmReflexError,
    ArmSilentError,
    ArmStoppedError,
    FaultCode,
    GripperSilentError,
    NotPassiveError,
    SkinSilentError,
    SkinUntrustedError,
)
from drivers.frames import UP
from drivers.quantities import Pose, SwitchState
from plc_bridge.protocol.messages import Control, PartPlace, Result
from skills.catalogue import CATALOGUE
from skills.catalogue import GRASP as GRASP_SKILL
from skills.contract import Outcome, Reason, SkillResult
from skills.entry import Program
from skills.flow import run_stage
from skills.grasp_from_rack import ACROSS_RACK
from skills.motion import Goal, move
from tests.fakes import HAND_DOWN

GRASP, SEARCH, ADJUST = 101, 102, 104


def faulty(rig, device, error):
    """Let a device of the rig fail half a second from now."""
    rig.at(0.5, lambda: setattr(device, "fault", error))


def hold_peg(rig, above=0.0):
    """Let the hand hold a peg whose end is so far above the plate, m."""
    config = rig.loaded.cell
    rig.gripper.grip(config.grasp.force)
    rig.arm.floor = config.hole.centre[2]
    rig.arm.tcp = Pose(np.array(config.hole.centre) + np.array([0.0, 0.0, above + config.peg.length]), HAND_DOWN)


def switch_says(rig, state):
    """Let the switch change half a second from now, while the hand holds the peg on the plate."""
    hold_peg(rig)
    rig.at(0.5, lambda: setattr(rig.switch, "state", state))


def creep(rig):
    """Stop after half a second an arm that ignores commands and keeps moving."""
    rig.arm.dq[2] = 0.02
    rig.clock.every.append(lambda: rig.arm.q.__setitem__(2, 0.02 * rig.clock.time))
    rig.at(0.5, rig.plc.stop)


def pull_always(rig):
    """Let the arm of a hand that holds a peg report a force in free air."""
    hold_peg(rig, 0.05)
    rig.arm.force[2] = 45.0


def reverse_wrench(rig):
    """Let a held peg come down on a plate, and the arm report that it is pulled down."""
    hold_peg(rig, 0.05)
    follow = rig.arm.follow

    def press(setpoint):
        follow(setpoint)
        rig.arm.force[2] = -8.0 if setpoint.tip[2] < rig.arm.floor else 0.0

    rig.arm.follow = press


PROVOKE = {
    FaultCode.SKIN_SILENT: (GRASP, lambda rig: faulty(rig, rig.skin, SkinSilentError("skin: silent"))),
    FaultCode.SKIN_UNTRUSTED: (GRASP, lambda rig: faulty(rig, rig.skin, SkinUntrustedError("skin: 3 taxels"))),
    FaultCode.ARM_STOPPED: (GRASP, lambda rig: faulty(rig, rig.arm, ArmStoppedError("arm: emergency stop"))),
    FaultCode.ARM_REFLEX: (GRASP, lambda rig: faulty(rig, rig.arm, ArmReflexError("arm: reflex"))),
    FaultCode.ARM_SILENT: (GRASP, lambda rig: faulty(rig, rig.arm, ArmSilentError("arm: no new state"))),
    FaultCode.GRIPPER_SILENT: (GRASP, lambda rig: faulty(rig, rig.gripper, GripperSilentError("gripper: silent"))),
    FaultCode.TRACKING: (GRASP, lambda rig: rig.at(0.5, lambda: setattr(rig.arm, "is_blocked", True))),
    FaultCode.ARM_RESTLESS: (GRASP, creep),
    FaultCode.NOT_FINITE: (GRASP, lambda rig: rig.at(0.5, lambda: rig.arm.force.__setitem__(1, math.nan))),
    FaultCode.WRENCH_OFFSET: (SEARCH, pull_always),
    FaultCode.WRENCH_REVERSED: (SEARCH, reverse_wrench),
    FaultCode.SCAN_OVERRUN: (GRASP, lambda rig: rig.at(0.1, lambda: setattr(rig.clock, "lag", 0.02))),
    FaultCode.NOT_PASSIVE: (GRASP, lambda rig: faulty(rig, rig.arm, NotPassiveError("arm: pumped"))),
    FaultCode.SOFTWARE: (GRASP, lambda rig: faulty(rig, rig.arm, ZeroDivisionError("a\ndefect"))),
    FaultCode.SWITCH_UNKNOWN: (ADJUST, lambda rig: switch_says(rig, SwitchState.UNKNOWN)),
    FaultCode.SWITCH_DISAGREES: (ADJUST, lambda rig: switch_says(rig, SwitchState.CLOSED)),
    FaultCode.PLC_LOST: (GRASP, lambda rig: rig.at(0.5, lambda: setattr(rig.plc, "is_alive", False))),
}


@pytest.mark.parametrize("code", PROVOKE, ids=lambda code: code.name)
def test_a_fault_in_a_run_halts_the_arm_until_clear_and_reset(rig, code):
    command, provoke = PROVOKE[code]
    provoke(rig)
    report = rig.command(command)
    assert (report.state, report.fault) == (State.ABORTED, code)
    assert rig.arm.is_halted
    assert (rig.journal.find(1).outcome, rig.journal.find(1).fault) == ("fault", code)

    rig.skin.fault, rig.switch.state, rig.plc.is_alive, rig.clock.lag = None, SwitchState.OPEN, True, 0.0
    rig.gripper.fault, rig.arm.is_blocked, rig.arm.force[:] = None, False, 0.0
    rig.scan(2)
    if code is FaultCode.PLC_LOST:
        rig.plc.trigger(0)  # the first number after a loss is adopted, never run
    assert rig.command(Control.CLEAR).state == State.STOPPED
    assert rig.command(Control.RESET).state == State.IDLE
    assert rig.arm.resets >= 1
    if command != GRASP:
        assert rig.put_away().part == PartPlace.BIN  # the hand held the peg all the while
    assert rig.command(GRASP).result == Result.SUCCESS


def test_an_idle_fault_keeps_the_result_and_the_skin_is_read(rig):
    rig.command(GRASP)
    rig.skin.fault = SkinSilentError("skin: silent")
    report = rig.scan()
    assert (report.state, report.result) == (State.ABORTED, Result.SUCCESS)
    before = rig.skin.reads
    rig.scan(5)
    assert rig.skin.reads > before + 4


def test_a_record_that_cannot_be_begun_keeps_the_arm_still(rig):
    before = rig.arm.tcp
    rig.journal.close()
    report = rig.command(GRASP)
    assert (report.state, report.fault) == (State.ABORTED, FaultCode.JOURNAL)
    assert rig.arm.tcp is before


def test_a_port_in_use_is_reported_in_one_line(capsys, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        status = main(["serve", "--set", f"plc.modbus.port={port}", "--journal", str(tmp_path)])
    (told,) = (line for line in capsys.readouterr().err.splitlines() if "compiling" not in line)
    assert status == FAULT
    assert f"fault {FaultCode.DEVICE_NOT_OPENED}" in told
    assert str(port) in told


def leaping(skills, ctx):
    """A program whose skill hands over a setpoint 90 mm away, past the context's own `follow`."""

    def leap(ctx):
        for _ in move(Goal(ctx.observe().arm.tcp.position, UP, ACROSS_RACK), skills[GRASP_SKILL].transfer, ctx, None):
            ctx.devices.arm.follow(replace(ctx.lead.held, tip=ctx.lead.held.tip + np.array([0.0, 0.0, 0.09])))
        return SkillResult(Outcome.SUCCESS, Reason.NONE, 0.0)

    return [run_stage("grasp_from_rack", leap, ctx)]


def test_a_skill_that_leaps_is_stopped_at_the_gate(rig, monkeypatch):
    monkeypatch.setitem(CATALOGUE.by_code, GRASP, Program(name="leaping", code=GRASP, run=leaping))
    before = rig.arm.tcp.position.copy()
    report = rig.command(GRASP)
    assert (report.state, report.fault) == (State.ABORTED, FaultCode.SETPOINT)
    assert rig.arm.is_halted
    np.testing.assert_allclose(rig.arm.tcp.position, before)


@pytest.mark.parametrize("scans", [0, 1])
def test_a_stage_that_the_catalogue_does_not_have_is_a_fault(rig, monkeypatch, scans):
    def wander(ctx):
        for _ in range(scans):
            next(ctx.scan(1.0))
        return SkillResult(Outcome.SUCCESS, Reason.NONE, 0.0)

    stray = Program(name="stray", code=GRASP, run=lambda skills, ctx: [run_stage("wander", wander, ctx)])
    monkeypatch.setitem(CATALOGUE.by_code, GRASP, stray)
    report = rig.command(GRASP)
    assert (report.result, report.fault, report.state) == (Result.FAULT, FaultCode.CONFIG, State.ABORTED)
    assert rig.journal.find(report.run).outcome == Outcome.FAULT
    rig.plc.trigger(Control.RESET)
    assert rig.scan().state == State.IDLE
