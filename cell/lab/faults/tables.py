"""Table of the campaign; nothing is printed here."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rich.table import Table

from cell.lab.faults.bench import REST_LIMIT
from cell.lab.faults.cases import FaultCase
from cell.lab.faults.kinds import KINDS
from cell.lab.tables import listed

REST_AFTER_LIMIT, FORCE_SHARE = 1.0, 1.2
"""Longest time from the fault to rest, s, and largest permitted force, share of the force limit."""
NEVER = ("wrong successes", "no record", "over force", "not back")
"""Columns that must be zero on any computer. The reader of the table judges the other columns: a busy computer can delay
the moment of rest, and a falling peg changes its position."""
HARMLESS = frozenset(kind.name for kind in KINDS if kind.is_harmless)
SLOW = frozenset(kind.name for kind in KINDS if kind.slow)


def lines(rows: Sequence[FaultCase], force_limit: float) -> list[dict[str, Any]]:
    """Return one line for each kind and one for all; the columns of `NEVER` must be zero."""
    kinds = list(dict.fromkeys(row.kind for row in rows))
    return [_line(kind, [row for row in rows if row.kind == kind], force_limit) for kind in kinds] + [
        _line("all", rows, force_limit)
    ]


LARGEST: Mapping[str, Callable[[FaultCase], float]] = {
    "detection": lambda row: row.detection,
    "rest": lambda row: row.rest,
    "rest_after": lambda row: row.rest_after,
    "creep": lambda row: 1e3 * row.creep,
    "force": lambda row: row.peak_force,
    "contact": lambda row: row.contact_force,
    "cycle": lambda row: 1e3 * row.cycle,
}
"""Columns with the largest value of a kind's cases."""
COUNTED: Mapping[str, Callable[[FaultCase, float], bool]] = {
    "wrong successes": lambda row, force_limit: row.wrong_success,
    "late rest": lambda row, force_limit: row.rest > REST_LIMIT,
    "late after": lambda row, force_limit: row.rest_after > REST_AFTER_LIMIT and row.kind not in SLOW,
    "over force": lambda row, force_limit: max(row.peak_force, row.contact_force) > FORCE_SHARE * force_limit,
    "disturbed": lambda row, force_limit: row.outcome in ("fault", "aborted") and row.kind in HARMLESS,
    "part untrue": lambda row, force_limit: row.part_untrue,
    "part unknown": lambda row, force_limit: row.part == "unknown",
    "no record": lambda row, force_limit: not row.record,
    "not back": lambda row, force_limit: not row.is_back,
}
"""Columns with a number of faulty cases, by name; the function returns True for such a case, and takes the force limit, N."""


def _line(kind: str, rows: Sequence[FaultCase], force_limit: float) -> dict[str, Any]:
    rows = [row for row in rows if row.outcome != "not reached"]
    faults = Counter(row.fault for row in rows if row.fault)
    return {
        "kind": kind,
        "n": len(rows),
        "success": sum(row.outcome == "success" for row in rows),
        "codes": " ".join(str(code) for code, _ in faults.most_common(3)),
        **{name: max(filter(math.isfinite, map(of, rows)), default=math.nan) for name, of in LARGEST.items()},
        **{name: sum(is_counted(row, force_limit) for row in rows) for name, is_counted in COUNTED.items()},
    }


def shown(found: Sequence[Mapping[str, Any]]) -> Table:
    """Return lines as a table."""
    caption = "largest times in s from fault to report, from report to rest, from fault to rest; largest displacement of the hand later than 0.3 s after the report, mm; largest force at the tool by the arm and of the plates on the peg in truth, N; p99 of the PLC's cycles during a fault from outside, ms; the last nine columns count cases and should be 0, except that the place of a peg at the hole is unknown while the arm does not measure"
    return listed("Faults by kind", list(found[0]), (list(map(_text, line.values())) for line in found), caption)


def _text(value: object) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.2f}"
    return str(value)
