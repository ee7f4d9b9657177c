"""Chart of the study of errors: success, time and force against the size of each error."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cell.film.plots import COLOURS
from cell.lab.frontier.measure import FrontierLine
from cell.lab.reality.measure import ALL

CHART = "reality.png"


def draw(lines: Sequence[FrontierLine], title: str, folder: Path) -> Path:
    """Draw a row for each error and a marker for each scale: success with its Wilson interval, mean time, and force;
    return the file.
    """
    families = list(dict.fromkeys(line.family for line in lines))
    scales = sorted({line.variant for line in lines}, key=float)
    place = {family: -number for number, family in enumerate(families)}
    ideal = next((line for line in lines if line.family == ALL and float(line.variant) == 0.0), None)
    figure = Figure(figsize=(12.5, 2.2 + 0.34 * len(families)), layout="constrained")
    success, time, force = figure.subplots(1, 3, sharey=True)
    for number, scale in enumerate(scales):
        of_scale = [line for line in lines if line.variant == scale and line.trials]
        heights = [place[line.family] + 0.16 * (number - (len(scales) - 1) / 2) for line in of_scale]
        style = {"color": COLOURS[number % len(COLOURS)], "fmt": "o", "markersize": 4, "label": f"scale {scale}"}
        rates = [100 * line.successes / line.trials for line in of_scale]
        bounds = [
            [rate - 100 * line.low for rate, line in zip(rates, of_scale, strict=True)],
            [100 * line.high - rate for rate, line in zip(rates, of_scale, strict=True)],
        ]
        success.errorbar(rates, heights, xerr=bounds, **style)
        time.errorbar([line.mean for line in of_scale], heights, xerr=[line.mean_error for line in of_scale], **style)
        spread = [[0.0] * len(of_scale), [line.force_p95 - line.force_median for line in of_scale]]
        force.errorbar([line.force_median for line in of_scale], heights, xerr=spread, **style)
    if ideal is not None:
        time.axvline(ideal.mean, color="#888888", linewidth=0.8)
        force.axvline(ideal.force_median, color="#888888", linewidth=0.8)
    success.set_yticks(list(place.values()), families, fontsize=8)
    success.set_xlim(0.0, 102.0)
    success.set_xlabel("success (%), Wilson 95 % interval")
    time.set_xlabel("mean total time of successes (s), 95 % interval")
    force.set_xlabel("largest contact force (N): median to p95")
    for axes in (success, time, force):
        axes.grid(alpha=0.3)
    force.legend(loc="lower right", fontsize=8)
    figure.suptitle(f"What errors of the cell cost, each alone and all together; grey: no errors\n{title}", fontsize=9)
    path = folder / CHART
    figure.savefig(path, dpi=110)
    return path
