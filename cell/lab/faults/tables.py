"""Table of the campaign; nothing is printed here."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from cell.lab.faults.bench import REST_LIMIT
from cell.lab.faults.cases import FaultCase
from cell.lab.faults.kinds import KINDS

REST_AFTER_LIMIT, FORCE_SHARE = 1.0, 1.2
"""Longest time to rest after the fault, s, and largest share of the force limit."""
NEVER = ("wrong successes", "no record", "over force", "not back")
"""Columns that must be zero on any computer. The reader of the table judges the moment of rest on a busy computer, and
the position of a falling peg."""
HARMLESS = frozenset(kind.name for kind in KINDS if kind.is_harmless)
SLOW = frozenset(kind.name for kind in KINDS if kind.slow)


def lines(rows: Sequence[FaultCase], force_limit: float) -> list[dict[str, Any]]:
    """Return one line for each kind and one for all; the columns from `wrong successes` on must be zero."""
    kinds = list(dict.fromkeys(row.kind for row in rows))
    return [_line(kind, [row for row in rows if row.kind == kind], force_limit) for kind in kinds] + [
        _line("all", rows, force_limit)
    ]


def _line(kind: str, rows: Sequence[FaultCase], force_limit: float) -> dict[str, Any]:
    rows = [row for row in rows if row.outcome != "not reached"]
    faults = Counter(row.fault for row in rows if row.fault)
    return {
        "kind": kind,
        "n": len(rows),
        "success": sum(row.outcome == "success" for row in rows),
        "codes": " ".join(str(code) for code, _ in faults.most_common(3)),
        "detection": _largest([row.detection for row in rows]),
        "rest": _largest([row.rest for row in rows]),
        "rest_after": _largest([row.rest_after for row in rows]),
        "creep": 1e3 * _largest([row.creep for row in rows]),
        "force": _largest([row.peak_force for row in rows]),
        "contact": _largest([row.contact_force for row in rows]),
        "cycle": 1e3 * _largest([row.cycle for row in rows]),
        "wrong successes": sum(row.wrong_success for row in rows),
        "late rest": sum(row.rest > REST_LIMIT for row in rows),
        "late after": sum(row.rest_after > REST_AFTER_LIMIT for row in rows if row.kind not in SLOW),
        "over force": sum(max(row.peak_force, row.contact_force) > FORCE_SHARE * force_limit for row in rows),
        "disturbed": sum(row.outcome in ("fault", "aborted") for row in rows if row.kind in HARMLESS),
        "part untrue": sum(row.part_untrue for row in rows),
        "part unknown": sum(row.part == "unknown" for row in rows),
        "no record": sum(not row.record for row in rows),
        "not back": sum(not row.is_back for row in rows),
    }


def table(rows: Sequence[FaultCase], force_limit: float) -> Table:
    """Return the lines as a table."""
    found = lines(rows, force_limit)
    shown = Table(
        title="Faults by kind",
        caption="largest times in s from fault to report, from report to rest, from fault to rest; farthest way of the hand later than 0.3 s after the report, mm; largest force at the tool by the arm and of the plates on the peg in truth, N; p99 of the PLC's cycles during a fault from outside, ms; the last nine columns count cases and should be 0",
    )
    for name in found[0]:
        shown.add_column(name, justify="left" if name in ("kind", "codes") else "right")
    for line in found:
        shown.add_row(*(_text(value) for value in line.values()))
    return shown


def _largest(values: Sequence[float]) -> float:
    return max((value for value in values if math.isfinite(value)), default=math.nan)


def _text(value: object) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.2f}"
    return str(value)
