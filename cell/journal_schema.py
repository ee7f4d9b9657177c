"""The tables of the journal as values, and how an index of an earlier layout becomes one of the present layout.

| table     | one row for each                                                                         |
| --------- | ---------------------------------------------------------------------------------------- |
| `runs`    | run of a program or a skill                                                               |
| `stages`  | try of a stage in a run                                                                   |
| `events`  | change of state, command, refusal, fault, warning                                         |
| `configs` | config that a run was made with, whole, under the digest that runs name in `config_hash`  |
| `told`    | run that has ended: what reports tell of it and of its stages, packed; see `journal_told`  |

The number of the layout is the index's `PRAGMA user_version`. Layout 1, of version 0.1, has the table `runs` alone and
says 0 there; `LAYOUT` is the present one.
"""

import sqlite3
from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, fields
from enum import StrEnum
from typing import Any

from drivers.errors import JournalError

LAYOUT = 7
"""Number of the present layout."""
RUNNING = "running"
"""Outcome of a run that has not ended."""
LOST = "lost"
"""Outcome of a run whose program ended, by a kill or a power failure, before the record was closed."""


@dataclass(frozen=True, slots=True)
class RunRow:
    """One run, as the index has it."""

    run: int
    started: str
    """Wall time of the start, ISO 8601, UTC."""
    program: str
    recipe: int
    serial: str
    source: str
    """Source of the command: address, node or user."""
    sequence: int
    """Sequence number of the PLC's command."""
    outcome: str = RUNNING
    """`success`, `failure`, `aborted` or `fault`; `running` until the run ends; `lost` where the program was killed."""
    stage: str = ""
    """Skill that was reached last."""
    reason: str = ""
    """Reason of the outcome, in the words of the skill; empty for a success and a fault."""
    fault: int = 0
    """Fault code; 0 for none."""
    message: str = ""
    """Message of the fault, or how a lost run was closed."""
    stage_times: str = "[]"
    """Time of each skill, JSON, list of [skill, s]."""
    versions: str = "{}"
    """Version of each package, JSON."""
    config_hash: str = ""
    """Digest of the config that the run was made with, which the table `configs` holds whole."""
    ended: str = ""
    """Wall time of the end, ISO 8601, UTC; empty while the run lasts."""
    cycle_time: float | None = None
    """Time from the command to its answer on the cell's clock, transfers included, s."""
    parameters: str = "{}"
    """Parameters that came with the command, JSON, key to value in SI units."""
    is_simulated: int = 0
    """1 where the arm was a simulated one."""
    seed: int | None = None
    """Seed of the simulated world's draws and of the skills' choices in this run."""
    peak_force: float | None = None
    """Largest estimated external force at the TCP, N."""
    deepest: float | None = None
    """Largest depth of the held peg's tip below the plate's surface over the area of the hole, m."""
    retries: int = 0
    """Number of stages that did not succeed and were tried again."""
    theta: float | None = None
    """In-hand angle of the peg when it was seen last, rad."""
    sigma: float | None = None
    """Standard deviation of `theta`, rad."""
    part: str = ""
    """Place of the peg when the run ended, in the words of `plc_bridge.messages.PartPlace`, in lower case."""
    samples: int = 0
    """Number of scans whose samples reached the disk."""
    length: float | None = None
    """Distance from the finger centre to the peg's end point that the run ended with, m: the job's, corrected by the first touch-down."""
    proof: str = ""
    """Evidence by which the success of seating the peg was proven: the switch, or the force that its latch took; empty where nothing was to prove."""
    part_evidence: str = ""
    """Evidence of `part`, one line."""


UNKNOWN_RUN = RunRow(0, "", "", 0, "", "", 0)
"""Row of a run of which nothing is known, as of one whose samples are of version 0.1."""


@dataclass(frozen=True, slots=True)
class StageRow:
    """One try of a stage in a run; times on the cell's clock, from the command on."""

    run: int
    place: int
    """Number of the try in the run, from 1."""
    name: str
    began: float
    """Beginning of the try, s."""
    ended: float
    """End of the try, s."""
    counted: float | None = None
    """Time that the skill counts as its own, without the way to its place, s; None where it never answered."""
    outcome: str = ""
    """Outcome in the words of a run's; empty where a later stage ended in a fault, which leaves the earlier ones unanswered."""
    reason: str = ""
    retried: int = 0
    """1 where the program tried again after it."""
    theta: float | None = None
    """In-hand angle of the peg at the end, rad; None where it was not known."""
    sigma: float | None = None
    """Standard deviation of `theta`, rad."""
    residual: float | None = None
    """Part of the last taxel frame that the estimate of `theta` does not explain, 0 to 1."""
    peak_force: float | None = None
    """Largest estimated external force at the TCP, N."""
    deepest: float | None = None
    """Largest depth of the held peg's tip below the plate's surface over the area of the hole, m."""
    facts: str = "{}"
    """What the skill's result says beside its end, as a JSON object: the fields that the skill adds to `SkillResult`."""


class EventKind(StrEnum):
    """Kind of an event."""

    STATE = "state"
    """The state changed; `name` is the new one, `text` the one before."""
    COMMAND = "command"
    """A program, a skill or a control was asked for by `source`; `name` is its name."""
    REFUSAL = "refusal"
    """A command of `source` was refused; `name` is why."""
    FAULT = "fault"
    """A fault, in a run or outside one; `name` and `code` are its own, `text` its message."""
    WARNING = "warning"
    """Something is not as it should be without stopping the cell; with " is over" behind its name it has gone."""
    REHEARSAL = "rehearsal"
    """Somebody, `source`, has made trouble in a simulated cell on purpose; `name` is what."""


@dataclass(frozen=True, slots=True)
class EventRow:
    """One event."""

    event: int
    """Number, counted up by the index."""
    time: str
    """Wall time, ISO 8601, UTC."""
    stamp: float
    """Time on the cell's clock, s."""
    kind: str
    """Kind of the event, an `EventKind`."""
    name: str
    code: int = 0
    """Number of the state, command, refusal or fault."""
    source: str = ""
    """Source of the command."""
    sequence: int = 0
    """Sequence number of the command."""
    run: int = 0
    """Number of the run under way; 0 for none."""
    text: str = ""


@dataclass(frozen=True, slots=True)
class ConfigRow:
    """One config, whole."""

    config_hash: str
    config: str
    """The config as JSON."""


@dataclass(frozen=True, slots=True)
class ToldRow:
    """Figures that reports tell of one run that has ended, so that a report of hundred thousand runs reads a narrow table."""

    run: int
    kind: str
    """How it ended and which stages it had, as `journal_told` writes it: one text for all runs of which the same is told."""
    figures: bytes
    """Figures as `journal_told` packs them."""


_TYPES: dict[Any, str] = {
    int: "INTEGER NOT NULL",
    float: "REAL NOT NULL",
    str: "TEXT NOT NULL",
    bytes: "BLOB NOT NULL",
    int | None: "INTEGER",
    float | None: "REAL",
}
_KEYS = {
    RunRow: "run INTEGER PRIMARY KEY AUTOINCREMENT",
    EventRow: "event INTEGER PRIMARY KEY AUTOINCREMENT",
    ConfigRow: "config_hash TEXT PRIMARY KEY",
    ToldRow: "run INTEGER PRIMARY KEY",
}
TABLES: dict[type, str] = {
    RunRow: "runs",
    StageRow: "stages",
    EventRow: "events",
    ConfigRow: "configs",
    ToldRow: "told",
}
"""Name of the table of each row."""
_INDICES = (
    "DROP INDEX IF EXISTS runs_started",
    # All that questions ask and reports tell of a run, so that neither reads the long rows themselves.
    "CREATE INDEX IF NOT EXISTS runs_asked ON runs (started, program, outcome, fault, serial, recipe, stage, reason)",
    "CREATE UNIQUE INDEX IF NOT EXISTS stages_run ON stages (run, place)",
    "CREATE INDEX IF NOT EXISTS events_time ON events (time)",
    "CREATE INDEX IF NOT EXISTS events_run ON events (run)",
)


def names(row: type) -> tuple[str, ...]:
    """Return the columns of a table, in the order of its row's fields."""
    return tuple(field.name for field in fields(row))


def migrate(index: sqlite3.Connection, fill: Callable[[sqlite3.Connection], None]) -> None:
    """Give the index the tables and columns of the present layout, and let `fill` fill what is new; what is in it stays.

    Raises:
        JournalError: A newer version of the program has made it.
        sqlite3.Error: It cannot be written.
    """
    if require_known_layout(index) == LAYOUT:
        return
    index.execute("BEGIN IMMEDIATE")
    try:
        for row in TABLES:
            _bring_up(index, row)
        for statement in _INDICES:
            index.execute(statement)
        fill(index)
        index.execute(f"PRAGMA user_version = {LAYOUT}")
        index.execute("COMMIT")
    except sqlite3.Error:
        index.execute("ROLLBACK")
        raise


def require_known_layout(index: sqlite3.Connection) -> int:
    """Return the number of the index's layout, 0 for a new file and for layout 1.

    Raises:
        JournalError: A newer version of the program has made it.
    """
    layout = int(index.execute("PRAGMA user_version").fetchone()[0])
    if layout > LAYOUT:
        raise JournalError(
            f"layout {layout} of a newer version; 1 to {LAYOUT} allowed: start that version, or name another folder"
        )
    return layout


def present(index: sqlite3.Connection, row: type) -> set[str]:
    """Return the columns that the index has of a table; none where it has no such table."""
    return {str(column[1]) for column in index.execute(f"PRAGMA table_info({TABLES[row]})")}


def _bring_up(index: sqlite3.Connection, row: type) -> None:
    """Make the table of a row, or add the columns that it lacks."""
    has = present(index, row)
    if not has:
        declared = [_declared(row, field) for field in fields(row)]
        index.execute(f"CREATE TABLE {TABLES[row]} ({', '.join(declared)})")
        return
    for field in fields(row):
        if field.name not in has:
            index.execute(f"ALTER TABLE {TABLES[row]} ADD COLUMN {_declared(row, field)}")


def _declared(row: type, field: "Field[Any]") -> str:
    """Return a column as SQL declares it."""
    key = _KEYS.get(row, "")
    if key.split(" ")[0] == field.name:
        return key
    text = f"{field.name} {_TYPES[field.type]}"
    if field.default is not MISSING and field.default is not None:
        text += f" DEFAULT {field.default!r}"
    return text
