"""Records of runs for the page: the last runs, the yield, and files of a run made by other commands."""

import asyncio
import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from datetime import timedelta
from pathlib import Path

from cell.page import telling
from cell.page.scene import replay
from cell.peg.ending import explained
from cell.records import wall_clock
from cell.records.alarms import Alarm
from cell.records.journal import Journal
from cell.records.run_query import RunQuery, moment
from cell.records.schema import RUNNING, RunRow, plain
from cell.records.statistics import wilson
from cell.run.line import PROGRAMS
from drivers.errors import JournalError
from plc_bridge.protocol.messages import FIRST_PROGRAM
from skills.contract import Outcome

LAST = 12
"""Number of runs listed on the page."""
PRODUCT = PROGRAMS[FIRST_PROGRAM]
"""Program whose runs count for the yield."""
SHIFT = timedelta(hours=8)
"""Period before the present time; the yield counts the runs that started in this period."""
ALARMS = 200
"""Largest number of alarms in one answer."""
REPORT = "report.html"
"""File of the last report made for the page."""
WAITING = 8
"""Largest number of waiting requests for films; further ones are refused."""
LONGEST = 7200.0
"""Longest time to draw one film, s; on a busy computer, a film of a long run takes an hour."""


class Records:
    """Reads the journal for the page, on the page's own thread."""

    def __init__(self, folder: Path) -> None:
        """Keep the folder of the records; each query opens the journal again, because it may be moved or created later."""
        self._folder = folder
        self.path_of_report = folder / REPORT
        """Path of the last report; the file may not exist."""
        self._reading, self._making = asyncio.Lock(), asyncio.Lock()
        self._films: dict[int, asyncio.Task[None]] = {}
        """Tasks of films that are being drawn or wait, by run."""

    def summary(self) -> dict[str, object]:
        """Return the last runs, the last alarm, and the yield of the shift; empty lists if the journal cannot be read."""
        rows: list[RunRow] = []
        alarms: list[Alarm] = []
        counts: dict[str, int] = {}
        since = wall_clock.now() - SHIFT
        with suppress(JournalError, TypeError, ValueError), self._journal() as journal:
            rows, alarms = journal.runs(LAST), journal.alarms(1)
            counts = journal.outcomes(RunQuery(since.isoformat(timespec="milliseconds"), program=PRODUCT))
        return {
            "runs": [telling.row(row) for row in rows],
            "alarm": [asdict(alarm) for alarm in alarms],
            "shift": shift(counts),
        }

    def whole(self, run: int) -> dict[str, object]:
        """Return the whole record of one run except its config.

        Raises:
            JournalError: The run is not on record.
        """
        with self._journal() as journal:
            row = journal.find(run)
            why = explained(row.fault, row.reason)
            return {
                **plain(row),
                "why": why and asdict(why),
                "stages": [plain(stage) for stage in journal.stages(run)],
                "events": [asdict(event) for event in journal.events(run=run)],
                "film": self._film_state(run, _can_be_drawn(journal, row)),
            }

    def alarms(self, since: str) -> list[dict[str, object]]:
        """Return the newest alarms since a span or a date, in the format of the command line; an empty text means all.

        Raises:
            ConfigError: `since` is neither a span nor a date.
            JournalError: The journal cannot be read.
        """
        with self._journal() as journal:
            found = journal.alarms(ALARMS, moment(since, wall_clock.now()) if since else "")
        return [{**asdict(alarm), "meaning": telling.meaning(alarm.code, "")} for alarm in found]

    async def report(self, since: str) -> Path | None:
        """Make the report of the runs since a span or a date in another process, and return its path; None if that fails.

        An empty `since` means all runs.
        """
        period = ["--since", since] if since else []
        async with self._making:
            return self.path_of_report if await self._make(["report", *period], self.path_of_report) else None

    def config(self, run: int) -> str | None:
        """Return the config of a run as JSON; None if it is not on record.

        Raises:
            JournalError: The run is not on record.
        """
        with self._journal() as journal:
            return journal.config(journal.find(run).config_hash)

    async def replay(self, run: int) -> bytes:
        """Return the samples of a run for its replay; one run is read at a time, so that readers share one core.

        Raises:
            JournalError: The run is not on record, or has no samples that can be drawn.
        """
        with self._journal() as journal:
            path = journal.samples_path(journal.find(run).run)
        async with self._reading:
            return await asyncio.to_thread(replay, path)

    def film(self, run: int) -> Path | None:
        """Return the film of a run; if it is missing, start to draw it, which takes minutes, and return None.

        Films are drawn by another process, one at a time, at low priority, so that the scan keeps the processor.

        Raises:
            JournalError: The run is not on record, or cannot be drawn.
        """
        with self._journal() as journal:
            if not _can_be_drawn(journal, journal.find(run)):
                raise JournalError(f"run {run}: no samples of an ended run are on record")
        path = self.film_path(run)
        if path.is_file():
            return path
        if run not in self._films and len(self._films) < WAITING:
            self._films[run] = asyncio.create_task(self._draw(run))
            self._films[run].add_done_callback(lambda _: self._films.pop(run))
        return None

    def film_path(self, run: int) -> Path:
        """Return the path of a run's film; the file may not exist."""
        return self._folder / f"run-{run:06d}.mp4"

    def _film_state(self, run: int, can_be_drawn: bool) -> str:
        if self.film_path(run).is_file():
            return "made"
        return "drawing" if run in self._films else "missing" if can_be_drawn else "none"

    async def _draw(self, run: int) -> None:
        async with self._making:
            await self._make(["film", str(run)], self.film_path(run))

    async def _make(self, command: Sequence[str], path: Path) -> bool:
        """Make a file by a command with --out; if the process is stopped, remove the partial file."""
        part = path.with_stem(f"{path.stem}-part-{os.getpid()}")  # an earlier server may still write its own part
        try:
            if is_made := await _run([*command, "--json", "--journal", str(self._folder), "--out", str(part)]):
                part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return is_made

    def _journal(self) -> Journal:
        return Journal(self._folder, is_read_only=True)


def _can_be_drawn(journal: Journal, row: RunRow) -> bool:
    path = journal.samples_path(row.run)
    return row.outcome != RUNNING and path.is_file() and path.stat().st_size > 0


def shift(counts: Mapping[str, int]) -> dict[str, object]:
    """Return counts and yield of the ended runs of a shift, from the number of runs of each outcome."""
    counts = {name: number for name, number in counts.items() if name != RUNNING}
    ended = sum(counts.values())
    good = counts.get(Outcome.SUCCESS, 0)
    low, high = wilson(good, ended)
    return {
        "hours": SHIFT.total_seconds() / 3600,
        "runs": ended,
        "yield": round(good / ended, 4) if ended else None,
        "low": round(low, 4),
        "high": round(high, 4),
        "counts": dict.fromkeys(map(str, Outcome), 0) | counts,
    }


async def _run(arguments: Sequence[str]) -> bool:
    """Run a command of this program to its end, at low priority; return True if it succeeded."""
    nice = ["nice", "-n", "15"] if shutil.which("nice") else []
    process = await asyncio.create_subprocess_exec(
        *nice,
        sys.executable,
        "-P",
        "-m",
        "cell",
        *arguments,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        return await asyncio.wait_for(process.wait(), LONGEST) == 0
    except TimeoutError:
        return False
    finally:
        if process.returncode is None:  # timed out, or the server ends
            process.terminate()  # so that it removes its partial file
            with suppress(TimeoutError):
                # Time between SIGTERM and SIGKILL, s.
                await asyncio.wait_for(process.wait(), 2.0)
        if process.returncode is None:
            process.kill()
            await process.wait()
