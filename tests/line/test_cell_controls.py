"""Hold, stop and abort in the middle of every real skill, on the simulated cell; the PLC lives in the cell's own time."""

import json
import math
import random
from contextlib import contextmanager
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
"""Scans that a stage takes about; one that is over sooner is interrupted where it ends."""
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

    def __init__(self, line, folder):
        self.line, self.folder = line, folder
        line.clock.every.append(self._look)
        self._plan, self._scans_of_stage = {}, 0
        self.brakings: list[Braking] = []
        self._is_braking = False

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


@contextmanager
def controlled(folder, seed):
    with line(folder, seed=seed) as made:
        yield Controlled(made, folder)


def moments(seed):
    """Return a scan of each stage, by the stage's number."""
    draw = random.Random(seed)
    return {CATALOGUE.stage_number(name): draw.randrange(length) for name, length in LENGTHS.items()}


def assert_halted(braking, state):
    """The arm holds no setpoint from the first scan on, is at rest before `state` is reported, and stays where it is."""
    assert set(braking.ages) == {math.inf}
    rest = braking.states.index(state)
    assert rest <= BRAKING, f"stage {braking.stage}"
    assert braking.speeds[rest - 1 if rest else 0] < REST_SPEED
    assert set(braking.states[rest:]) == {state}
    way = np.linalg.norm(np.array(braking.places[rest:]) - braking.places[rest], axis=1)
    assert way.max() < CREEP, f"stage {braking.stage}"


def test_every_skill_holds_and_goes_on(tmp_path):
    """The peg leaves the plate while the arm brakes; coming down at once, it would hit with 60 N."""
    with controlled(tmp_path, 30) as cell:
        row = cell.run(Control.HOLD, moments(1030))
    assert (row.outcome, row.fault) == ("success", 0)
    assert len(cell.brakings) == len(LENGTHS)
    for braking in cell.brakings:
        assert_halted(braking, State.HELD)
    holds = [State.EXECUTE, State.HOLDING, State.HELD, State.UNHOLDING] * len(LENGTHS)
    assert cell.states == [State.STARTING, *holds, State.EXECUTE, State.COMPLETE]


ENDS = [(Control.STOP, State.STOPPING, State.STOPPED), (Control.ABORT, State.ABORTING, State.ABORTED)]


def test_every_skill_is_ended_by_stop_or_abort_and_after_a_reset_the_next_run_starts(tmp_path):
    """The two take turns: either is the same interruption to a skill."""
    with controlled(tmp_path, 13) as cell:
        for run, (stage, scan) in enumerate(moments(13).items(), 1):
            control, acting, final = ENDS[run % 2]
            row = cell.run(control, {stage: scan})
            assert_halted(cell.brakings[0], final)
            assert cell.states == [State.STARTING, State.EXECUTE, acting, final]
            assert (row.run, row.outcome, row.reason) == (run, "aborted", "stopped")
            assert CATALOGUE.stage_number(row.stage) == cell.brakings[0].stage
            assert_complete(row, cell)
            assert cell.line.plc.report.result == Result.ABORTED
            if control is Control.ABORT:
                assert cell.line.command(Control.CLEAR).state == State.STOPPED
            assert cell.line.command(Control.RESET).state == State.IDLE
            assert cell.line.command(Control.CLEARED).part == PartPlace.RACK  # somebody takes the peg out of the hand


def assert_complete(row, cell):
    """Every stage has its time and its samples, and no scan is missing."""
    times = dict(json.loads(row.stage_times))
    samples = read_samples(cell.folder / f"run-{row.run:06d}.arrows")
    assert [CATALOGUE.stage_number(name) for name in times] == sorted(set(samples["stage"]))
    period = 1.0 / cell.line.cell.config.scan_rate
    assert np.diff(samples["stamp"]).max() == pytest.approx(period)
