"""Tables of the study of the page."""

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from cell.lab.page.growth import Growth
from cell.lab.page.jitter import Pair, cost

MOST_GROWTH, MOST_LATENCY, MOST_RATIO = 20.0, 0.2, 1.05
"""Targets: growth in 24 simulated hours, MB; latency, s; ratio of the jitter with two pages to that without."""


def growth_table(lines: Sequence[Growth]) -> Table:
    """Return the growth."""
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
    """Return the jitter of each pair, and the ratio of all pairs."""
    shown = Table("pair", "without (us)", "two pages (us)", "ratio", "scans", "page's thread (%)")
    shown.title = f"Jitter of the scan, 99th percentile; ratio of at most {MOST_RATIO:g} wanted; thread in % of a core"
    for number, pair in enumerate(pairs, 1):
        told = pair.told()
        shown.add_row(
            str(number),
            f"{1e6 * told['without']:.0f}",
            f"{1e6 * told['with_pages']:.0f}",
            f"{told['ratio']:.3f}",
            f"{told['scans']:.0f}",
            f"{100 * pair.share:.1f}",
        )
    found, share = cost(pairs), float(np.median([pair.share for pair in pairs]))
    shown.add_row("all", "", "", f"{found.ratio:.3f}", "", f"{100 * share:.1f}")
    verdict = "met" if found.high <= MOST_RATIO else "not met" if found.low > MOST_RATIO else "not told by so many"
    shown.caption = (
        f"all: ratio of the 99th percentiles of all scans, 95 % interval {found.low:.3f} to {found.high:.3f} from {len(pairs)} pairs"
        f" drawn again: {verdict}"
    )
    return shown
