"""Results of the study of hole events: both detectors as configured, and over all thresholds."""

import math
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from cell.config.cell_config import CellConfig
from cell.lab.events.measure import (
    DETECTORS,
    HEIGHT,
    SKIN,
    Highs,
    Listened,
    Watched,
    listen,
    measure,
    printed_threshold,
    rice_chance,
)
from cell.lab.rows import quantile
from cell.lab.workers import on_processes
from cell.records.provenance import versions
from cell.records.statistics import wilson
from skills.catalogue import SEARCH

TABLE = "events.csv"
RATES = tuple(float(f"{rate:.1g}") for rate in np.geomspace(1e-4, 3.0, 10))
"""Stated false alarms per search, the range of the charts."""
DIPS = (5e-5, 1e-4, 1.5e-4, 2e-4, 2.5e-4, 3e-4, 4e-4, 5e-4, 7e-4, 1e-3)
FALLS = (0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22, 0.25, 0.3, 0.4)
"""Manual thresholds, the range of the charts: m, and fractions of the average."""
NAMES = {HEIGHT: "height of the tip", SKIN: "skin: change, frame to frame"}


@dataclass(frozen=True, slots=True)
class EventLine:
    """Result of one detector at one threshold; times in s, paths in m, NaN if there is no value."""

    detector: str
    in_use: bool
    """True if the threshold is that of the config; the other lines are the charts' curves."""
    threshold: float
    """Threshold: m for the height, fraction of the average for the skin."""
    searches: int
    """Number of searches without a hole."""
    stopped: int
    """Number of those searches with a false event."""
    low: float
    """Lower end of the Wilson 95 % interval of the share with a false event."""
    high: float
    expected: float
    """Expected share with a false event, for the height from the spread about the plane; NaN for the skin."""
    probes: int
    """Number of false events of all searches, judged at rest; -1 for the skin."""
    finds: int
    """Number of searches in which the judgement at rest reported a hole at such a point."""
    finds_high: float
    """Upper end of the Wilson 95 % interval of that share; the lower end is 0 if there are none."""
    falls: int
    """Number of drops of the peg, one in each search with a hole."""
    early: int
    """Number of drops after a false event."""
    detected: int
    """Number of the other drops with an event within the window."""
    detected_low: float
    detected_high: float
    delay: float
    """Median time from the start of the drop to the event, s."""
    delay_p95: float
    way: float
    """Median path of the peg's edge from the start of the drop to the event, m."""
    way_p95: float


@dataclass(frozen=True, slots=True)
class EventStudy:
    """Results of the whole study."""

    title: str
    lines: list[EventLine]
    empty: list[Watched]
    """Records of the searches without a hole."""
    in_hole: int
    """Number of searches that began with the peg in the hole and have no drop."""
    never: int
    """Number of searches with a hole in which the peg never dropped."""
    others: list[str]
    """Endings of searches without a hole other than by their timeout."""


def run(config: CellConfig, seeds: range, with_hole: int, workers: int, done: Callable[[], None]) -> EventStudy:
    """Run the study.

    Args:
        config: Config of a simulated cell.
        seeds: Seeds, one search without a hole each.
        with_hole: Number of seeds that also run with a hole.
        workers: Number of processes.
        done: Called after every search.
    """
    rows = measure(config, seeds, with_hole, workers, done)
    empty, full = [row for row in rows if not row.has_hole], [row for row in rows if row.has_hole]
    fell = [row for row in full if row.after is not None and not row.began_in_hole]
    lines: list[EventLine] = []
    for detector in DETECTORS:
        used = config.params(SEARCH).dip_threshold if detector == HEIGHT else printed_threshold()
        stopped = [row.seed for row in empty if row.before[detector].first(used) is not None]
        heard = list(on_processes(partial(listen, config), stopped, workers)) if detector == HEIGHT else None
        lines.append(_line(detector, used, empty, fell, heard, True))
        for value in DIPS if detector == HEIGHT else FALLS:
            lines.append(_line(detector, value, empty, fell, None, False))
    title = (
        f"{len(empty)} searches of {config.params(SEARCH).timeout:g} s without a hole, {len(fell)} falls, simulated, from seed {seeds[0]}; "
        f"python {platform.python_version()}, "
        + ", ".join(f"{name} {versions()[name]}" for name in ("mujoco", "numpy", "code"))
    )
    return EventStudy(
        title=title,
        lines=lines,
        empty=empty,
        in_hole=sum(row.began_in_hole for row in full),
        never=sum(row.after is None for row in full),
        others=[f"seed {row.seed}: {row.ended}" for row in empty if row.ended],
    )


def _line(
    detector: str,
    threshold: float,
    empty: Sequence[Watched],
    fell: Sequence[Watched],
    heard: Sequence[Listened] | None,
    in_use: bool,
) -> EventLine:
    stopped = sum(row.before[detector].first(threshold) is not None for row in empty)
    late = [row for row in fell if row.before[detector].first(threshold) is None]
    events = [event for row in late if (event := _after(row)[detector].first(threshold)) is not None]
    expected = float(np.mean([rice_chance(row, threshold) for row in empty])) if detector == HEIGHT else math.nan
    finds = sum(one.found for one in heard) if heard is not None else -1
    low, high = wilson(stopped, len(empty))
    seen_low, seen_high = wilson(len(events), len(late))
    times, ways = [event[0] for event in events], [event[2] for event in events]
    return EventLine(
        detector=detector,
        in_use=in_use,
        threshold=threshold,
        searches=len(empty),
        stopped=stopped,
        low=low,
        high=high,
        expected=expected,
        probes=sum(one.rests for one in heard) if heard is not None else -1,
        finds=finds,
        finds_high=wilson(finds, len(empty))[1] if heard is not None else math.nan,
        falls=len(fell),
        early=len(fell) - len(late),
        detected=len(events),
        detected_low=seen_low,
        detected_high=seen_high,
        delay=quantile(times, 0.5),
        delay_p95=quantile(times, 0.95),
        way=quantile(ways, 0.5),
        way_p95=quantile(ways, 0.95),
    )


def _after(row: Watched) -> dict[str, Highs]:
    assert row.after is not None
    return row.after
