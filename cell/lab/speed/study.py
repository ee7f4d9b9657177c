"""`cell study speed`: the guarded figures beside the stored ones, and the time of a scan by package."""

import argparse

from cell.commands.arguments import add_config
from cell.lab.arguments import load_simulated
from cell.lab.report import StudyReport

SUMMARY = "how fast trials, scans, requests and starts are"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, and an option to skip the minute of a first start."""
    add_config(parser)
    parser.add_argument("--quick", action="store_true", help="leave out starts, the first of which compiles all")


def run(args: argparse.Namespace) -> StudyReport:
    """Measure everything on one core."""
    from rich.table import Table

    from cell.lab.speed import measure

    loaded = load_simulated(args, "study speed")
    found = measure.counts_of_a_scan(loaded.cell) | ({} if args.quick else measure.counts_of_starts())
    skipped = {"start"} if args.quick else set()
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
    return StudyReport([figures, shares], {"figures": found, "parts": parts, "real_time": 1.0 / taken.whole})
