"""Faults of the cell's computer: disk, clock, and processor time."""

import os
import resource
import shutil
import sqlite3
import time
from contextlib import suppress
from datetime import timedelta
from functools import partial
from pathlib import Path

from cell.lab.faults.bench import FaultBench
from cell.lab.faults.contract import FaultKind, Undo, changed
from cell.records import wall_clock
from cell.records.journal import INDEX

STEPPED = timedelta(hours=1)
"""Step of the computer's clock, backward or forward."""
NOBODY = 65534
"""User who can write only their own files."""
HELD_UP = 0.5
"""Duration of a scan delay, s of wall time."""


def _full(bench: FaultBench) -> Undo:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _read_only(bench: FaultBench) -> Undo:
    """Make the journal's folder read-only; open files stay writable, as after a remount of the disk."""
    user, folder = os.geteuid(), bench.journal.folder
    modes = {path: path.stat().st_mode for path in (folder, *folder.iterdir())}
    for path, mode in modes.items():
        path.chmod(mode & 0o555 | (0o055 if path.is_dir() else 0o044))
    if user == 0:  # file modes do not restrict root
        os.seteuid(NOBODY)

    def undo() -> None:
        os.seteuid(user)
        for path, mode in modes.items():
            if path.exists():
                path.chmod(mode)

    return undo


def _locked(bench: FaultBench) -> Undo:
    index = sqlite3.connect(bench.journal.folder / INDEX, isolation_level=None, timeout=10.0, check_same_thread=False)
    index.execute("BEGIN IMMEDIATE")
    return index.close


def _deleted(bench: FaultBench) -> None:
    for file in bench.journal.folder.glob(f"{INDEX}*"):
        file.unlink(missing_ok=True)


def _torn(bench: FaultBench) -> None:
    index = bench.journal.folder / INDEX
    index.write_bytes(b"\xff" * index.stat().st_size)


def _folder_gone(bench: FaultBench) -> Undo:
    folder = bench.journal.folder
    away = folder.with_name(f"{folder.name}-away")
    folder.rename(away)

    return lambda: _put_back(away, folder)


def _put_back(away: Path, folder: Path) -> None:
    """Restore the folder as a remounted disk does: files that the cell created in its place disappear."""
    meanwhile = folder.with_name(f"{folder.name}-meanwhile")
    while away.exists():
        with suppress(OSError):  # the cell can create the folder again between the two calls
            if folder.exists():
                folder.rename(meanwhile)
            away.rename(folder)
        shutil.rmtree(meanwhile, ignore_errors=True)


def _clock_stepped(step: timedelta, bench: FaultBench) -> Undo:
    now = wall_clock.now
    return changed(wall_clock, "now", lambda: now() + step)


COMPUTER_KINDS: tuple[FaultKind, ...] = (
    FaultKind("disk: full", _full, is_harmless=True),
    FaultKind("disk: read-only", _read_only, is_harmless=True),
    FaultKind("disk: index locked", _locked, is_harmless=True),
    FaultKind("disk: index deleted", _deleted, is_harmless=True),
    FaultKind("disk: index torn", _torn, is_harmless=True),
    FaultKind("disk: folder gone", _folder_gone, is_harmless=True, is_record_apart=True),
    FaultKind("clock: put back an hour", partial(_clock_stepped, -STEPPED), is_harmless=True),
    FaultKind("clock: put on an hour", partial(_clock_stepped, STEPPED), is_harmless=True),
    FaultKind("program: held up", lambda bench: time.sleep(HELD_UP), is_harmless=True),
    FaultKind("program: asked to end", lambda bench: bench.stop.set(), status=0),
)
"""All kinds of computer faults."""
