"""Snapshots of one run from the scan, for repeated display."""

from dataclasses import replace
from pathlib import Path

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.records.journal import Journal
from cell.run.line import TerminalLine
from cell.run.live import Live, Look
from cell.run.supervisor import Supervisor
from plc_bridge.messages import FIRST_PROGRAM, Command, Report, Result


class Kept(Live):
    """A slot that keeps all snapshots."""

    def __init__(self) -> None:
        super().__init__()
        self.looks: list[Look] = []

    def show(self, look: Look) -> None:
        """Keep a snapshot."""
        self.looks.append(look)


def recorded(folder: Path) -> list[Look]:
    """Return every snapshot of one run of the default simulated cell, at full speed."""
    loaded, kept = load(sets=["sim.pace=max"]), Kept()
    with Journal(folder) as journal, opened(assemble(loaded.cell)) as cell:

        def watch(report: Report) -> None:
            if report.result is not Result.NONE:
                supervisor.quit()

        line = TerminalLine(Command(1, FIRST_PROGRAM, source="study"), watch)
        supervisor = Supervisor(cell, loaded, line, journal, live=kept)
        supervisor.serve()
    return [look for look in kept.looks if look.run]


def as_run(looks: list[Look], run: int) -> list[Look]:
    """Return the same snapshots under the number of another run."""
    return [replace(look, run=run) for look in looks]
