"""A served cell gets quicker with every part of a fixture, keeps that over a restart, and forgets it on command."""

import math
from dataclasses import dataclass, field

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.records.journal import Journal
from cell.run.learning import read_learned
from cell.run.supervisor import Supervisor
from plc_bridge.protocol.messages import Command, Control, Refusal, Report, Result
from skills.catalogue import CATALOGUE

INSERT = CATALOGUE["insert_peg"].code
SETS = ("reality.scale=0.0", "sim.pace=max", "sim.seed=42001", "sim.fixture={deviation=0.0005}")
QUICK = 1.3
"""Longest search of a cell that has learnt the place of the hole, s."""


@dataclass
class Script:
    """A line that gives commands in turn and keeps the answers."""

    commands: list[Command]
    reports: list[Report] = field(default_factory=list)
    refused: list[Refusal] = field(default_factory=list)

    def poll(self) -> Command | None:
        return self.commands.pop(0) if self.commands else None

    def publish(self, report: Report) -> None:
        self.reports.append(report)

    def accept(self, command: Command) -> None: ...

    def refuse(self, command: Command, refusal: Refusal) -> None:
        self.refused.append(refusal)


def searched(folder, parts: int, *then: Command) -> tuple[list[float], Script]:
    """Return the time of the search of each part on a fresh cell with the records of a folder, s, and its line."""
    line = Script([])
    loaded, times = load(sets=SETS), []
    with Journal(folder) as journal, opened(assemble(loaded.cell)) as cell:
        supervisor = Supervisor(cell, loaded, line, journal)
        for n in range(parts):
            line.commands.append(Command(n + 1, INSERT))
            supervisor.scan()
            report = supervisor.report
            assert report.result is Result.SUCCESS
            assert cell.truth is not None
            assert math.dist(report.hole, cell.truth().hole[:2]) < 1e-3
            times.append(report.stage_times[CATALOGUE.stage_number("spray_search") - 1])
        line.commands.extend(then)
        supervisor.scan()
    return times, line


def test_the_third_part_of_a_fixture_is_found_at_once_also_by_a_cell_that_was_restarted(tmp_path):
    before, _ = searched(tmp_path, 3)
    assert before[2] < QUICK < before[0]
    after, line = searched(tmp_path, 1, Command(9, Control.FORGET, recipe=7), Command(10, Control.FORGET))
    assert after[0] < QUICK
    assert line.refused == [Refusal.UNKNOWN_RECIPE]
    assert read_learned(tmp_path).places == {}
