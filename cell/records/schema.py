"""The tables of the journal as values, and the creation of an index.

| table     | one row for each                                                                         |
| --------- | ---------------------------------------------------------------------------------------- |
| `runs`    | run of a program or a skill                                                               |
| `stages`  | try of a stage in a run                                                                   |
| `events`  | change of state, command, refusal, fault, warning                                         |
| `configs` | config of runs, whole, under the digest that runs hold in `config_hash`                   |

The number of the layout is the index's `PRAGMA user_version`; `LAYOUT` is the present one.
"""

import json
import math
import sqlite3
from dataclasses import MISSING, Field, asdict, dataclass, fields
from enum import StrEnum
from typing import Any

from drivers.errors import JournalError

LAYOUT = 8
"""Number of the present layout."""
RUNNING = "running"
"""Outcome of a run that has not ended."""
LOST = "lost"
"""Outcome of a run if the program was killed, or lost power, before it closed the record."""


@dataclass(frozen=True, slots=True)
class RunRow:
    """Row of one run."""

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
    """`success`, `failure`, `aborted` or `fault`; `running` until the run ends; `lost` if the program was killed."""
    stage: str = ""
    """Stage that decided the outcome: the first that failed and was not retried, the one of a fault, else the last one."""
    reason: str = ""
    """Reason of the outcome; empty for a success, a fault and a lost run."""
    fault: int = 0
    """Fault code; 0 for none."""
    message: str = ""
    """Message of the fault, or of the closing of a lost run."""
    stage_times: str = "[]"
    """Time of each skill, JSON, list of [skill, s]."""
    versions: str = "{}"
    """Version of each package, JSON."""
    config_hash: str = ""
    """Digest of the run's config; the table `configs` holds the whole config."""
    ended: str = ""
    """Wall time of the end, ISO 8601, UTC; empty until the run ends."""
    cycle_time: float | None = None
    """Time from the command to its answer on the cell's clock, transfers included, s."""
    parameters: str = "{}"
    """Parameters that came with the command, JSON, key to value in SI units."""
    is_simulated: int = 0
    """1 if the arm was simulated, else 0."""
    seed: int | None = None
    """Seed of the simulated world's draws and of the skills' choices in this run."""
    peak_force: float | None = None
    """Largest estimated external force at the TCP, N."""
    deepest: float | None = None
    """Largest depth of the held peg's tip below the plate's surface over the area of the hole, m."""
    retries: int = 0
    """Number of tries that failed and were repeated."""
    theta: float | None = None
    """Last in-hand angle of the peg, rad."""
    sigma: float | None = None
    """Standard deviation of `theta`, rad."""
    part: str = ""
    """Place of the peg at the end of the run: a name of `plc_bridge.protocol.messages.PartPlace`, lower case."""
    samples: int = 0
    """Number of scans whose samples reached the disk."""
    length: float | None = None
    """Distance from the finger centre to the peg's end at the end of the run, m: the length of the job, corrected at the first touch-down."""
    proof: str = ""
    """Evidence that proved a seated peg: the switch, or the force of the latch; empty without success or if no proof was required."""
    part_evidence: str = ""
    """Evidence of `part`, one line."""


UNKNOWN_RUN = RunRow(0, "", "", 0, "", "", 0)
"""Row of a run without any information, for example with samples of version 0.1."""


@dataclass(frozen=True, slots=True)
class StageRow:
    """One try of a stage in a run; times on the cell's clock, since the command."""

    run: int
    place: int
    """Number of the try in the run, from 1."""
    name: str
    began: float
    """Beginning of the try, s."""
    ended: float
    """End of the try, s."""
    counted: float | None = None
    """Time counted by the skill, without the transfer to its place, s; None if the skill returned no result."""
    outcome: str = ""
    """Outcome, in the words of `RunRow.outcome`; empty if a later stage ended in a fault, because then no result is on record."""
    reason: str = ""
    retried: int = 0
    """1 if the program repeated the stage, else 0."""
    theta: float | None = None
    """In-hand angle of the peg at the end, rad; None if unknown."""
    sigma: float | None = None
    """Standard deviation of `theta`, rad."""
    residual: float | None = None
    """Share of the last taxel frame that the estimate of `theta` does not explain, 0 to 1."""
    peak_force: float | None = None
    """Largest estimated external force at the TCP, N."""
    deepest: float | None = None
    """Largest depth of the held peg's tip below the plate's surface over the area of the hole, m."""
    facts: str = "{}"
    """Fields that the skill adds to `SkillResult`, as a JSON object."""


class EventKind(StrEnum):
    """Kind of an event."""

    STATE = "state"
    """The state changed; `name` is the new one, `text` the one before, empty at the start of the cell."""
    COMMAND = "command"
    """`source` requested a program, a skill or a control; `name` is its name."""
    REFUSAL = "refusal"
    """The cell refused a command of `source`; `name` is the reason."""
    FAULT = "fault"
    """A fault, in a run or outside one; `name` and `code` are the fault's, `text` its message."""
    WARNING = "warning"
    """A warning that does not stop the cell; " is over" after its name means that it has cleared."""
    NOTE = "note"
    """A repair of the records, or a jump of the computer's clock."""
    REHEARSAL = "rehearsal"
    """`source` has requested a cable fault in a simulated cell; `name` is the fault."""


@dataclass(frozen=True, slots=True)
class EventRow:
    """One event."""

    event: int
    """Number, assigned by the index."""
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


_TYPES: dict[Any, str] = {
    int: "INTEGER NOT NULL",
    float: "REAL NOT NULL",
    str: "TEXT NOT NULL",
    int | None: "INTEGER",
    float | None: "REAL",
}
_KEYS = {
    RunRow: "run INTEGER PRIMARY KEY AUTOINCREMENT",
    EventRow: "event INTEGER PRIMARY KEY AUTOINCREMENT",
    ConfigRow: "config_hash TEXT PRIMARY KEY",
}
TABLES: dict[type, str] = {
    RunRow: "runs",
    StageRow: "stages",
    EventRow: "events",
    ConfigRow: "configs",
}
"""Name of the table of each row."""
_INDICES = (
    # The first two cover all columns that reports need, so that a report does not read the long rows.
    "CREATE INDEX runs_asked ON runs (started, program, outcome, fault, serial, recipe, stage, reason, cycle_time, peak_force)",
    "CREATE INDEX stages_asked ON stages (run, name, counted, began, ended, residual)",
    "CREATE UNIQUE INDEX stages_run ON stages (run, place)",
    "CREATE INDEX events_time ON events (time)",
    "CREATE INDEX events_run ON events (run)",
    "CREATE INDEX events_kind ON events (kind, name)",
)


def names(row: type) -> tuple[str, ...]:
    """Return the columns of a table, in the order of its row's fields."""
    return tuple(field.name for field in fields(row))


def plain(row: Any) -> dict[str, Any]:
    """Return a row as data for programs; its columns of JSON become data too."""
    # Columns with JSON.
    return {
        name: json.loads(value) if name in ("stage_times", "versions", "parameters", "facts") else value
        for name, value in asdict(row).items()
    }


def finite(value: float) -> float | None:
    """Return a value; None if it is not finite, because JSON cannot express it."""
    return value if math.isfinite(value) else None


def create(index: sqlite3.Connection) -> None:
    """Create the tables of a new index; leave an index of the present layout unchanged.

    Raises:
        JournalError: The index has another layout.
        sqlite3.Error: The index cannot be written.
    """
    if is_present(index):
        return
    with index:
        index.execute("BEGIN IMMEDIATE")
        for row, table in TABLES.items():
            index.execute(f"CREATE TABLE {table} ({', '.join(_declared(row, field) for field in fields(row))})")
        for statement in _INDICES:
            index.execute(statement)
        index.execute(f"PRAGMA user_version = {LAYOUT}")


def is_present(index: sqlite3.Connection) -> bool:
    """Return True if the index has the present layout, False for a new file.

    Raises:
        JournalError: Another version of the program has written the index.
    """
    layout = int(index.execute("PRAGMA user_version").fetchone()[0])
    is_new = layout == 0 and index.execute("SELECT count(*) FROM sqlite_master").fetchone()[0] == 0
    if layout != LAYOUT and not is_new:
        raise JournalError(
            f"layout {layout} of another version; {LAYOUT} allowed: start that version, or name another folder"
        )
    return not is_new


def _declared(row: type, field: "Field[Any]") -> str:
    """Return the SQL declaration of a column."""
    key = _KEYS.get(row, "")
    if key.split(" ")[0] == field.name:
        return key
    text = f"{field.name} {_TYPES[field.type]}"
    if field.default is not MISSING and field.default is not None:
        text += f" DEFAULT {field.default!r}"
    return text
