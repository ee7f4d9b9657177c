"""`cell study page`: growth, latency and the cost of open pages for the scan."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from cell.commands.arguments import out_folder, positive
from cell.commands.terminal import progress
from cell.lab.arguments import add_out
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from cell.lab.page.jitter import Pair

CURVE = "growth.csv"
"""File of the memory over the simulated hours, MB."""
SUMMARY = "what the page costs the scan, how fast it shows what happens, whether anything grows"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the output folder and the extent of the measurement."""
    add_out(parser)
    parser.add_argument(
        "--hours",
        type=float,
        default=2.0,
        metavar="H",
        help="simulated hours of runs for the growth, after up to one hour of warm-up; 0 measures only what the scan pays",
    )
    parser.add_argument(
        "--pairs", type=positive, default=12, metavar="N", help="pairs of stretches with and without pages; default 12"
    )
    parser.add_argument("--quick", action="store_true", help="a few runs, events and seconds")


def run(args: argparse.Namespace) -> StudyReport:
    """Measure and write the figures; without a browser, only the cost for the scan."""
    from cell.lab.page import browser, growth, jitter, replay, tables
    from cell.lab.rows import write_rows

    folder, curve = out_folder(args.out), list[dict[str, float]]()
    file = folder / "page.json"
    hours, events, pairs, length = (0.05, 10, 1, 1.5) if args.quick else (args.hours, 200, args.pairs, 6.0)
    lines: list[growth.Growth] = []
    latencies: list[float] = []
    with progress() as bars, TemporaryDirectory() as name:
        records = Path(name)
        if hours > 0.0 and browser.is_there():
            looks = replay.recorded(records / "run")
            bar = bars.add_task("growth", total=100)
            with growth.shown(records / "page") as (page, opened):

                def seen(share: float, look: growth.MemoryLook | None) -> None:
                    bars.update(bar, completed=round(100 * share))
                    if look is not None:
                        curve.append({"hours": round(look.hours, 3), "runs": look.runs, **look.memory})
                        write_rows(curve, folder / CURVE)  # an interrupted call keeps its samples

                lines = growth.measure_growth(page, opened, looks, hours, seen)
                latencies = growth.measure_latency(page, opened, looks, events)
        result = {
            "growth": [asdict(line) | {"growth": line.growth} for line in lines],
            "latency": latencies,
            "browser": "chromium" if browser.is_there() else browser.MISSING,
        }
        _save(file, result)  # hours of growth survive a later failure
        bar = bars.add_task("pairs", total=pairs)

        def took(so_far: Sequence[jitter.Pair]) -> None:
            bars.advance(bar)
            _save(file, result | {"jitter": _told(so_far)})  # an interrupted call keeps its pairs

        found = jitter.measure(pairs, length, records / "jitter", took)
    shown = [tables.jitter_table(found)]
    if lines:
        shown = [tables.growth_table(lines), tables.latency_table(latencies), *shown]
    result = finite(result | {"jitter": _told(found), "cost": asdict(jitter.cost(found))})
    _save(file, result)
    return StudyReport(shown, result, [file])


def _told(pairs: "Sequence[Pair]") -> list[dict[str, float]]:
    """Return the figures of the pairs as data."""
    told: list[dict[str, float]] = finite([pair.told() for pair in pairs])
    return told


def _save(file: Path, result: object) -> None:
    file.write_text(json.dumps(result, indent=2), encoding="utf-8")
