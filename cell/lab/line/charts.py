"""Charts of the connection: reads, commands, and the scan with fifty clients."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from cell.lab.line.measure import POLL_PERIOD, Samples

CHART = "line.png"


def draw(samples: Samples, path: Path) -> None:
    """Draw the three distributions."""
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    reads, busy, jitter = figure.subplots(1, 3)
    for name, times in (("this cell", samples.cell), ("bare server", samples.bare)):
        label = f"{name}: p50 {1e6 * np.median(times):.0f} us, p99 {1e6 * np.percentile(times, 99):.0f} us"
        reads.semilogx(1e6 * np.sort(times), np.linspace(0, 100, len(times)), label=label)
    reads.set(title=f"FC3 of 10 registers, n = {len(samples.cell)} each", xlabel="time (us)", ylabel="answered (%)")
    reads.set_xlim(
        1e6 * np.min([samples.cell.min(), samples.bare.min()]),
        1e6 * np.percentile(np.concatenate([samples.cell, samples.bare]), 99.9),
    )
    busy.hist(1e3 * samples.busy, bins=20)
    busy.axvline(1e3 * samples.scan_period, color="black", linestyle="--", label="one scan")
    busy.set(title=f"Command to a cell at work, n = {len(samples.busy)}", xlabel="time (ms)", ylabel="commands")
    for name, errors in (
        ("no client", samples.quiet),
        (f"{samples.polled.clients} clients at {1e3 * POLL_PERIOD:g} ms", samples.loaded),
    ):
        off = np.sort(np.abs(errors))
        label = f"{name}: p99 {1e3 * np.percentile(off, 99):.2f} ms, n = {len(off)}"
        jitter.loglog(1e3 * np.maximum(off, 1e-6), np.linspace(100, 100 / len(off), len(off)), label=label)
    jitter.set(title="Scan interval during insertions", xlabel="off its period by more than (ms)", ylabel="scans (%)")
    for axes in (reads, busy, jitter):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    figure.savefig(path, dpi=150)
