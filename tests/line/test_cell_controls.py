"""Hold, stop and abort in the middle of every real skill, on the simulated cell; the PLC lives in the cell's own time."""

import json
import math
import random
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np
import pytest

from cell.records.samples import read_samples
from cell.run.states import State
from plc_bridge.protocol.messages import Control, PartPlace, Result
from skills.catalogue import CATALOGUE
from skills.guards.rest import REST_SPEED
from tests.simulated_line import INSERT, line

LENGTHS = {
    "grasp_from_rack": 280,
    "spray_search": 120,
    "tactile_insert": 80,
    "spiral_adjust": 100,
    "release_and_retract": 80,
}
"""Approximate scans of a stage; a shorter one is interrupted at its end."""
BRAKING = 60
"""Scans from a command to an arm at rest, at most."""
PAUSE = 50
"""Scans on hold."""
CREEP = 0.001
"""Way of a halted arm, m: the hand goes on closing, on a peg that stands in the rack."""


@dataclass
class Braking:
    """Motion of an arm from a command on."""

    stage: int
    ages: list[float] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    places: list[np.ndarray] = field(default_factory=list)
    states: list[State] = field(default_factory=list)


class Controlled:
    """A simulated cell and a PLC that interferes at a chosen scan of a stage."""

    def __init__(self, line):
        self.line = line
        line.clock.every.append(self._look)
        self._plan, self._scans_of_stage, self._is_braking = {}, 0, False

    def run(self, control, plan):
        """Run `insert_peg`, with `control` at each scan of a stage that `plan` names, and return its record."""
        self._plan, self.brakings, self._control, self.line.bridge.states = dict(plan), [], control, []
        self.line.command(INSERT)
        self.line.scan(PAUSE)
        self._is_braking = False
        return self.line.journal.find(self.line.supervisor.last.run)

    @property
    def states(self):
        """The states of the run in their order."""
        states = [state for state, _ in groupby(self.line.bridge.states)]
        return states[states.index(State.STARTING) :]

    def _look(self):
        report = self.line.plc.report
        if self._is_braking:
            self._watch(self.brakings[-1], report)
        elif self._plan and report.state == State.EXECUTE:
            stage = min(self._plan)
            self._scans_of_stage = self._scans_of_stage + 1 if report.stage == stage else 0
            if self._scans_of_stage > self._plan[stage] or report.stage > stage:
                del self._plan[stage]
                self._scans_of_stage = 0
                self._is_braking = True
                self.brakings.append(Braking(report.stage))
                self.line.plc.trigger(self._control)

    def _watch(self, braking, report):
        arm = self.line.cell.arm.read()
        braking.ages.append(arm.setpoint_age)
        braking.speeds.append(float(np.max(np.abs(arm.dq))))
        braking.places.append(arm.tcp.position)
        braking.states.append(State(report.state))
        if self._control is Control.HOLD and len(braking.ages) == BRAKING + PAUSE:
            self._is_braking = False
            self.line.plc.trigger(Control.UNHOLD)


def moments(seed):
    """Return a scan of each stage, by the stage's number."""
    draw = random.Random(seed)
    return {CATALOGUE.stage_number(name): draw.randrange(length) for name, length in LENGTHS.items()}


def assert_halted(braking, state):
    """The arm has no setpoint from the first scan on, is at rest before `state` is reported, and stays there."""
    assert set(braking.ages) == {math.inf}
    rest = braking.states.index(state)
    assert rest <= BRAKING, f"stage {braking.stage}"
    assert braking.speeds[rest - 1 if rest else 0] < REST_SPEED
    assert set(braking.states[rest:]) == {state}
    way = np.linalg.norm(np.array(braking.places[rest:]) - braking.places[rest], axis=1)
    assert way.max() < CREEP, f"stage {braking.stage}"


def test_every_skill_holds_and_goes_on(tmp_path):
    """The peg leaves the plate while the arm brakes; if it came down at once, it would strike with 60 N."""
    with line(tmp_path, seed=30) as made:
        cell = Controlled(made)
        row = cell.run(Control.HOLD, moments(1030))
    assert (row.outcome, row.fault) == ("success", 0)
    assert len(cell.brakings) == len(LENGTHS)
    for braking in cell.brakings:
        assert_halted(braking, State.HELD)
    holds = [State.EXECUTE, State.HOLDING, State.HELD, State.UNHOLDING] * len(LENGTHS)
    assert cell.states == [State.STARTING, *holds, State.EXECUTE, State.COMPLETE]


ENDS = [(Control.STOP, State.STOPPING, State.STOPPED), (Control.ABORT, State.ABORTING, State.ABORTED)]


def test_stop_or_abort_ends_every_skill_until_a_reset(tmp_path):
    """The two take turns: either is the same interruption to a skill."""
    with line(tmp_path, seed=13) as made:
        cell = Controlled(made)
        for run, (stage, scan) in enumerate(moments(13).items(), 1):
            control, acting, final = ENDS[run % 2]
            row = cell.run(control, {stage: scan})
            assert_halted(cell.brakings[0], final)
            assert cell.states == [State.STARTING, State.EXECUTE, acting, final]
            assert (row.run, row.outcome, row.reason) == (run, "aborted", "stopped")
            assert CATALOGUE.stage_number(row.stage) == cell.brakings[0].stage
            # Every stage has its time and its samples, and no scan is missing.
            samples = read_samples(tmp_path / f"run-{row.run:06d}.arrows")
            times = [CATALOGUE.stage_number(name) for name, _ in json.loads(row.stage_times)]
            assert times == sorted(set(samples["stage"]))
            assert np.diff(samples["stamp"]).max() == pytest.approx(1.0 / made.cell.config.scan_rate)
            assert made.plc.report.result == Result.ABORTED
            if control is Control.ABORT:
                assert made.command(Control.CLEAR).state == State.STOPPED
            assert made.command(Control.RESET).state == State.IDLE
            assert made.command(Control.CLEARED).part == PartPlace.RACK  # somebody takes the peg out of the hand
