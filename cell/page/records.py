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
from cell.peg.ending import explained
from cell.records import wall_clock
from cell.records.alarms import Alarm
from cell.records.journal import Journal
from cell.records.run_query import RunQuery, moment
from cell.records.schema import LOST, RUNNING, RunRow, plain
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
"""Period up to now for the yield; runs that started in it count."""
ALARMS = 200
"""Largest number of alarms in one answer."""
OUTCOMES = tuple(str(each) for each in Outcome)
FILM = "film.mp4"
FILES = {"picture.png": "show", FILM: "film"}
"""Files that can be requested of a run, and the command that makes each."""
REPORT = "report.html"
"""File of the last report made for the page."""
WAITING = 8
"""Largest number of waiting requests for files; further ones are refused."""
LONGEST = 7200.0
"""Longest time to make one file, s; on a busy computer, a film of a long run takes an hour."""
GRACE = 2.0
"""Time between SIGTERM and SIGKILL for a process, s."""


class Records:
    """Reads the journal for the page, on the page's own thread."""

    def __init__(self, folder: Path) -> None:
        """Keep the folder of the records; each query opens the journal again, because it may be moved or created later."""
        self._folder = folder
        self._making, self._waiting = asyncio.Lock(), 0
        self._films: dict[int, asyncio.Task[Path | None]] = {}
        """Films in work or waiting, by run."""

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
                "files": list(FILES) if _can_be_drawn(journal, row) else [],
                "made": [name for name in FILES if self.path(run, name).is_file()],
                "is_filmed": run in self._films,
            }

    def alarms(self, since: str) -> list[dict[str, object]]:
        """Return the newest alarms since a span or a date, as the command line takes it; empty for all.

        Raises:
            ConfigError: `since` is neither a span nor a date.
            JournalError: The journal cannot be read.
        """
        with self._journal() as journal:
            found = journal.alarms(ALARMS, moment(since, wall_clock.now()) if since else "")
        return [{**asdict(alarm), "meaning": telling.meaning(alarm.code, "")} for alarm in found]

    async def report(self, since: str) -> Path | None:
        """Make the report of the runs since a span or a date, empty for all, in another process; None if that fails."""
        period = ["--since", since] if since else []
        async with self._making:
            return self.path_of_report if await self._make(["report", *period], self.path_of_report) else None

    @property
    def path_of_report(self) -> Path:
        """Path of the last report; the file may not exist."""
        return self._folder / REPORT

    def config(self, run: int) -> str | None:
        """Return the config of a run as JSON; None if it is not on record.

        Raises:
            JournalError: The run is not on record.
        """
        with self._journal() as journal:
            return journal.config(journal.find(run).config_hash)

    async def file(self, run: int, name: str) -> Path | None:
        """Return a file of a run; if it is missing, another process makes it. None if that fails.

        Files are made one at a time, at low priority, so that the scan keeps the processor.

        Raises:
            JournalError: The run is not on record.
        """
        with self._journal() as journal:
            if not _can_be_drawn(journal, journal.find(run)):
                return None
        path = self.path(run, name)
        if not path.is_file() and self._waiting < WAITING:
            self._waiting += 1
            try:
                async with self._making:
                    if not path.is_file() and name == FILM:
                        await self._make([FILES[name], str(run)], path)
                    elif not path.is_file():
                        await self._run([FILES[name], str(run)])
            finally:
                self._waiting -= 1
        return path if path.is_file() else None

    def film(self, run: int) -> Path | None:
        """Return the film of a run; if it is missing, start to make it, which takes minutes, and return None.

        Raises:
            JournalError: The run is not on record, or cannot be drawn.
        """
        with self._journal() as journal:
            if not _can_be_drawn(journal, journal.find(run)):
                raise JournalError(f"run {run}: no samples of an ended run are on record")
        path = self.path(run, FILM)
        if path.is_file():
            return path
        if run not in self._films:
            self._films[run] = asyncio.create_task(self.file(run, FILM))
            self._films[run].add_done_callback(lambda _: self._films.pop(run))
        return None

    def path(self, run: int, name: str) -> Path:
        """Return the path of a file of a run; the file may not exist."""
        return self._folder / f"run-{run:06d}{Path(name).suffix}"

    async def _make(self, command: Sequence[str], path: Path) -> bool:
        """Make a file by a command with --out; if the process is stopped, remove the partial file."""
        part = path.with_stem(f"{path.stem}-part-{os.getpid()}")  # a server before this one may still write its own
        try:
            if is_made := await self._run([*command, "--out", str(part)]):
                part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return is_made

    async def _run(self, command: Sequence[str]) -> bool:
        return await _run([*command, "--json", "--journal", str(self._folder)])

    def _journal(self) -> Journal:
        return Journal(self._folder, is_read_only=True)


def _can_be_drawn(journal: Journal, row: RunRow) -> bool:
    path = journal.samples_path(row.run)
    return row.outcome != RUNNING and path.is_file() and path.stat().st_size > 0


def shift(counts: Mapping[str, int]) -> dict[str, object]:
    """Return counts and yield of the ended runs of a shift, from the number of runs of each outcome."""
    ended = sum(counts.values()) - counts.get(RUNNING, 0)
    good = counts.get(Outcome.SUCCESS, 0)
    low, high = wilson(good, ended)
    return {
        "hours": SHIFT.total_seconds() / 3600,
        "runs": ended,
        "yield": round(good / ended, 4) if ended else None,
        "low": round(low, 4),
        "high": round(high, 4),
        "counts": {name: counts.get(name, 0) for name in (*OUTCOMES, LOST) if name != LOST or LOST in counts},
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
                await asyncio.wait_for(process.wait(), GRACE)
        if process.returncode is None:
            process.kill()
            await process.wait()
