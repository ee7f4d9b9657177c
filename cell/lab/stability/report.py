"""Results of `cell study stability`: the map beside theory, every case as CSV, figures as JSON."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cell.config.cell_config import CellConfig
from cell.config.margins import HELD, MARGIN
from cell.config.torque_path import largest, largest_hold
from cell.lab.rows import write_rows
from cell.lab.stability.measure import QUICK, WHOLE, Boundary, Shipped, StepTrace, boundaries, measure, shipped_margins
from cell.records.provenance import config_hash, versions
from skills.catalogue import INSERT

CASES, FIGURES = "stability.csv", "stability.json"
UNITS = {"translation": "N/m", "rotation": "N·m/rad"}


@dataclass(frozen=True, slots=True)
class StabilityReport:
    """Results of the study."""

    traces: list[StepTrace]
    theory: list[Boundary]
    shipped: list[Shipped]
    data: dict[str, Any]
    """Figures as in the JSON file."""


def cases(quick: bool) -> int:
    """Return the number of cases."""
    grid = QUICK if quick else WHOLE
    return sum(2 * len(grid.periods) * len(grid.delays) * len(grid.gains[kind]) for kind in HELD)


def run(config: CellConfig, quick: bool, workers: int, done: Callable[[int], None]) -> StabilityReport:
    """Measure the map, and compare it with theory."""
    grid = QUICK if quick else WHOLE
    traces, inertia = measure(config, grid, workers, done)
    theory = boundaries(config.params(INSERT).gains, inertia, grid)
    shipped = shipped_margins(config)
    data = {
        "cases": len(traces),
        "against_theory": compare(traces, theory),
        "guard": caught(traces),
        "margin_needed": MARGIN,
        "shipped": [asdict(line) for line in shipped],
        "torque_path": {key: largest(gains, config.place()) for key, gains in config.followed().items()}
        | {"halted": largest_hold(config.place())},
        "theory": [asdict(line) for line in theory],
        "inertia": inertia.tolist(),
        "versions": versions(),
        "config_hash": config_hash(config),
        "config": config.model_dump(mode="json"),
    }
    return StabilityReport(traces, theory, shipped, data)


def write(found: StabilityReport, folder: Path) -> list[Path]:
    """Write every case as CSV and the figures as JSON, and return the files."""
    files = [folder / CASES, folder / FIGURES]
    _write_cases(found.traces, found.theory, files[0])
    files[1].write_text(json.dumps(found.data, indent=2) + "\n", encoding="utf-8")
    return files


def compare(traces: Sequence[StepTrace], theory: Sequence[Boundary]) -> dict[str, int]:
    """Count the cases in which the arm agrees with theory; the theory describes the loop without the observer."""
    counts = {"stable_below": 0, "unstable_above": 0, "stable_above": 0, "unstable_below": 0}
    for trace in traces:
        if not trace.case.observer:
            side = "below" if trace.case.gain < _limit(trace, theory) else "above"
            counts[f"{'stable' if trace.is_stable else 'unstable'}_{side}"] += 1
    return counts


def caught(traces: Sequence[StepTrace]) -> dict[str, int]:
    """Count the cases that the guard would have stopped."""
    unstable = [trace for trace in traces if not trace.is_stable]
    return {
        "unstable": len(unstable),
        "unstable_stopped": sum(trace.stopped_at is not None for trace in unstable),
        "unstable_with_observer": sum(trace.case.observer for trace in unstable),
        "stable": len(traces) - len(unstable),
        "stable_stopped": sum(trace.is_stable and trace.stopped_at is not None for trace in traces),
    }


def _limit(trace: StepTrace, theory: Sequence[Boundary]) -> float:
    case = trace.case
    return next(b.gain for b in theory if (b.kind, b.period, b.delay) == (case.kind, case.period, case.delay))


def _write_cases(traces: Sequence[StepTrace], theory: Sequence[Boundary], path: Path) -> None:
    rows = []
    for trace in traces:
        facts = asdict(trace)
        rows.append({**facts.pop("case"), "theory": _limit(trace, theory), **facts})
    write_rows(rows, path)
