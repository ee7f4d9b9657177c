"""Upkeep of a journal before and between runs: close lost runs, rebuild a damaged index, delete old records."""

import json
import logging
import re
from collections.abc import Collection
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

from cell.config.cell_config import JournalConfig
from cell.records import wall_clock
from cell.records.index import INDEX, DamagedIndexError, Index, samples_path
from cell.records.samples import read_rows, read_samples
from cell.records.schema import LOST, UNKNOWN_RUN, EventKind, EventRow, RunRow, StageRow
from drivers.errors import JournalError
from skills.catalogue import CATALOGUE

logger = logging.getLogger(__name__)

_SAMPLES = re.compile(r"run-(\d{6,15})\.arrows", re.ASCII)


def sampled_runs(folder: Path) -> dict[int, Path]:
    """Return the files of samples in a folder, by run number."""
    found = ((_SAMPLES.fullmatch(path.name), path) for path in folder.iterdir())
    return {int(match[1]): path for match, path in found if match is not None}


def next_number(index: Index, folder: Path) -> int:
    """Return the run number after the highest one in use."""
    given = index.execute("SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name = 'runs'")[0][0]
    return 1 + max(int(given), *sampled_runs(folder), 0)


def opened_to_write(folder: Path) -> Index:
    """Return the index; if it is damaged, set it aside and return an empty one, for `close_lost_runs` to fill.

    Raises:
        JournalError: The journal cannot be used.
    """
    try:
        index = Index(folder, is_read_only=False)
        ((state,),) = index.execute("PRAGMA quick_check(1)")
        if state == "ok":
            return index
        index.close()
    except DamagedIndexError as error:
        state = str(error)
    return made_again(folder, state)


def made_again(folder: Path, why: str) -> Index:
    """Set a damaged index aside and return an empty one; `close_lost_runs` restores its runs from the samples.

    Raises:
        JournalError: The folder cannot be written.
    """
    stamp = wall_clock.now().strftime("%Y%m%dT%H%M%S%f")
    aside = folder / f"{INDEX}.damaged-{stamp}"
    try:
        (folder / INDEX).replace(aside)
        for suffix in ("-wal", "-shm"):
            with suppress(FileNotFoundError):
                (folder / f"{INDEX}{suffix}").replace(f"{aside}{suffix}")
    except OSError as error:
        raise JournalError(f"{folder / INDEX}: damaged, and cannot be put aside: {error}") from None
    index = Index(folder, is_read_only=False)
    text = f"{why}; kept as {aside.name}; its runs are restored from their samples"
    index.put(event("index_damaged", text))
    logger.warning("%s: damaged: %s", folder / INDEX, text)
    return index


def close_lost_runs(index: Index, folder: Path, under_way: Collection[int] = ()) -> None:
    """Close the record of every run that a killed program left open, and restore runs that the index lacks.

    Runs `under_way` in this program stay unchanged.
    """
    lost = [row for row in index.rows(RunRow, "WHERE outcome = 'running'") if row.run not in under_way]
    known = {int(run) for (run,) in index.execute("SELECT run FROM runs")} | set(under_way)
    unlisted = {run: path for run, path in sampled_runs(folder).items() if run not in known}
    with index.at_once():
        for row in lost:
            _restore(index, row.run, samples_path(folder, row.run), row)
        for run, path in sorted(unlisted.items()):
            # The file reserved for the next run is empty until that run begins.
            if path.stat().st_size:
                _restore(index, run, path)
            elif not under_way:
                # The number was reserved, and a PLC may have read it; it must not be used again.
                path.unlink()
                _count_up_to(index, run)


def delete_old(index: Index, folder: Path, keep: JournalConfig) -> None:
    """Delete the records beyond the limits.

    The age of a record is the sum of the time steps from each record to the next, beginning with this record and ending
    at the present time. A step backward, or longer than `keep.days`, counts as 0, because the clock was wrong or the cell
    was off. If a wrong clock is ahead by less than `keep.days`, its error counts as age.
    """
    if keep.days > 0:
        _delete_aged(index, folder, keep.days)
    if keep.bytes > 0:
        _delete_beyond_size(index, folder, keep.bytes)


def warn_of_clock(index: Index, folder: Path, keep: JournalConfig) -> None:
    """Record a warning if the clock is more than `keep.days` ahead of the newest run, so that this time ages no record."""
    newest = _newest(index)
    if not keep.days or newest is None or wall_clock.now() - newest <= timedelta(days=keep.days):
        return
    text = (
        f"computer's clock {(wall_clock.now() - newest) / timedelta(days=1):.1f} days ahead of the newest run, at most {keep.days} (journal.days)"
        " accepted: records do not age by this time; set the clock if it is wrong"
    )
    index.put(event("clock_ahead", text))
    logger.warning("%s: %s", folder / INDEX, text)


def _newest(index: Index) -> datetime | None:
    """Return the start time of the run with the highest number; None if no run has a valid one."""
    where = "WHERE outcome != 'running' AND started != '' ORDER BY run DESC LIMIT 1"
    for (started,) in index.execute(f"SELECT started FROM runs {where}"):
        with suppress(ValueError):
            found = datetime.fromisoformat(started)
            return found if found.tzinfo else found.replace(tzinfo=UTC)
    return None


def _last_aged(index: Index, table: str, key: str, time: str, days: int) -> int:
    """Return the number of the newest record of a table that is older than `days`; 0 if there is none."""
    steps = f"julianday(lead({time}, 1, ?) OVER (ORDER BY {key})) - julianday({time})"
    found = index.execute(
        f"WITH steps AS (SELECT {key}, {steps} AS step FROM {table} WHERE {time} != ''), ages AS (SELECT {key},"
        f" sum(CASE WHEN step BETWEEN 0 AND ? THEN step ELSE 0 END) OVER (ORDER BY {key} DESC) AS age FROM steps)"
        f" SELECT coalesce(max({key}), 0) FROM ages WHERE age > ?",
        [wall_clock.now_text(), days, days],
    )
    return int(found[0][0])


def _delete_aged(index: Index, folder: Path, days: int) -> None:
    """Delete the runs and events older than `days`."""
    with index.at_once():
        where = "outcome != 'running' AND run <= ?"
        last: list[object] = [_last_aged(index, "runs", "run", "started", days)]
        old = [int(run) for (run,) in index.execute(f"SELECT run FROM runs WHERE {where}", last)]
        index.execute(f"DELETE FROM stages WHERE run IN (SELECT run FROM runs WHERE {where})", last)
        index.execute(f"DELETE FROM runs WHERE {where}", last)
        index.execute("DELETE FROM events WHERE event <= ?", [_last_aged(index, "events", "event", "time", days)])
        index.execute("DELETE FROM configs WHERE config_hash NOT IN (SELECT config_hash FROM runs)")
    files = sampled_runs(folder)
    for run in old:
        files.get(run, folder / "none").unlink(missing_ok=True)


def _delete_beyond_size(index: Index, folder: Path, most: int) -> None:
    """Delete the oldest samples until their total size is at most `most`, bytes."""
    files = sampled_runs(folder)
    sizes = {run: path.stat().st_size for run, path in files.items()}
    open_runs = {int(run) for (run,) in index.execute("SELECT run FROM runs WHERE outcome = 'running'")}
    excess = sum(sizes.values()) - most
    for run in sorted(sizes.keys() - open_runs):
        if excess <= 0:
            break
        files[run].unlink(missing_ok=True)
        excess -= sizes[run]


def event(name: str, text: str, run: int = 0) -> EventRow:
    """Return an event of the journal itself; its time on the cell's clock is 0."""
    return EventRow(0, wall_clock.now_text(), 0.0, EventKind.NOTE, name, run=run, text=text)


def ending_text(row: RunRow, stages: list[StageRow]) -> str:
    """Return the end of a run as JSON, for its last block of samples."""
    return json.dumps({"run": asdict(row), "stages": [asdict(stage) for stage in stages]})


def beginning_text(row: RunRow) -> str:
    """Return the start of a run as JSON, for the head of its samples."""
    return json.dumps(asdict(row))


def _restore(index: Index, run: int, path: Path, row: RunRow = UNKNOWN_RUN) -> None:
    """Record a run from its samples: with its recorded end, or as lost."""
    ended, stages = _as_recorded(run, path, row)
    index.put_ended(ended, stages)
    if ended.outcome == LOST:
        index.put(event("run_lost", ended.message, run))
        logger.warning("run %d: %s", run, ended.message)


def _as_recorded(run: int, path: Path, row: RunRow) -> tuple[RunRow, list[StageRow]]:
    """Return the row and the stages of a run from its samples; if the record is damaged, the run is lost."""
    beginning, ending = b"", b""
    with suppress(JournalError):
        beginning, ending = read_rows(path)
    with suppress(ValidationError):
        whole = TypeAdapter(_Ending).validate_json(ending)
        return replace(whole.run, run=run), whole.stages
    with suppress(ValidationError):
        row = TypeAdapter(RunRow).validate_json(beginning) if row is UNKNOWN_RUN else row
    return _lost(replace(row, run=run), path), []


@dataclass(frozen=True, slots=True)
class _Ending:
    """End of a run, as stored in its last block of samples."""

    run: RunRow
    stages: list[StageRow]


def _lost(row: RunRow, path: Path) -> RunRow:
    """Return the row of a run whose record was never closed, completed from its samples."""
    try:
        samples = read_samples(path)
        ended = datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="milliseconds")
    except (JournalError, OSError, OverflowError, ValueError):
        samples, ended = {"stamp": np.empty(0)}, row.started
    stamps = samples["stamp"]
    kept = f"samples of {stamps[-1] - stamps[0]:.2f} s are on record" if stamps.size else "no samples"
    message = f"its end was not recorded, for example because the program was killed or the disk was full; {kept}"
    row = replace(row, outcome=LOST, ended=ended, message=message)
    if not stamps.size:
        return row
    with np.errstate(over="ignore", invalid="ignore"):
        force = np.hypot(np.hypot(samples["force_x"], samples["force_y"]), samples["force_z"])
    return replace(
        row,
        started=row.started or ended,
        stage=CATALOGUE.stages.get(samples["stage"][-1], ""),
        peak_force=float(np.max(force)),
        samples=stamps.size,
    )


def _count_up_to(index: Index, run: int) -> None:
    """Reserve all numbers up to `run`, so that the index does not assign them again."""
    index.execute("UPDATE sqlite_sequence SET seq = max(seq, ?) WHERE name = 'runs'", [run])
    index.execute(
        "INSERT INTO sqlite_sequence (name, seq) SELECT 'runs', ? WHERE NOT EXISTS"
        " (SELECT 1 FROM sqlite_sequence WHERE name = 'runs')",
        [run],
    )
