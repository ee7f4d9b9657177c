"""The tables of the study of the page."""

import math
from collections.abc import Sequence

import numpy as np
from rich.table import Table

from cell.lab.page.growth import Growth
from cell.lab.page.jitter import Pair
from cell.statistics import Z95

MOST_GROWTH, MOST_LATENCY, MOST_RATIO = 20.0, 0.2, 1.05
"""Targets: growth in 24 simulated hours, MB; latency, s; jitter with two pages over that without, ratio."""


def growth_table(lines: Sequence[Growth]) -> Table:
    """Return what grew."""
    shown = Table("what", "hours", "runs", "warm (MB)", "end (MB)", "growth (MB)")
    shown.title = f"Growth with two pages open; under {MOST_GROWTH:g} MB in 24 h wanted"
    for line in lines:
        shown.add_row(
            line.what,
            f"{line.hours:.2f}",
            str(line.runs),
            f"{line.start:.1f}",
            f"{line.end:.1f}",
            f"{line.growth:+.1f}",
        )
    return shown


def latency_table(latencies: Sequence[float]) -> Table:
    """Return the times from an event to the screen."""
    shown = Table("events", "median (ms)", "p95 (ms)", "longest (ms)")
    shown.title = f"From a change of state to the screen; p95 under {1e3 * MOST_LATENCY:g} ms wanted"
    figures = [*np.percentile(latencies, (50, 95, 100))]
    shown.add_row(str(len(latencies)), *(f"{1e3 * figure:.0f}" for figure in figures))
    return shown


def jitter_table(pairs: Sequence[Pair]) -> Table:
    """Return the jitter of each pair, and the median of their ratios."""
    shown = Table("pair", "without (us)", "two pages (us)", "ratio", "scans", "page's thread (%)")
    shown.title = f"Jitter of the scan, 99th percentile; ratio of at most {MOST_RATIO:g} wanted; thread in % of a core"
    for number, pair in enumerate(pairs, 1):
        without, with_pages = 1e6 * pair.without, 1e6 * pair.with_pages
        shown.add_row(
            str(number),
            f"{without:.0f}",
            f"{with_pages:.0f}",
            f"{pair.ratio:.3f}",
            str(pair.scans),
            f"{100 * pair.share:.1f}",
        )
    ratio, share = (float(np.median([getattr(pair, name) for pair in pairs])) for name in ("ratio", "share"))
    low, high = median_interval([pair.ratio for pair in pairs])
    shown.add_row("median", "", "", f"{ratio:.3f}", "", f"{100 * share:.1f}")
    shown.caption = f"95 % interval of the median ratio, by order: {low:.3f} to {high:.3f}, n = {len(pairs)}"
    return shown


def median_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of the median of independent values, between two of them in order; of few, all of them."""
    ordered = sorted(values)
    place = max(math.floor((len(ordered) - Z95 * math.sqrt(len(ordered))) / 2), 0)
    return ordered[place], ordered[-1 - place]
