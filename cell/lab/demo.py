"""Main job with the built-in default config: a PLC peer requests every insertion over Modbus TCP, and the cell executes it."""

import json
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import assemble, opened
from cell.film.plots import plot_run
from cell.lab.charts import CHART, draw_speed_accuracy
from cell.lab.published import PUBLISHED, Tried, stage_table
from cell.peg.part_state import UNRESOLVED
from cell.records.journal import Journal
from cell.records.samples import read_samples
from cell.records.schema import RunRow
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from plc_bridge.bridge import Bridge
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Control, PartPlace, Report, Result
from skills.catalogue import CATALOGUE
from skills.contract import Outcome

LONGEST = 3600.0
"""Wall time after which the peer aborts a run, s."""
RUN_PICTURE = "trial.png"


@dataclass(frozen=True, slots=True)
class DemoResult:
    """Result of the demo from the peer and the journal."""

    reports: list[Report]
    """Report that the PLC read at the end of each insertion."""
    rows: list[RunRow]
    """Row of each insertion in the journal."""

    def tried(self) -> list[Tried]:
        """Return the runs in the form of the stage table."""
        return [as_tried(row) for row in self.rows]


def as_tried(row: RunRow) -> Tried:
    """Return a recorded run in the form of the stage table."""
    names = {stage.name for stage in PUBLISHED}
    times = {name: time for name, time in json.loads(row.stage_times) if name in names}
    return Tried(row.outcome == Outcome.SUCCESS, row.stage, times)


def run_demo(
    loaded: LoadedConfig,
    journal: Journal,
    trials: int,
    watch: Callable[[int, Report], None],
    stop: threading.Event,
) -> DemoResult:
    """Run `trials` insertions and return their results; the calling thread is the scan thread.

    Args:
        loaded: A simulated cell.
        journal: The opened journal.
        trials: Number of insertions requested by the peer.
        watch: Function that the peer's thread calls with the number of ended insertions and the report read by the peer.
        stop: Event that ends the demo when it is set; the arm is stopped first.

    Raises:
        CellError: The port is in use, or the peer lost the cell.
    """
    # compilation in the first insertion can halt both peer and cell for over a second, so silence is no sign of a lost PLC
    bridge = Bridge(loaded.cell.plc.model_copy(update={"life_timeout": LONGEST}), PROGRAMS, PARAMETERS)
    reports: list[Report] = []
    with opened(assemble(loaded.cell)) as cell:
        supervisor = Supervisor(cell, loaded, bridge, journal, stop)
        supervisor.scan()  # the first scan compiles, and a PLC in the same process would get no answers meanwhile
        bridge.start()

        def ask() -> None:
            try:
                _be_plc(*bridge.address, trials, reports, watch)
            finally:
                supervisor.quit()

        first = journal.last_run() + 1
        with ThreadPoolExecutor(1, "plc") as pool, closing(bridge):
            asked = pool.submit(ask)
            supervisor.serve()
    if not stop.is_set():  # the peer of a stopped demo has lost its cell
        asked.result()
    rows = [row for row in reversed(journal.runs(trials)) if row.run >= first and row.program == "insert_peg"]
    return DemoResult(reports, rows)


def _be_plc(host: str, port: int, trials: int, reports: list[Report], watch: Callable[[int, Report], None]) -> None:
    """Request one insertion after the other, as a PLC does, and reset the cell after a fault or a stop."""
    with closing(Peer(host, port)) as peer:
        peer.connect()
        peer.take()
        for number in range(trials):
            if PartPlace(peer.read_report().part) in UNRESOLVED:
                peer.run(Control.CLEARED, timeout=LONGEST)  # a person removes the last peg
            report = peer.run(
                CATALOGUE["insert_peg"].code,
                serial=f"demo-{number + 1}",
                timeout=LONGEST,
                watch=lambda seen, number=number: watch(number, seen),  # type: ignore[misc]
            )
            reports.append(report)
            watch(number + 1, report)
            if report.result in (Result.FAULT, Result.ABORTED):
                peer.run(Control.RESET, timeout=LONGEST)
        peer.release()


def draw_demo(result: DemoResult, journal: Journal, folder: Path) -> list[Path]:
    """Draw one trial, a successful one if there is one, and the chart; return the files."""
    pictures = []
    shown = next(
        (row for row in result.rows if row.outcome == Outcome.SUCCESS), result.rows[0] if result.rows else None
    )
    if shown is not None:
        plot_run(shown, read_samples(journal.samples_path(shown.run)), folder / RUN_PICTURE, {})
        pictures.append(folder / RUN_PICTURE)
    return [*pictures, draw_speed_accuracy(stage_table(result.tried())[-1], folder / CHART)]
