"""What `cell study stability` leaves behind: every case as CSV, figures as JSON, two charts, and a table of the margins."""

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from cell.config import CellConfig
from cell.journal import config_hash, versions
from cell.lab.stability import QUICK, WHOLE, Boundary, Shipped, Trace, boundaries, measure, shipped_margins
from cell.lab.stability_chart import UNITS, draw_map
from cell.margins import HELD, MARGIN
from skills.catalogue import INSERT

CASES, FIGURES = "stability.csv", "stability.json"
NAMED = ("mujoco", "numpy", "numba", "code")
"""Versions that stand on a chart."""


@dataclass(frozen=True, slots=True)
class Report:
    """What came out."""

    shipped: list[Shipped]
    data: dict[str, Any]
    """As in the JSON file."""
    files: list[Path]


def cases(quick: bool) -> int:
    """Return how many cases there are."""
    grid = QUICK if quick else WHOLE
    return sum(2 * len(grid.periods) * len(grid.delays) * len(grid.gains[kind]) for kind in HELD)


def run(config: CellConfig, quick: bool, workers: int, folder: Path, done: Callable[[int], None]) -> Report:
    """Measure the map, compare it with theory, and write everything to `folder`."""
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
        "theory": [asdict(line) for line in theory],
        "inertia": inertia.tolist(),
        "versions": versions(),
        "config_hash": config_hash(config),
        "config": config.model_dump(mode="json"),
    }
    files = [folder / CASES, folder / FIGURES, *(folder / f"stability_{kind}.png" for kind in HELD)]
    _write_cases(traces, theory, files[0])
    files[1].write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    named = ", ".join(f"{name} {versions()[name]}" for name in NAMED)
    for kind, path in zip(HELD, files[2:], strict=True):
        draw_map(kind, traces, theory, shipped, named, path)
    return Report(shipped, data, files)


def compare(traces: Sequence[Trace], theory: Sequence[Boundary]) -> dict[str, int]:
    """Count how the arm agrees with theory, which is about the loop without the observer."""
    counts = {"stable_below": 0, "unstable_above": 0, "stable_above": 0, "unstable_below": 0}
    for trace in traces:
        if not trace.case.observer:
            side = "below" if trace.case.gain < _limit(trace, theory) else "above"
            counts[f"{'stable' if trace.is_stable else 'unstable'}_{side}"] += 1
    return counts


def caught(traces: Sequence[Trace]) -> dict[str, int]:
    """Count what the guard would have stopped."""
    unstable = [trace for trace in traces if not trace.is_stable]
    return {
        "unstable": len(unstable),
        "unstable_stopped": sum(trace.stopped_at is not None for trace in unstable),
        "unstable_with_observer": sum(trace.case.observer for trace in unstable),
        "stable": len(traces) - len(unstable),
        "stable_stopped": sum(trace.is_stable and trace.stopped_at is not None for trace in traces),
    }


def table(report: Report) -> Table:
    """Return the margins as the terminal shows them."""
    found = Table(title="Gains that the skin steers, against the boundary of theory")
    for name in ("skill", "gain", "value", "unstable from", "margin"):
        found.add_column(name, justify="left" if name in ("skill", "gain") else "right")
    for line in report.shipped:
        unit = UNITS[line.kind]
        found.add_row(
            line.skill, line.kind, f"{line.gain:g} {unit}", f"{line.limit:.4g} {unit}", f"{line.margin:.2f} times"
        )
    arm, guard = report.data["against_theory"], report.data["guard"]
    found.caption = (
        f"margin needed {MARGIN:g}; n = {report.data['cases']}. Observer off: {arm['stable_below']} stable below the boundary"
        f" and {arm['unstable_below']} not, {arm['unstable_above']} unstable above it and {arm['stable_above']} not."
        f" Observer on: {guard['unstable_with_observer']} unstable."
        f" Guard: stops {guard['unstable_stopped']} of {guard['unstable']} unstable, {guard['stable_stopped']} of {guard['stable']} stable."
    )
    return found


def _limit(trace: Trace, theory: Sequence[Boundary]) -> float:
    case = trace.case
    return next(b.gain for b in theory if (b.kind, b.period, b.delay) == (case.kind, case.period, case.delay))


def _write_cases(traces: Sequence[Trace], theory: Sequence[Boundary], path: Path) -> None:
    rows = []
    for trace in traces:
        facts = asdict(trace)
        rows.append({**facts.pop("case"), "theory": _limit(trace, theory), **facts})
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
