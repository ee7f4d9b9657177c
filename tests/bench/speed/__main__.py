"""The guarded figures of speed beside the stored ones, and the time of a scan by package.

python -m tests.bench.speed [--quick]    --quick leaves out starts, the first of which compiles all
"""

import sys

from rich.console import Console
from rich.table import Table

from cell.config.load import load
from tests.bench.speed import measure


def main(is_quick: bool) -> None:
    """Measure everything on one core, and print it."""
    loaded = load(sets=["sim.pace=max"])
    found = measure.counts_of_a_scan(loaded.cell) | ({} if is_quick else measure.counts_of_starts())
    skipped = {"start"} if is_quick else set()
    found |= {name: take() for name, take in measure.all_ratios(loaded).items() if name not in skipped}
    taken, parts = measure.profile(loaded.cell)
    counts, ratios = measure.stored()
    figures = Table("figure", "now", "stored", "what it is", title="Figures that are guarded")
    for name, kept in (counts | ratios).items():
        if name in found:
            figures.add_row(name, f"{found[name]:.3g}", f"{kept.value:.3g}", kept.what)
    shares = Table("part", "us a scan", "%", title="Where a scan's time goes")
    scan = taken.total / taken.scans
    for name, spent in parts.items():
        shares.add_row(name, f"{1e6 * spent:.1f}", f"{100 * spent / scan:.1f}")
    shares.add_section()
    shares.add_row("outside mj_step", f"{1e6 * taken.outside:.1f}", f"{100 * taken.outside / scan:.1f}")
    shares.add_row("all", f"{1e6 * scan:.1f}", f"{1.0 / taken.whole:.1f} x real time")
    Console().print(figures, shares)


if __name__ == "__main__":
    main("--quick" in sys.argv[1:])
